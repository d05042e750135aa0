"""The values of a panel at the place of the mouse."""

from dataclasses import dataclass

import numpy as np
from PIL import Image

from mpp_taichi.plots.content import Curves, Histogram
from mpp_taichi.plots.frame import color_of
from mpp_taichi.plots.ink import put_disc
from mpp_taichi.plots.painters import PicturePainter, text_width
from mpp_taichi.plots.panel import DISC, Panel
from mpp_taichi.plots.theme import Rgb

DIGITS = 5  # of a number in the reading


@dataclass(frozen=True)
class CursorReading:
    """Lines to show, the first for x, and the points on the curves that they belong to, in pixels of the panel."""

    lines: tuple[tuple[str, Rgb], ...]
    points: tuple[tuple[float, float, Rgb], ...]


def read(panel: Panel, x: float, y: float) -> CursorReading | None:
    """The values at a place, in pixels of the panel; None outside its field, and where there are no samples."""
    left, top, right, bottom = panel.frame.field
    if not (left <= x <= right and top <= y <= bottom):
        return None
    if isinstance(panel.plot, Histogram):
        return _of_histogram(panel, panel.plot, (x - left) / (right - left))
    if panel.plot.samples.count == 0:
        return None
    return _of_curves(panel, panel.plot, x, y)


def with_reading(panel: Panel, picture: Image.Image, reading: CursorReading) -> Image.Image:
    """A copy of the panel's picture with the values written into it."""
    picture = picture.copy()
    painter, theme, size = PicturePainter(picture), panel.theme, panel.frame.size
    left, top, right, bottom = panel.frame.field
    if reading.points:
        x = reading.points[0][0]
        painter.line((x, top, x, bottom), theme.faint, 1.0)
    for x, y, color in reading.points:
        put_disc(picture, np.array([x, y]), DISC * size / 15.0, color)
    width = max(text_width(text, size) for text, _ in reading.lines) + size
    height = 1.3 * size * len(reading.lines) + 0.5 * size
    middle = reading.points[0][0] if reading.points else left
    corner = right - width - 2 if middle < 0.5 * (left + right) else left + 2
    hidden = reading.points and reading.points[0][1] < top + height + 2
    head = bottom - height - 2 if hidden else top + 2
    painter.rectangle((corner, head, corner + width, head + height), theme.background)
    for number, (text, color) in enumerate(reading.lines):
        painter.text(corner + 0.5 * size, head + (0.9 + 1.3 * number) * size, text, color, size)
    return picture


def _of_histogram(panel: Panel, plot: Histogram, share: float) -> CursorReading | None:
    value = panel.axes[0].value(share)
    bin_number = int(np.searchsorted(plot.edges, value, side="right")) - 1
    if not 0 <= bin_number < len(plot.density):
        return None
    low, high = plot.edges[bin_number], plot.edges[bin_number + 1]
    lines = [
        (f"{low:.3g} to {high:.3g}", panel.theme.text),
        (f"density = {_number(plot.density[bin_number])}", panel.theme.curve(0)),
    ]
    if len(plot.theory):
        theory = float(np.interp(0.5 * (low + high), plot.curve, plot.theory))
        lines.append((f"theory = {_number(theory)}", panel.theme.theory))
    return CursorReading(tuple(lines), ())


def _of_curves(panel: Panel, plot: Curves, x: float, y: float) -> CursorReading | None:
    xs = plot.x
    rises = plot.span is not None or bool(np.all(np.diff(xs) > 0.0))
    left, _, right, _ = panel.frame.field
    if rises:
        value = panel.axes[0].value((x - left) / (right - left))
        if not xs[0] <= value <= xs[-1]:
            return None
        values = [float(np.interp(value, xs, plot.y(number))) for number in range(plot.count)]
    else:
        index = _nearest(panel, plot, x, y)
        value, values = float(xs[index]), [float(plot.y(number)[index]) for number in range(plot.count)]
    lines, points = [(f"{plot.x_label} = {_number(value)}", panel.theme.text)], []
    for number, (name, each) in enumerate(zip([*plot.names, *["theory"] * plot.theories], values)):
        color = color_of(plot, number, panel.theme)
        lines.append((f"{name} = {_number(each)}", color if number < len(plot.names) else panel.theme.faint))
        place = panel.frame.points(panel.axes[0].share(np.array([value])), panel.axes[1].share(np.array([each])))[0]
        points += [(float(place[0]), float(place[1]), color)] if np.isfinite(place).all() else []
    return CursorReading(tuple(lines), tuple(points))


def _nearest(panel: Panel, plot: Curves, x: float, y: float) -> int:
    """The number of the sample that has the nearest point on any curve."""
    shares = panel.axes[0].share(plot.x)
    distances = [
        np.linalg.norm(panel.frame.points(shares, panel.axes[1].share(plot.y(number))) - (x, y), axis=1)
        for number in range(plot.count)
    ]
    return int(np.nanargmin(np.nan_to_num(np.min(distances, axis=0), nan=np.inf)))


def _number(value: float) -> str:
    return f"{value:.{DIGITS}g}".replace("-", "−")
