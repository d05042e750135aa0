"""Map: a number over two axes as colours, with a bar that says which colour is which number."""

import base64
import io
import math
from dataclasses import dataclass

import numpy as np
from PIL import Image

from mpp_taichi.plots.axis import Axis, Tick
from mpp_taichi.plots.painters import Painter, PicturePainter, SvgPainter
from mpp_taichi.plots.svg import FONTS
from mpp_taichi.plots.theme import DARK, LIGHT, Theme

# Every 32nd colour of viridis by S. van der Walt and N. Smith (2015), which they gave into the public domain (CC0).
VIRIDIS = np.array(
    [
        *((68, 1, 84), (71, 44, 122), (59, 81, 139), (44, 113, 142), (33, 144, 141)),
        *((39, 173, 129), (92, 200, 99), (170, 220, 50), (253, 231, 37)),
    ],
    float,
)
FEW = 0.005  # of all numbers, at each end, may be beyond the bar
FAR = 0.5  # of the range of the others, the distance from which on they are beyond it
BAR = 1.1  # width of the bar over the height of a letter


@dataclass(frozen=True, eq=False)
class MapAxis:
    """An axis of a map: its label, and its values at the middle of each column or row; words where they are no numbers."""

    label: str
    values: np.ndarray
    logarithmic: bool = False

    @property
    def is_numeric(self) -> bool:
        """Whether the values are numbers."""
        return self.values.dtype != object and self.values.dtype.kind in "if"

    def ticks(self, most: int) -> tuple[list[Tick], str]:
        """Ticks at round numbers, or at the middle of a cell for words; and a power of ten that all labels share."""
        count = len(self.values)
        if not self.is_numeric or count == 1:
            every = max(1, -(-count // max(most, 1)))
            words = [f"{each:.6g}" if isinstance(each, float) else str(each) for each in self.values.tolist()]
            return [Tick((k + 0.5) / count, words[k]) for k in range(0, count, every)], ""
        ticks, power = self.axis().ticks(most)
        return [tick for tick in ticks if -1e-9 <= tick.share <= 1.0 + 1e-9], power

    def axis(self) -> Axis:
        """The axis from the outer edge of the first cell to the outer edge of the last."""
        values = np.log10(self.values) if self.logarithmic else self.values.astype(float)
        half = 0.5 * (values[-1] - values[0]) / (len(values) - 1)
        return Axis(float(values[0] - half), float(values[-1] + half), self.logarithmic)


@dataclass(frozen=True, eq=False)
class Map:
    """Numbers over two axes, (values of x, values of y); NaN where a cell has no number, `unknown` where it has none yet."""

    title: str
    x: MapAxis
    y: MapAxis
    values: np.ndarray
    unknown: np.ndarray
    unit: str = ""
    legend: str = "no number"

    @property
    def extent(self) -> tuple[float, float]:
        """The least and the largest number that have a colour of their own.

        A few numbers far from all others would leave one colour to the others: they have the colour of the end of the bar.
        """
        finite = self.values[np.isfinite(self.values)]
        if not finite.size:
            return 0.0, 1.0
        low, high = float(finite.min()), float(finite.max())
        most = np.quantile(finite, (FEW, 1.0 - FEW))
        room = FAR * float(most[1] - most[0])
        if room > 0.0:
            low = float(most[0]) if low < most[0] - room else low
            high = float(most[1]) if high > most[1] + room else high
        return (low, high) if high > low else (low - 0.5 * (abs(low) or 1.0), high + 0.5 * (abs(high) or 1.0))


def colors_of(shares: np.ndarray) -> np.ndarray:
    """Colours of shares 0 … 1, uint8 (…, 3)."""
    place = np.clip(np.nan_to_num(shares), 0.0, 1.0) * (len(VIRIDIS) - 1)
    lower = np.minimum(place.astype(int), len(VIRIDIS) - 2)
    part = (place - lower)[..., None]
    return np.rint(VIRIDIS[lower] * (1.0 - part) + VIRIDIS[lower + 1] * part).astype(np.uint8)


def raster(plot: Map, theme: Theme) -> Image.Image:
    """A pixel for each cell, the first row of y at the bottom."""
    low, high = plot.extent
    pixels = colors_of((plot.values - low) / (high - low))
    pixels[~np.isfinite(plot.values)] = theme.band
    pixels[plot.unknown] = theme.background
    return Image.fromarray(np.ascontiguousarray(pixels.transpose(1, 0, 2)[::-1]), "RGB")


@dataclass(frozen=True)
class MapFrame:
    """Places in a picture of `size` (width, height) pixels with letters `letters` high; field: left, top, right, bottom."""

    size: tuple[int, int]
    letters: int

    @property
    def field(self) -> tuple[int, int, int, int]:
        """The field of the map."""
        width, height = self.size
        return (
            round(5.5 * self.letters),
            round(2.6 * self.letters),
            width - round(8.0 * self.letters),
            height - round(4.2 * self.letters),
        )

    @property
    def bar(self) -> tuple[int, int, int, int]:
        """The bar of colours."""
        _, top, right, bottom = self.field
        left = right + round(1.2 * self.letters)
        return left, top, left + round(BAR * self.letters), bottom

    def draw(self, painter: Painter, plot: Map, theme: Theme) -> None:
        """Draw everything but the map and the bar."""
        letters, (left, top, right, bottom) = self.letters, self.field
        x_ticks, x_power = plot.x.ticks(max(2, (right - left) // (5 * letters)))
        y_ticks, y_power = plot.y.ticks(max(2, (bottom - top) // (2 * letters)))
        for tick in x_ticks:
            x = left + tick.share * (right - left)
            painter.line((x, bottom, x, bottom + 0.4 * letters), theme.faint, letters / 15.0)
            painter.text(x, bottom + 1.1 * letters, tick.label, theme.faint, letters, "m")
        for tick in y_ticks:
            y = bottom - tick.share * (bottom - top)
            painter.line((left - 0.4 * letters, y, left, y), theme.faint, letters / 15.0)
            painter.text(left - 0.6 * letters, y, tick.label, theme.faint, letters, "r")
        painter.text(0.6 * letters, 1.2 * letters, plot.title, theme.text, round(1.1 * letters))
        x_label = f"{plot.x.label} {x_power}".strip()
        painter.text(0.5 * (left + right), bottom + 2.6 * letters, x_label, theme.text, letters, "m")
        y_label = f"↑ {plot.y.label} {y_power}".strip()
        painter.text(0.6 * letters, bottom + 2.6 * letters, y_label, theme.text, letters)
        self._draw_bar(painter, plot, theme)

    def _draw_bar(self, painter: Painter, plot: Map, theme: Theme) -> None:
        letters, (_, top, right, bottom) = self.letters, self.bar
        low, high = plot.extent
        ticks, power = Axis(low, high).ticks(max(2, (bottom - top) // (3 * letters)))
        for tick in ticks:
            if -1e-9 <= tick.share <= 1.0 + 1e-9:
                y = bottom - tick.share * (bottom - top)
                painter.line((right, y, right + 0.3 * letters, y), theme.faint, letters / 15.0)
                painter.text(right + 0.5 * letters, y, tick.label, theme.faint, letters)
        finite = plot.values[np.isfinite(plot.values)]
        if finite.size and (finite.max() > high or finite.min() < low):
            beyond = f"{finite.min():.3g} … {finite.max():.3g}"
            y = bottom + 2.6 * letters
            painter.text(self.size[0] - 0.6 * letters, y, f"all: {beyond}", theme.faint, letters, "r")
        unit = " ".join(filter(None, (power, plot.unit)))
        painter.text(right, top - 0.9 * letters, unit, theme.faint, letters, "m")
        if np.isnan(plot.values[~plot.unknown]).any():
            y = bottom + 1.4 * letters
            painter.rectangle((self.bar[0], y - 0.4 * letters, self.bar[0] + 0.8 * letters, y + 0.4 * letters), theme.band)
            painter.text(self.bar[0] + 1.1 * letters, y, plot.legend, theme.faint, letters)


def draw_picture(plot: Map, size: tuple[int, int], theme: Theme = DARK) -> Image.Image:
    """The map as a picture."""
    frame = MapFrame(size, letters_of(size))
    picture = Image.new("RGB", size, theme.background)
    for box, part in ((frame.field, raster(plot, theme)), (frame.bar, _bar())):
        picture.paste(part.resize((box[2] - box[0], box[3] - box[1]), Image.Resampling.NEAREST), box[:2])
    frame.draw(PicturePainter(picture), plot, theme)
    return picture


def draw_svg(plot: Map, size: tuple[int, int], theme: Theme = LIGHT) -> str:
    """The map as SVG: its cells are a small picture inside, its letters are letters."""
    frame, painter = MapFrame(size, letters_of(size)), SvgPainter()
    painter.rectangle((0, 0, *size), theme.background)
    for box, part in ((frame.field, raster(plot, theme)), (frame.bar, _bar())):
        left, top, right, bottom = box
        place = f'x="{left}" y="{top}" width="{right - left}" height="{bottom - top}"'
        painter.elements.append(
            f'<image {place} preserveAspectRatio="none" style="image-rendering:pixelated" href="{_data(part)}"/>'
        )
    frame.draw(painter, plot, theme)
    head = f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {size[0]} {size[1]}" width="{size[0]}" height="{size[1]}"'
    return "\n".join([f'{head} font-family="{FONTS}">', *painter.elements, "</svg>\n"])


def letters_of(size: tuple[int, int]) -> int:
    """Height of letters for a picture of this size."""
    return max(10, min(round(size[1] / 40), round(size[0] / 56)))


def _bar() -> Image.Image:
    return Image.fromarray(np.ascontiguousarray(colors_of(np.linspace(1.0, 0.0, 256))[:, None]), "RGB")


def _data(part: Image.Image) -> str:
    stream = io.BytesIO()
    part.save(stream, "PNG")
    return "data:image/png;base64," + base64.b64encode(stream.getvalue()).decode()


def coarse_fill(values: np.ndarray, known: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Values of a grid where each cell that is not known has the value of the finest coarser grid; and which have none.

    A coarser grid has the cells whose numbers along each axis are multiples of a power of two.
    """
    result, unknown = np.full(values.shape, np.nan), np.ones(values.shape, bool)
    deepest = max(math.ceil(math.log2(size)) if size > 1 else 0 for size in values.shape)
    for level in range(deepest, -1, -1):
        places = np.ix_(*(np.arange(size) // 2**level * 2**level for size in values.shape))
        has = known[places]
        result[has], unknown[has] = values[places][has], False
    return result, unknown
