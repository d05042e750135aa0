"""The scale bar of a picture: a round length with its unit, at the depth of the camera's target."""

from collections.abc import Mapping
from dataclasses import dataclass

from PIL import Image, ImageDraw

from mpp_taichi.scene.human_units import length_unit
from mpp_taichi.views.camera import Camera
from mpp_taichi.views.caption import Color, write_outlined
from mpp_taichi.views.marks import round_number

SHARE = 0.18  # of the width of the picture, before the length is rounded
MARGIN = 0.9  # heights of a line, from the right and lower edge
TICK = 0.3  # heights of a line, the ends of the bar


@dataclass(frozen=True)
class ScaleBar:
    """A length as a text, and its pixels in the picture."""

    text: str
    pixels: float

    @staticmethod
    def of(camera: Camera, size: tuple[int, int], units: Mapping[str, str] | None) -> "ScaleBar":
        """The bar for a picture of (width, height) pixels: a length of 1, 2 or 5 times a power of ten of a unit."""
        per_pixel = camera.visible_height / size[1]
        wanted = SHARE * size[0] * per_pixel
        unit, unit_size = length_unit(units, wanted)
        number = round_number(wanted / unit_size)
        text = f"{number:,.0f}" if 1.0 <= number < 1e7 else f"{number:g}"
        return ScaleBar(f"{text} {unit}" if unit else text, number * unit_size / per_pixel)


def draw_scale_bar(picture: Image.Image, bar: ScaleBar, line: int, ink: tuple[Color, Color], right: int, bottom: int) -> None:
    """Draw the bar with its text above; its right end is at the lower right corner (`right`, `bottom`) less a margin."""
    pen = ImageDraw.Draw(picture)
    thick, tick = max(1, line // 9), TICK * line
    end, level = right - round(MARGIN * line), bottom - round(MARGIN * line)
    begin = round(end - bar.pixels)
    strokes = [(begin, level, end, level), *((x, level - tick, x, level + tick) for x in (begin, end))]
    for color, wider in ((ink[1], 2), (ink[0], 0)):
        for left, top, far, low in strokes:
            half = (thick + wider) / 2.0
            pen.rectangle([left - half, top - half, far + half, low + half], fill=color)
    place = (begin + end) / 2.0, level - tick - thick
    write_outlined(picture, place, bar.text, line, ink, anchor="mb", outline=thick)
