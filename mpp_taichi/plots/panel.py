"""A panel in pictures: where the axes stay, only the new part of each curve is drawn."""

import numpy as np
from PIL import Image

from mpp_taichi.plots.axis import Axis
from mpp_taichi.plots.content import Curves, Histogram, Plot
from mpp_taichi.plots.frame import PanelFrame, color_of, equalised, fitting_axes
from mpp_taichi.plots.ink import FINER, Ink, put_disc
from mpp_taichi.plots.painters import PicturePainter
from mpp_taichi.plots.theme import Rgb, Theme

CURVE_WIDTH, BAND_WIDTH, DISC = 2.0, 6.0, 4.0  # pixels, where letters are 15 high; theory is a band below a curve
BAR = 0.8  # share of the curve's colour in a bar; the rest is background
TALLEST = 1.5  # times the height that the histogram needs: a taller axis is made shorter
LATER = 1.6  # factor by which the time axis grows where the end of the run is not known


class Panel:
    """Draws one plot, again and again while it grows."""

    def __init__(self, plot: Plot, width: int, height: int, size: int, theme: Theme) -> None:
        """Nothing is drawn until the first `picture`."""
        self.plot, self.theme = plot, theme
        self.frame = PanelFrame.of(plot, width, height, size, theme)
        self.axes: tuple[Axis, Axis] = (Axis(0.0, 1.0), Axis(0.0, 1.0))
        logarithmic = isinstance(plot, Curves) and plot.logarithmic
        self._wanted = (Axis(0.0, 1.0), Axis(0.0, 1.0, logarithmic))  # before both get the same scale
        self._canvas = Image.new("RGB", (width, height), theme.background)
        self._grid = self._canvas
        self._inks: list[Ink] = []
        self._generation, self._drawn = -1, 0
        self._fitted = False  # whether the axes were chosen for values
        self._theory = np.zeros(0)

    def picture(self) -> Image.Image:
        """The panel now; the caller must not draw into it."""
        if isinstance(self.plot, Histogram):
            return self._histogram(self.plot)
        return self._curves(self.plot)

    # Curves

    def _curves(self, plot: Curves) -> Image.Image:
        samples = plot.samples
        if samples.generation != self._generation or not self._inks:
            self._generation = samples.generation
            self._begin(plot)
        elif samples.count > self._drawn:
            if not self._fitted and self._spread(plot):
                self._begin(plot)
            elif not self._holds(plot):
                self._grow(plot)
        if samples.count > self._drawn:
            self._append(plot, max(self._drawn - 1, 0))
        return self._marked(plot)

    def _begin(self, plot: Curves) -> None:
        """Choose the axes and begin to draw again."""
        self._wanted, self._fitted = fitting_axes(plot), self._spread(plot)
        self._blank(plot)

    def _blank(self, plot: Curves) -> None:
        """An empty field with the present axes."""
        self.axes = equalised(*self._wanted, self.frame) if plot.equal else self._wanted
        self._grid = Image.new("RGB", (self.frame.width, self.frame.height))
        self.frame.draw(PicturePainter(self._grid), plot, *self.axes, self.theme)
        self._canvas = self._grid.copy()
        left, top, right, bottom = self.frame.field
        size = FINER * (right - left), FINER * (bottom - top)
        scale = self.frame.size / 15.0
        self._inks = []
        for number in range(plot.count):
            theory = number >= len(plot.names)
            width = (BAND_WIDTH if theory else CURVE_WIDTH) * scale
            self._inks.append(Ink(color_of(plot, number, self.theme), width, size))
        self._drawn = 0

    def _spread(self, plot: Curves) -> bool:
        """Whether values vary along both axes, so that limits can be chosen for them."""
        x_axis, y_axis = self._wanted
        return x_axis.spreads(plot.x) and any(y_axis.spreads(plot.y(number)) for number in range(plot.count))

    def _fresh(self, plot: Curves) -> tuple[np.ndarray, np.ndarray]:
        y = np.concatenate([plot.y(number)[self._drawn :] for number in range(plot.count)])
        return plot.x[self._drawn :], y

    def _holds(self, plot: Curves) -> bool:
        x, y = self._fresh(plot)
        return self.axes[0].covers(x) and self.axes[1].covers(y)

    def _grow(self, plot: Curves) -> None:
        """Axes with room for the values outside the old axes."""
        x_axis, y_axis = self._wanted
        if plot.span is None:
            x_axis = x_axis.grown(plot.x)
        elif not x_axis.covers(plot.x[-1:]):
            x_axis = Axis(x_axis.low, x_axis.low + LATER * (float(plot.x[-1]) - x_axis.low))
        self._wanted = x_axis, y_axis.grown(np.concatenate([plot.y(number) for number in range(plot.count)]))
        self._blank(plot)

    def _append(self, plot: Curves, first: int) -> None:
        """Draw from sample `first` on."""
        x = self.axes[0].share(plot.x[first:])
        left, top = self.frame.field[:2]
        boxes = []
        for number, ink in enumerate(self._inks):
            points = self.frame.points(x, self.axes[1].share(plot.y(number)[first:])) - (left, top)
            boxes += ink.draw(points)
        if boxes:
            extremes = np.array(boxes)
            box = (*extremes[:, :2].min(axis=0).tolist(), *extremes[:, 2:].max(axis=0).tolist())
            self._compose(box)
        self._drawn = plot.samples.count

    def _compose(self, box: tuple[int, int, int, int]) -> None:
        """Compose the part of the field inside the box again, from the grid and all inks."""
        left, top = self.frame.field[:2]
        place = (left + box[0], top + box[1], left + box[2], top + box[3])
        part = self._grid.crop(place)
        for ink in reversed(self._inks):  # theory first
            part.paste(ink.color, (0, 0, part.width, part.height), ink.cover(box))
        self._canvas.paste(part, place)

    def _marked(self, plot: Curves) -> Image.Image:
        """The picture with a disc at the last point of every curve."""
        picture = self._canvas.copy()
        if plot.samples.count == 0:
            return picture
        x = self.axes[0].share(plot.x[-1:])
        for number, ink in reversed(list(enumerate(self._inks))):
            point = self.frame.points(x, self.axes[1].share(plot.y(number)[-1:]))[0]
            if np.isfinite(point).all() and number < len(plot.names):
                put_disc(picture, point, DISC * self.frame.size / 15.0, ink.color)
        return picture

    # Histograms

    def _histogram(self, plot: Histogram) -> Image.Image:
        if plot.generation == self._generation:
            return self._canvas
        self._generation = plot.generation
        x, y = fitting_axes(plot)
        fits = y.high <= self.axes[1].high <= TALLEST * y.high
        if not self._inks or (x.low, x.high) != (self.axes[0].low, self.axes[0].high) or not fits:
            self.axes = (x, y)
            self._grid = Image.new("RGB", (self.frame.width, self.frame.height))
            self.frame.draw(PicturePainter(self._grid), plot, *self.axes, self.theme)
            self._inks, self._theory = [self._new_ink()], np.zeros(0)
        self._canvas = self._grid.copy()
        self._bars(plot)
        self._law(plot)
        return self._canvas

    def _new_ink(self) -> "Ink":
        left, top, right, bottom = self.frame.field
        width = CURVE_WIDTH * self.frame.size / 15.0
        return Ink(self.theme.theory, width, (FINER * (right - left), FINER * (bottom - top)))

    def _bars(self, plot: Histogram) -> None:
        painter = PicturePainter(self._canvas)
        color = blended(self.theme.curve(0), self.theme.field, BAR)
        for box in bars(plot, self.frame, self.axes):
            painter.rectangle(box, color)

    def _law(self, plot: Histogram) -> None:
        if not len(plot.theory):
            return
        if not np.array_equal(plot.theory, self._theory):
            self._theory = plot.theory
            self._inks = [self._new_ink()]
            left, top = self.frame.field[:2]
            points = self.frame.points(self.axes[0].share(plot.curve), self.axes[1].share(plot.theory)) - (left, top)
            self._inks[0].draw(points)
        left, top, right, bottom = self.frame.field
        ink = self._inks[0]
        self._canvas.paste(ink.color, self.frame.field, ink.cover((0, 0, right - left, bottom - top)))


def bars(plot: Histogram, frame: PanelFrame, axes: tuple[Axis, Axis]) -> list[tuple[float, float, float, float]]:
    """Boxes of the bars in pixels: left, top, right, bottom."""
    if not len(plot.edges):
        return []
    base = frame.field[3]
    x = frame.points(axes[0].share(plot.edges), np.zeros(len(plot.edges)))[:, 0]
    y = frame.points(np.zeros(len(plot.density)), axes[1].share(plot.density))[:, 1]
    return [(x0 + 0.5, top, x1 - 0.5, base) for x0, x1, top in zip(x[:-1], x[1:], y)]


def blended(color: Rgb, ground: Rgb, share: float) -> Rgb:
    """A colour over another."""
    red, green, blue = (round(share * a + (1.0 - share) * b) for a, b in zip(color, ground))
    return red, green, blue
