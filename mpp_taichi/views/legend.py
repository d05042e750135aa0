"""The legend of a picture and the letters in it, drawn on the host: colour bars with numbers, names of groups, lengths."""

import math

import numpy as np
from PIL import Image, ImageDraw

from mpp_taichi.plots.lettering import lettering
from mpp_taichi.views.appearance import Legend
from mpp_taichi.views.camera import Camera
from mpp_taichi.views.caption import DARK, LINES_PER_PICTURE, Background, Color, ink, is_light, text_height
from mpp_taichi.views.color_maps import colors_of
from mpp_taichi.views.coloring import ColorBar, GroupKey
from mpp_taichi.views.marks import Label

BAR_WIDTH = 13  # of a colour bar, in heights of a line
TICKS = (("la", 0.0), ("ma", 0.5), ("ra", 1.0))  # how its numbers are set, and where
MOST_NAMES = 16  # of groups; further groups are only counted
BACKING = 0.4  # share of the picture's light that remains behind the legend


def legend_lines(legend: Legend) -> list[str]:
    """The legend in words, for output that has text only."""
    lines = []
    for entry in legend.entries:
        if isinstance(entry, ColorBar):
            lines.append(f"{entry.label}: {entry.low:.3g} ... {entry.high:.3g} ({entry.map})")
        else:
            lines.append(f"{entry.label}: " + ", ".join(entry.names[:MOST_NAMES]))
    return [*lines, *legend.lines]


def draw_legend(picture: np.ndarray, legend: Legend, background: Background = DARK) -> None:
    """Draw a legend into the lower left corner of a picture (height, width, 3), in place; parts outside are cut off."""
    if not legend.entries and not legend.lines:
        return
    size = line_height(picture.shape[1::-1])
    margin, step = size // 2 + 1, size + size // 3
    rows = len(legend.lines) + sum(3 if isinstance(entry, ColorBar) else len(_names(entry)) for entry in legend.entries)
    words = [*legend.lines, *(word for entry in legend.entries if isinstance(entry, GroupKey) for word, _ in _names(entry))]
    widths = [int(lettering(size).width(word)) + 2 * size for word in words]
    wide = 3 * margin + max([*widths, *(BAR_WIDTH * size for entry in legend.entries if isinstance(entry, ColorBar))])
    corner = picture[max(picture.shape[0] - rows * step - 2 * margin, 0) :, :wide]
    corner[:] = np.rint(BACKING * corner + (255.0 * (1.0 - BACKING) if is_light(background) else 0.0))
    pen = _Pen(corner, size, ink(background))
    top = corner.shape[0] - margin - rows * step
    for entry in legend.entries:
        if isinstance(entry, ColorBar):
            pen.bar(entry, margin, top, step)
            top += 3 * step
        else:
            for word, color in _names(entry):
                pen.dot(margin, top, color)
                pen.write((margin + size * 5 // 4, top), word)
                top += step
    for number, line in enumerate(legend.lines):
        pen.write((margin, top + number * step), line)
    corner[:] = np.asarray(pen.image)


def draw_labels(picture: np.ndarray, labels: list[Label], camera: Camera, background: Background = DARK) -> None:
    """Write texts at places of the scene, in place; texts behind the camera are left out."""
    if not labels:
        return
    height, width = picture.shape[:2]
    pen = _Pen(picture, line_height(picture.shape[1::-1]), ink(background))
    for text, place, color in labels:
        right, up, depth = camera.view(place)
        per_pixel = float(camera.length_per_pixel(np.array(depth), height))
        if not (depth > 0.0 and per_pixel > 0.0):
            continue
        column, row = width / 2.0 + right / per_pixel, height / 2.0 - up / per_pixel
        if abs(column) < 4.0 * width and abs(row) < 4.0 * height:
            pen.write((column, row), text, "mm", _bytes(color))
    picture[:] = np.asarray(pen.image)


def number_text(value: float, span: float) -> str:
    """A number to three digits of the span it is a tick of."""
    if value == 0.0 or (span > 0.0 and abs(value) < 1e-9 * span):
        return "0"
    digits = 3 if span <= 0.0 else min(max(3, math.ceil(math.log10(abs(value) / span)) + 3), 12)
    return f"{value:.{digits}g}"


def line_height(size: tuple[int, int]) -> int:
    """Height of a line, as in a caption; in a wide strip above panels, as in the caption of the whole picture."""
    width, height = size
    least = text_height(height)
    return min(max(least, width * 9 // 16 // LINES_PER_PICTURE), max(height // 12, least))


def _names(key: GroupKey) -> list[tuple[str, Color | None]]:
    """The lines of a key: names with their colours, and the number of names left out."""
    lines: list[tuple[str, Color | None]] = [(name, _bytes(color)) for name, color in zip(key.names, key.colors, strict=True)]
    if len(lines) <= MOST_NAMES:
        return lines
    return [*lines[: MOST_NAMES - 1], (f"and {len(lines) - MOST_NAMES + 1} more", None)]


def _bytes(color: np.ndarray) -> Color:
    red, green, blue = (int(value) for value in np.rint(255.0 * color))
    return red, green, blue


class _Pen:
    """Draws text of one size on a copy of a picture, `image`."""

    def __init__(self, picture: np.ndarray, size: int, colors: tuple[Color, Color]) -> None:
        self.image = Image.fromarray(picture)
        self.size, self.colors = size, colors
        self._draw, self._letters = ImageDraw.Draw(self.image), lettering(size)

    def write(self, place: tuple[float, float], text: str, anchor: str = "la", color: Color | None = None) -> None:
        self._letters.write(self.image, place, text, color or self.colors[0], anchor=anchor, shadow=self.colors[1])

    def dot(self, left: int, top: int, color: Color | None) -> None:
        if color is not None:
            self._draw.ellipse([left, top + self.size // 6, left + self.size * 5 // 6, top + self.size], fill=color)

    def bar(self, bar: ColorBar, left: int, top: int, step: int) -> None:
        wide, thick = BAR_WIDTH * self.size, max(3 * self.size // 4, 4)
        self.write((left, top), bar.label)
        ramp = np.rint(255.0 * colors_of(np.linspace(0.0, 1.0, wide), bar.map)).astype(np.uint8)
        self.image.paste(Image.fromarray(np.tile(ramp, (thick, 1, 1))), (left, top + step))
        for anchor, share in TICKS:
            value = bar.low + share * (bar.high - bar.low)
            if bar.logarithmic and bar.low > 0.0:
                value = bar.low * (bar.high / bar.low) ** share
            place = left + share * wide, top + step + thick + self.size // 8
            self.write(place, number_text(value, bar.high - bar.low), anchor)
