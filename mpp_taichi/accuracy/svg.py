"""SVG: line plots, axes logarithmic or linear, written by hand, without scripts; colours come from the page’s style sheet."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from xml.sax.saxutils import escape, quoteattr

NAMESPACE = "http://www.w3.org/2000/svg"
WIDTH, HEIGHT = 640, 400
LEFT, RIGHT, TOP, BOTTOM = 70, 16, 14, 52
MARKERS = ("circle", "square", "diamond", "triangle", "cross", "plus")
RADIUS, SMALL = 4.0, 2.2  # of a marker, and of a grey one
RIGHT_OF_END = (0.3, -0.7, 1.3, -1.7, 2.3, -2.7, 3.3, -3.7)  # heights of a line below the end at which a name is tried
ABOVE_END = (-0.6, 1.2, -1.7, 2.2, -2.7, 3.2)  # where the name is on the line itself
LETTER = 6.3  # pixels: the mean width of a letter of a name
LINE_HEIGHT = 12.0
TICKS = 8  # on a linear axis at most


@dataclass(frozen=True)
class PlotMark:
    """A point of a plot, in its own units, with the text shown under the pointer."""

    x: float
    y: float
    said: str = ""
    strong: bool = False  # on the front
    bound: bool = False  # at most so much: drawn hollow, with an arrow


@dataclass(frozen=True)
class Series:
    """Points that belong together; `number` chooses colour and marker, `joined` draws a line, `marked` the points.

    A series with a number below 0 is grey. Of many of them, one is brought out when the pointer is on it, with its name.
    """

    name: str
    number: int
    points: Sequence[PlotMark]
    joined: bool = True
    marked: bool = True
    dashed: bool = False
    labelled: bool = False  # with its name at the end


@dataclass(frozen=True)
class Plot:
    """Axes and series. Axes are logarithmic unless said to be linear; points without a logarithm are left out."""

    title: str
    x_label: str
    y_label: str
    series: Sequence[Series]
    notes: Sequence[str] = field(default_factory=tuple)
    linear_x: bool = False
    linear_y: bool = False


def draw(plot: Plot) -> str:
    """The plot as an <svg> element."""
    frame = _Frame(plot)
    if not frame.shown:
        return f"<p>{escape(plot.title)}: nothing to draw.</p>"
    parts = [
        f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" xmlns="{NAMESPACE}" aria-label={quoteattr(plot.title)}>',
        f"<title>{escape(plot.title)}</title>",
        *_axes(frame, plot),
        *(line for series in plot.series if series.number < 0 for line in _quiet(frame, series)),
        *(line for series in plot.series if series.number >= 0 for line in _series(frame, series)),
        *_labels(frame, plot.series),
        "</svg>",
    ]
    return "\n".join(parts)


def marker(number: int, x: float, y: float, *, hollow: bool = False, radius: float = RADIUS, said: str = "") -> str:
    """One marker; shape and colour go by the number, so that neither is needed to tell series apart."""
    style = (f"c{number % 8}" if number >= 0 else "cq") + (" hollow" if hollow else "")
    shape = MARKERS[number % len(MARKERS)] if number >= 0 else "circle"
    r = radius
    if shape == "circle":
        body = f'<circle class="{style}" cx="{x:.1f}" cy="{y:.1f}" r="{r:.1f}">'
        end = "</circle>"
    else:
        outline = {
            "square": [(-r, -r), (r, -r), (r, r), (-r, r)],
            "diamond": [(0, -1.3 * r), (1.3 * r, 0), (0, 1.3 * r), (-1.3 * r, 0)],
            "triangle": [(0, -1.2 * r), (1.2 * r, r), (-1.2 * r, r)],
            "cross": _cross(r, turned=True),
            "plus": _cross(r, turned=False),
        }[shape]
        points = " ".join(f"{x + dx:.1f},{y + dy:.1f}" for dx, dy in outline)
        body, end = f'<polygon class="{style}" points="{points}">', "</polygon>"
    return f"{body}<title>{escape(said)}</title>{end}" if said else body + end


def _cross(r: float, *, turned: bool) -> list[tuple[float, float]]:
    w = 0.4 * r
    arms = [(-w, -r), (w, -r), (w, -w), (r, -w), (r, w), (w, w), (w, r), (-w, r), (-w, w), (-r, w), (-r, -w), (-w, -w)]
    if not turned:
        return arms
    half = math.sqrt(0.5)
    return [(half * (x - y), half * (x + y)) for x, y in arms]


class _LogScale:
    """An axis: maps values to 0 … 1 along it, and has ticks."""

    def __init__(self, values: Sequence[float], *, linear: bool) -> None:
        """Cover a little more than the range of the values, and on a logarithmic axis at least a decade."""
        self.linear = linear
        low, high = min(map(self._of, values)), max(map(self._of, values))
        least = 0.0 if linear else 1.0
        room = max(0.04 * (high - low), 0.5 * (least - (high - low)), 0.0) or 0.5
        self.low, self.high = low - room, high + room

    def share(self, value: float) -> float:
        """The place of a value on the axis, 0 … 1."""
        return (self._of(value) - self.low) / (self.high - self.low)

    def ticks(self) -> list[tuple[float, str]]:
        """The values of the ticks, and their labels."""
        if self.linear:
            rough = (self.high - self.low) / TICKS
            decade = 10.0 ** math.floor(math.log10(rough))
            step = next(factor * decade for factor in (1.0, 2.0, 5.0, 10.0) if factor * decade >= rough)
            numbers = range(math.ceil(self.low / step), math.floor(self.high / step) + 1)
            return [(number * step, f"{number * step:.6g}".replace("-", "−")) for number in numbers]
        low, high = math.ceil(self.low), math.floor(self.high)
        return [(10.0**decade, _power(decade)) for decade in range(low, high + 1, max(1, -(-(high - low) // 8)))]

    def _of(self, value: float) -> float:
        return value if self.linear else math.log10(value)


class _Frame:
    """Maps values to pixels; `shown` is False where there is nothing to draw."""

    def __init__(self, plot: Plot) -> None:
        self.plot = plot
        marks = [mark for series in plot.series for mark in series.points if self.shows(mark)]
        self.shown = bool(marks)
        self.x_axis = _LogScale([mark.x for mark in marks] or [1.0], linear=plot.linear_x)
        self.y_axis = _LogScale([mark.y for mark in marks] or [1.0], linear=plot.linear_y)

    def shows(self, mark: PlotMark) -> bool:
        """Whether a point has a place on both axes."""
        given = ((mark.x, self.plot.linear_x), (mark.y, self.plot.linear_y))
        return all(math.isfinite(value) and (linear or value > 0.0) for value, linear in given)

    def x(self, value: float) -> float:
        return LEFT + self.x_axis.share(value) * (WIDTH - LEFT - RIGHT)

    def y(self, value: float) -> float:
        return HEIGHT - BOTTOM - self.y_axis.share(value) * (HEIGHT - TOP - BOTTOM)


def _axes(frame: _Frame, plot: Plot) -> list[str]:
    bottom, right = HEIGHT - BOTTOM, WIDTH - RIGHT
    parts = [f'<rect class="field" x="{LEFT}" y="{TOP}" width="{right - LEFT}" height="{bottom - TOP}"/>']
    for value, label in frame.x_axis.ticks():
        x = frame.x(value)
        parts.append(f'<line class="grid" x1="{x:.1f}" y1="{TOP}" x2="{x:.1f}" y2="{bottom}"/>')
        parts.append(f'<text class="tick" x="{x:.1f}" y="{bottom + 17}" text-anchor="middle">{label}</text>')
    for value, label in frame.y_axis.ticks():
        y = frame.y(value)
        parts.append(f'<line class="grid" x1="{LEFT}" y1="{y:.1f}" x2="{right}" y2="{y:.1f}"/>')
        parts.append(f'<text class="tick" x="{LEFT - 6}" y="{y + 4:.1f}" text-anchor="end">{label}</text>')
    middle_x, middle_y = (LEFT + right) / 2, (TOP + bottom) / 2
    parts.append(f'<text class="label" x="{middle_x:.0f}" y="{HEIGHT - 10}" text-anchor="middle">{escape(plot.x_label)}</text>')
    turned = f'transform="rotate(-90 16 {middle_y:.0f})"'
    title = f'<text class="label" x="16" y="{middle_y:.0f}" {turned} text-anchor="middle">{escape(plot.y_label)}</text>'
    return [*parts, title]


def _power(decade: int) -> str:
    sign = "−" if decade < 0 else ""
    return f'10<tspan dy="-5" font-size="9">{sign}{abs(decade)}</tspan>'


def _labels(frame: _Frame, series: Sequence[Series]) -> list[str]:
    """Names at the ends of lines, each moved up or down until it is clear of the others; none where there is no room."""
    parts: list[str] = []
    taken: list[tuple[float, float, float]] = []  # left, right and base line of each name
    for each in series:
        points = [mark for mark in each.points if frame.shows(mark)]
        if not (each.labelled and points):
            continue
        x, y, wide = frame.x(points[-1].x), frame.y(points[-1].y), LETTER * len(each.name)
        is_right = x + 7.0 + wide <= WIDTH - RIGHT
        left = x + 7.0 if is_right else x - 7.0 - wide
        for line in (y + shift * LINE_HEIGHT for shift in (RIGHT_OF_END if is_right else ABOVE_END)):
            inside = TOP + LINE_HEIGHT <= line <= HEIGHT - BOTTOM - 3.0 and left >= LEFT
            if inside and not any(
                left < end and begin < left + wide and abs(line - other) < LINE_HEIGHT for begin, end, other in taken
            ):
                taken.append((left, left + wide, line))
                style = f"n{each.number % 8}" if each.number >= 0 else "tick"
                parts.append(f'<text class="{style}" x="{left:.1f}" y="{line:.1f}">{escape(each.name)}</text>')
                break
    return parts


def _quiet(frame: _Frame, series: Series) -> list[str]:
    """A series in grey, as a group that says its name under the pointer."""
    if series.marked:
        return [f'<g class="rest"><title>{escape(series.name)}</title>', *_series(frame, series), "</g>"]
    return _series(frame, series)


def _series(frame: _Frame, series: Series) -> list[str]:
    points = [mark for mark in series.points if frame.shows(mark)]
    style = f"l{series.number % 8}" if series.number >= 0 else "l-front"
    places = [(frame.x(mark.x), frame.y(mark.y)) for mark in points]
    parts = []
    if series.joined and len(points) > 1:
        path = " ".join(f"{x:.1f},{y:.1f}" for x, y in places)
        dashes = ' stroke-dasharray="5 4"' if series.dashed else ""
        parts.append(f'<polyline class="{style}"{dashes} points="{path}"><title>{escape(series.name)}</title></polyline>')
    if series.marked:
        for mark, (x, y) in zip(points, places):
            radius = (RADIUS if series.number >= 0 else SMALL) + (1.5 if mark.strong else 0.0)
            parts.append(marker(series.number, x, y, hollow=mark.bound, radius=radius, said=mark.said))
            if mark.strong:
                parts.append(f'<circle class="ring" cx="{x:.1f}" cy="{y:.1f}" r="{RADIUS + 4.5:.1f}"/>')
    return parts
