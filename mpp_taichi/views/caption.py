"""Text in pictures: title, time and one more line, drawn on the host."""

import numpy as np
from PIL import Image

from mpp_taichi.plots.lettering import lettering
from mpp_taichi.views._base import Frame

Color = tuple[int, int, int]
Background = tuple[float, float, float]
LIGHT_INK, DARK_INK = ((235, 235, 240), (0, 0, 0)), ((25, 25, 30), (255, 255, 255))  # text and its shadow
LIGHT_BACKGROUND = 0.5  # mean of its red, green and blue
DARK: Background = (0.0, 0.0, 0.0)
LINES_PER_PICTURE = 36  # the height of one line is this share of the picture, 20 pixels at 720


def text_height(rows: int) -> int:
    """Height of a line of text in a picture of so many rows [pixels]."""
    return max(rows // LINES_PER_PICTURE, 9)


def is_light(background: Background) -> bool:
    """Whether a background wants dark text."""
    return sum(background) / 3.0 > LIGHT_BACKGROUND


def ink(background: Background) -> tuple[Color, Color]:
    """Colours of text and of its shadow before a background."""
    return DARK_INK if is_light(background) else LIGHT_INK


def write_outlined(
    picture: Image.Image,
    place: tuple[float, float],
    text: str,
    size: int,
    colors: tuple[Color, Color],
    *,
    anchor: str,
    outline: int,
) -> None:
    """Write a line with an outline of so many pixels, which keeps it readable before any colour; `anchor` is as Pillow's."""
    lettering(size).write(picture, place, text, colors[0], anchor=anchor, outline=(outline, colors[1]))


def caption_lines(frame: Frame) -> list[str]:
    """The lines of a frame's caption, from the top."""
    return [line for line in (frame.title, f"t = {frame.clock or format(frame.time, '.4g')}", frame.extra) if line]


def draw_caption(picture: np.ndarray, frame: Frame, background: Background = DARK) -> None:
    """Write the caption into the upper left corner of a picture (height, width, 3), in place."""
    draw_text(picture, "\n".join(caption_lines(frame)), background)


def draw_text(picture: np.ndarray, text: str, background: Background = DARK) -> None:
    """Write lines of text into the upper left corner of a picture, in place; text that does not fit is cut off."""
    height, width = picture.shape[:2]
    size = text_height(height)
    margin = size // 2
    lines, letters = text.split("\n"), lettering(size)
    right, bottom = letters.reach(lines, spacing=size // 3)
    box = min(right + 2 * margin, width), min(bottom + 2 * margin, height)
    corner = Image.fromarray(picture[: box[1], : box[0]])
    color, shadow = ink(background)
    letters.write_lines(corner, (margin, margin), lines, color, spacing=size // 3, shadow=shadow)
    picture[: box[1], : box[0]] = np.asarray(corner)
