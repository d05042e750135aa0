"""The frame of a panel: the place of its field, and the axes, title and legend around the curves."""

from dataclasses import dataclass

import numpy as np

from mpp_taichi.plots.axis import Axis
from mpp_taichi.plots.content import Curves, Histogram, Plot
from mpp_taichi.plots.painters import Painter, text_width
from mpp_taichi.plots.theme import Rgb, Theme

LEAST_FIELD = 24  # pixels
LONGEST_LABEL = 0.35  # of the field's width, for a label in the same row as the numbers of the axis


@dataclass(frozen=True)
class Entry:
    """One entry of a legend."""

    name: str
    color: Rgb


@dataclass(frozen=True)
class PanelFrame:
    """Places in a panel of `width` × `height` pixels whose letters are `size` high; field: left, top, right, bottom."""

    width: int
    height: int
    size: int
    field: tuple[int, int, int, int]
    legend: tuple[tuple[float, float, Entry], ...]  # x, y, entry
    label_below: bool  # whether the label of x has a row of its own, as it is too long for the row of the numbers

    @staticmethod
    def of(plot: Plot, width: int, height: int, size: int, theme: Theme) -> "PanelFrame":
        """Lay out a panel."""
        left, right = round(4.3 * size), width - round(1.2 * size)
        top = round((1.9 if plot.title else 0.5) * size)
        places, x, y = [], float(left), top + 0.75 * size
        for entry in entries_of(plot, theme):
            wide = text_width(entry.name, size) + 2.0 * size
            if x > left and x + wide > right + size:
                x, y = float(left), y + 1.35 * size
            places.append((x, y, entry))
            x += wide + 0.8 * size
        top = round(y + 1.15 * size)
        below = text_width(plot.x_label + plot.x_unit, size) > LONGEST_LABEL * (right - left)
        bottom = max(height - round((3.2 if below else 1.9) * size), top + LEAST_FIELD)
        return PanelFrame(width, height, size, (left, top, max(right, left + LEAST_FIELD), bottom), tuple(places), below)

    def points(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """Shares of both axes as pixels, (n, 2)."""
        left, top, right, bottom = self.field
        return np.stack([left + x * (right - left), bottom - y * (bottom - top)], axis=1)

    def draw(self, painter: Painter, plot: Plot, x_axis: Axis, y_axis: Axis, theme: Theme) -> None:
        """Draw everything but the curves."""
        left, top, right, bottom = self.field
        size = self.size
        painter.rectangle((0, 0, self.width, self.height), theme.background)
        painter.rectangle(self.field, theme.field)
        x_ticks, x_power = x_axis.ticks(max(2, (right - left) // (5 * size)))
        y_ticks, y_power = y_axis.ticks(max(2, (bottom - top) // round(2.0 * size)))
        width = size / 15.0
        unit = " ".join(filter(None, (x_power, plot.x_unit)))
        x_label = f"{plot.x_label} [{unit}]" if unit else plot.x_label
        free = self.width if self.label_below else right - text_width(x_label, size) - size
        for tick in x_ticks:
            x = left + tick.share * (right - left)
            painter.line((x, top, x, bottom), theme.grid, width)
            if x + 0.5 * text_width(tick.label, size) < free:
                painter.text(x, bottom + 0.95 * size, tick.label, theme.faint, size, "m")
        for tick in y_ticks:
            y = bottom - tick.share * (bottom - top)
            painter.line((left, y, right, y), theme.grid, width)
            painter.text(left - 0.45 * size, y, tick.label, theme.faint, size, "r")
        painter.line((left, bottom, right, bottom), theme.faint, width)
        painter.line((left, top, left, bottom), theme.faint, width)
        if plot.title:
            painter.text(0.6 * size, 1.1 * size, plot.title, theme.text, round(1.1 * size))
        y_unit = plot.y_unit if isinstance(plot, Curves) else ""
        painter.text(left - 0.5 * size, top - 0.9 * size, " ".join(filter(None, (y_power, y_unit))), theme.faint, size, "r")
        painter.text(right, bottom + (2.2 if self.label_below else 0.95) * size, x_label, theme.text, size, "r")
        for x, y, entry in self.legend:
            painter.rectangle((x, y - 0.1 * size, x + 1.2 * size, y + 0.1 * size), entry.color)
            painter.text(x + 1.6 * size, y, entry.name, theme.text, size)


def entries_of(plot: Plot, theme: Theme) -> list[Entry]:
    """The entries of the legend."""
    if isinstance(plot, Histogram):
        law = [Entry("theory", theme.theory)] if plot.has_theory else []
        return [Entry("probability density", theme.curve(0)), *law]
    entries = [Entry(name, color_of(plot, number, theme)) for number, name in enumerate(plot.names)]
    return entries + ([Entry("theory", theme.band)] if plot.theories else [])


def color_of(plot: Curves, number: int, theme: Theme) -> Rgb:
    """The colour of a curve."""
    return theme.curve(number) if number < len(plot.names) else theme.band


def fitting_axes(plot: Plot) -> tuple[Axis, Axis]:
    """Axes that fit all samples so far."""
    if isinstance(plot, Histogram):
        ends = plot.edges if len(plot.edges) else np.array([0.0, 1.0])
        return Axis(float(ends[0]), float(ends[-1])), Axis.above_zero(np.concatenate([plot.density, plot.theory]))
    x = Axis(*plot.span) if plot.span is not None else Axis.of(plot.x)
    values = np.concatenate([plot.y(number) for number in range(plot.count)])
    return x, Axis.of(values, logarithmic=plot.logarithmic)


def equalised(x: Axis, y: Axis, frame: PanelFrame) -> tuple[Axis, Axis]:
    """The axes, widened so that both have the same scale."""
    left, top, right, bottom = frame.field
    per_x, per_y = (x.high - x.low) / (right - left), (y.high - y.low) / (bottom - top)
    scale = max(per_x, per_y)
    return _widened(x, scale * (right - left)), _widened(y, scale * (bottom - top))


def _widened(axis: Axis, span: float) -> Axis:
    middle = 0.5 * (axis.low + axis.high)
    return Axis(middle - 0.5 * span, middle + 0.5 * span)
