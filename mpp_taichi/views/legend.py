"""The legend of a picture and the letters in it, drawn on the host: colour bars with numbers, names of groups, lengths."""

import math

import numpy as np
from PIL import Image, ImageDraw

from mpp_taichi.views.appearance import Legend
from mpp_taichi.views.camera import Camera
from mpp_taichi.views.caption import SHADOW_COLOR, TEXT_COLOR, font_of, text_height
from mpp_taichi.views.color_maps import colors_of
from mpp_taichi.views.coloring import ColorBar, GroupKey

BAR_WIDTH = 13.0  # of a colour bar, in heights of a line
TICKS = 3
MOST_NAMES = 16  # of groups, before the rest is counted
BACKING = 0.4  # what is left of the picture behind the legend


def legend_lines(legend: Legend) -> list[str]:
    """The legend in words, where there is nothing but text."""
    lines = []
    for entry in legend.entries:
        if isinstance(entry, ColorBar):
            lines.append(f"{entry.label}: {entry.low:.3g} ... {entry.high:.3g} ({entry.map})")
        else:
            lines.append("groups: " + ", ".join(entry.names[:MOST_NAMES]))
    return [*lines, *legend.lines]


def draw_legend(picture: np.ndarray, legend: Legend) -> None:
    """Draw a legend into the lower left corner of a picture (height, width, 3), in place; what does not fit is cut off."""
    if not legend.entries and not legend.lines:
        return
    size = text_height(picture)
    margin, step = size // 2 + 1, size + size // 3
    deep = margin + step * sum(_line_count(entry) for entry in legend.entries) + step * len(legend.lines)
    font = font_of(size)
    words = [*legend.lines, *(word for entry in legend.entries if isinstance(entry, GroupKey) for word in entry.names)]
    wide = 3 * margin + max([int(BAR_WIDTH * size), *(int(font.getlength(word)) + 2 * size for word in words)])
    corner = picture[max(picture.shape[0] - deep - margin, 0) :, :wide]
    corner[:] = np.rint(BACKING * corner)
    image = Image.fromarray(corner)
    pen = ImageDraw.Draw(image)
    bottom = corner.shape[0] - margin
    for line in reversed(legend.lines):
        bottom -= step
        _write(pen, (margin, bottom), line, size)
    for entry in reversed(legend.entries):
        if isinstance(entry, ColorBar):
            bottom -= step * _line_count(entry)
            _draw_bar(image, pen, entry, (margin, bottom), size, step)
        else:
            bottom = _draw_groups(pen, entry, (margin, bottom), size, step)
    corner[:] = np.asarray(image)


def _line_count(entry: ColorBar | GroupKey) -> int:
    if isinstance(entry, ColorBar):
        return 3
    return min(len(entry.names), MOST_NAMES) + (len(entry.names) > MOST_NAMES)


def draw_labels(picture: np.ndarray, labels: list[tuple[str, np.ndarray, np.ndarray]], camera: Camera) -> None:
    """Write texts at places of the scene, in place; what is behind the camera is left out."""
    if not labels:
        return
    height, width = picture.shape[:2]
    size = text_height(picture)
    image = Image.fromarray(picture)
    pen = ImageDraw.Draw(image)
    for text, place, color in labels:
        right, up, depth = camera.view(place)
        per_pixel = float(camera.length_per_pixel(np.array(depth), height))
        if not (depth > 0.0 and per_pixel > 0.0):
            continue
        column, row = width / 2.0 + right / per_pixel, height / 2.0 - up / per_pixel
        if abs(column) < 4.0 * width and abs(row) < 4.0 * height:
            _write(pen, (column, row), text, size, tuple(np.rint(255.0 * color).astype(int)), anchor="mm")
    picture[:] = np.asarray(image)


def _write(
    pen: ImageDraw.ImageDraw,
    place: tuple[float, float],
    text: str,
    size: int,
    color: tuple[int, ...] = TEXT_COLOR,
    anchor: str = "la",
) -> None:
    font = font_of(size)
    pen.text((place[0] + 1, place[1] + 1), text, font=font, fill=SHADOW_COLOR, anchor=anchor)
    pen.text(place, text, font=font, fill=color, anchor=anchor)


def _draw_bar(
    image: Image.Image, pen: ImageDraw.ImageDraw, bar: ColorBar, place: tuple[int, int], size: int, step: int
) -> None:
    left, top = place
    width, thick = int(BAR_WIDTH * size), max(3 * size // 4, 4)
    _write(pen, (left, top), bar.label, size)
    ramp = np.rint(255.0 * colors_of(np.linspace(0.0, 1.0, width), bar.map)).astype(np.uint8)
    image.paste(Image.fromarray(np.tile(ramp, (thick, 1, 1))), (left, top + step))
    for number in range(TICKS):
        share = number / (TICKS - 1)
        value = bar.low + share * (bar.high - bar.low)
        if bar.logarithmic and bar.low > 0.0:
            value = bar.low * (bar.high / bar.low) ** share
        anchor = ("la", "ma", "ra")[number]
        _write(
            pen,
            (left + share * width, top + step + thick + size // 8),
            number_text(value, bar.high - bar.low),
            size,
            anchor=anchor,
        )


def number_text(value: float, span: float) -> str:
    """A number to three digits of the span it is a tick of."""
    if value == 0.0 or (span > 0.0 and abs(value) < 1e-9 * span):
        return "0"
    digits = 3 if span <= 0.0 else min(max(3, math.ceil(math.log10(abs(value) / span)) + 3), 12)
    return f"{value:.{digits}g}"


def _draw_groups(pen: ImageDraw.ImageDraw, key: GroupKey, place: tuple[int, int], size: int, step: int) -> int:
    left, bottom = place
    names = list(zip(key.names, key.colors, strict=True))[:MOST_NAMES]
    rest = len(key.names) - len(names)
    if rest:
        bottom -= step
        _write(pen, (left, bottom), f"and {rest} more", size)
    for name, color in reversed(names):
        bottom -= step
        box = [left, bottom + size // 6, left + size * 5 // 6, bottom + size]
        pen.ellipse(box, fill=tuple(np.rint(255.0 * color).astype(int)))
        _write(pen, (left + size * 5 // 4, bottom), name, size)
    return bottom
