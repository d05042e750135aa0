"""Colours in a scene: three numbers, the name of a colour in CSS (`orange`), or its hexadecimal digits (`"#ffa500"`)."""

import re
from dataclasses import dataclass
from typing import Any

from mpp_taichi.scene.did_you_mean import nearest
from mpp_taichi.scene.faults import shown
from mpp_taichi.scene.fields import Context, Field, ListOf, Number, Wrong

HEXADECIMAL = re.compile(r"#([0-9a-fA-F]{3}|[0-9a-fA-F]{6})")


@dataclass(frozen=True)
class Color(Field):
    """Red, green and blue in 0…1 of the colour as a screen shows it (sRGB)."""

    item: Number = Number(minimum=0.0, maximum=1.0)

    def check(self, value: Any, context: Context) -> tuple[Any, ...]:
        """The three numbers."""
        if isinstance(value, str):
            return _of_text(value)
        if value is None:
            raise Wrong("must be a colour, not nothing; hexadecimal digits need quotes, as '#ffcc00'")
        return ListOf(self.item).check(value, context)

    def schema(self) -> dict[str, Any]:
        """An array of three numbers, or a text."""
        return {"anyOf": [ListOf(self.item).schema(), {"type": "string", "description": "a name such as orange, or '#ffa500'"}]}


def _of_text(text: str) -> tuple[float, float, float]:
    from PIL.ImageColor import colormap  # the names of CSS with their digits

    digits = colormap.get(text.strip().lower(), text)
    if not isinstance(digits, str):  # Pillow puts numbers in place of the digits of a name that was drawn with
        return digits[0] / 255, digits[1] / 255, digits[2] / 255
    found = HEXADECIMAL.fullmatch(digits)
    if found is None:
        near = nearest(text, colormap)
        told = f", did you mean {near!r}?" if near is not None else ";"
        raise Wrong(f"{shown(text)} is no colour{told} a colour is a name of CSS, '#rrggbb', or three numbers in 0…1")
    six = found[1] if len(found[1]) == 6 else "".join(2 * digit for digit in found[1])
    red, green, blue = (int(six[at : at + 2], 16) / 255 for at in (0, 2, 4))
    return red, green, blue
