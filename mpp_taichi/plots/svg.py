"""Plots as an SVG file: every panel with all of its points, sharp at any size."""

from collections.abc import Sequence

import numpy as np

from mpp_taichi.plots.content import Curves, Histogram, Plot
from mpp_taichi.plots.frame import PanelFrame, color_of, equalised, fitting_axes
from mpp_taichi.plots.painters import SvgPainter
from mpp_taichi.plots.panel import BAND_WIDTH, BAR, CURVE_WIDTH, DISC, bars, blended
from mpp_taichi.plots.theme import LIGHT, Theme

FONTS = "Go, 'Source Sans 3', 'Helvetica Neue', Arial, sans-serif"


def draw_svg(plots: Sequence[Plot], size: tuple[int, int], letters: int, theme: Theme = LIGHT) -> str:
    """All plots, one below the other, each `size` (width, height) large."""
    width, height = size
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {height * len(plots)}" '
        f'width="{width}" height="{height * len(plots)}" font-family="{FONTS}">'
    ]
    for number, plot in enumerate(plots):
        painter = SvgPainter()
        _draw(painter, plot, PanelFrame.of(plot, width, height, letters, theme), theme)
        parts += [f'<g transform="translate(0 {number * height})">', *painter.elements, "</g>"]
    return "\n".join([*parts, "</svg>\n"])


def _draw(painter: SvgPainter, plot: Plot, frame: PanelFrame, theme: Theme) -> None:
    axes = fitting_axes(plot)
    if isinstance(plot, Curves) and plot.equal:
        axes = equalised(*axes, frame)
    frame.draw(painter, plot, *axes, theme)
    scale = frame.size / 15.0
    if isinstance(plot, Histogram):
        for box in bars(plot, frame, axes):
            painter.rectangle(box, blended(theme.curve(0), theme.field, BAR))
        if len(plot.theory):
            points = frame.points(axes[0].share(plot.curve), axes[1].share(plot.theory))
            painter.polyline(points, theme.theory, CURVE_WIDTH * scale)
        return
    x = axes[0].share(plot.x)
    for number in reversed(range(plot.count)):  # theory first
        theory = number >= len(plot.names)
        points = frame.points(x, axes[1].share(plot.y(number)))
        finite = np.isfinite(points).all(axis=1)
        color = color_of(plot, number, theme)
        for run in np.split(np.arange(len(points)), np.flatnonzero(np.diff(finite.astype(int))) + 1):
            if len(run) > 1 and finite[run[0]]:
                painter.polyline(points[run], color, (BAND_WIDTH if theory else CURVE_WIDTH) * scale)
        if len(points) and finite[-1] and not theory:
            painter.disc(float(points[-1, 0]), float(points[-1, 1]), DISC * scale, color)
