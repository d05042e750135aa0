"""Boxes with text, buttons and sliders in a window, drawn by the program's own font: GGUI's panels know Latin letters only."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from PIL import Image, ImageDraw

from mpp_taichi.plots.lettering import lettering

LETTERS = 13  # pixels
LINE, ROW = 17, 23  # height of a line of text, and of a button or a slider
RIM = 8
GROUND, FIELD, HOVER, GRAB = (26, 27, 36), (40, 52, 78), (58, 82, 126), (61, 133, 224)
INK, FAINT = (235, 235, 240), (160, 162, 175)
GRIP = 12  # width of the grip of a slider
Place = tuple[float, float]
Box = tuple[float, float, float, float]
Color = tuple[int, int, int]


@dataclass(frozen=True)
class Mouse:
    """Where the mouse is in a box [pixels from its upper left corner]; whether the left button went down now, and is held."""

    place: Place = (-1.0, -1.0)
    down: bool = False
    held: bool = False

    def at(self, left: float, top: float, right: float, bottom: float) -> bool:
        """Whether the mouse is in a rectangle."""
        return left <= self.place[0] < right and top <= self.place[1] < bottom


@dataclass(frozen=True)
class _Mark:
    """A thing that is drawn: its rectangle with the colour, and a text."""

    box: Box
    color: Color | None
    text: str = ""
    ink: Color = INK
    anchor: str = "lm"


class Paper:
    """One box. Each frame begins with `begin`; then text, buttons and sliders follow one another from the top."""

    def __init__(self) -> None:
        """Nothing is drawn yet."""
        self._marks: list[_Mark] = []
        self._drawn: tuple[tuple[_Mark, ...], tuple[int, int]] | None = None
        self._picture: np.ndarray = np.zeros((1, 1, 3), np.uint8)
        self._active = ""  # the slider that the mouse holds
        self.begin((1, 1), Mouse())

    def begin(self, size: tuple[int, int], mouse: Mouse, top: int = RIM) -> None:
        """Begin a frame: a box of (width, height) pixels, whose first line is `top` pixels below its upper rim."""
        self._size, self._mouse, self._left, self._top = size, mouse, RIM, top
        self._marks = []
        if not mouse.held:
            self._active = ""

    def begin_text(self, left: int, top: int) -> None:
        """Write the next lines from this place on."""
        self._left, self._top = RIM + left, top

    def space(self, pixels: int) -> None:
        """Leave room."""
        self._top += pixels

    def text(self, text: str, *, faint: bool = False) -> None:
        """Write a line."""
        self.row((text,), (0,), faint=faint)

    def row(self, texts: Sequence[str], columns: Sequence[int], *, faint: bool = False) -> None:
        """Write texts at columns of one line [pixels]."""
        bottom = self._top + LINE
        for text, column in zip(texts, columns, strict=True):
            box = self._left + column, self._top, self._size[0] - RIM, bottom
            self._marks.append(_Mark(box, None, text, FAINT if faint else INK))
        self._top = bottom

    def button(self, text: str) -> bool:
        """Draw a button over the whole width, and return whether it is pressed now."""
        box = RIM, self._top, self._size[0] - RIM, self._top + ROW - 3
        self._top += ROW
        return self.button_at(box, text)

    def button_at(self, box: Box, text: str, *, middle: bool = False) -> bool:
        """Draw a button with its left, top, right and bottom side, and return whether it is pressed now."""
        over = self._mouse.at(*box)
        self._marks.append(_Mark(box, HOVER if over else FIELD, text, anchor="mm" if middle else "lm"))
        return over and self._mouse.down

    def slider_float(self, text: str, old_value: float, minimum: float, maximum: float) -> float:
        """Draw a slider with its text, and return its place; what follows ### in the text is its name, and is not drawn."""
        label, _, name = text.partition("###")
        left, top, right, bottom = RIM, self._top, self._size[0] - RIM, self._top + ROW - 4
        self._top += ROW
        if self._mouse.down and self._mouse.at(left, top, right, bottom):
            self._active = name
        way, value = max(right - left - GRIP, 1), old_value
        if self._active == name and maximum > minimum:
            share = min(max((self._mouse.place[0] - left - GRIP / 2) / way, 0.0), 1.0)
            value = minimum + share * (maximum - minimum)
        share = (value - minimum) / (maximum - minimum) if maximum > minimum else 0.0
        grip = left + min(max(share, 0.0), 1.0) * way
        self._marks.append(_Mark((left, top, right, bottom), FIELD))
        self._marks.append(_Mark((grip, top + 2, grip + GRIP, bottom - 2), GRAB))
        self._marks.append(_Mark((left, top, right, bottom), None, label, anchor="mm"))
        return value

    @property
    def bottom(self) -> int:
        """Where the next line would begin [pixels]."""
        return self._top

    def picture(self) -> np.ndarray:
        """The box as it is now, (height, width, 3); drawn only where it has changed."""
        key = tuple(self._marks), self._size
        if key != self._drawn:
            self._drawn, self._picture = key, self._draw()
        return self._picture

    def grounds(self) -> list[tuple[Box, Color]]:
        """Rectangles below the letters, the lowest first, with their colours."""
        found: list[tuple[Box, Color]] = [((0, 0, *self._size), GROUND)]
        for mark in self._marks:
            if mark.color is not None:
                left, top, right, bottom = (round(side) for side in mark.box)
                found.append(((left, top, right, bottom), mark.color))
        return found

    def _draw(self) -> np.ndarray:
        image = Image.new("RGB", self._size, GROUND)
        pen, letters = ImageDraw.Draw(image), lettering(LETTERS)
        for mark in self._marks:
            left, top, right, bottom = mark.box
            if mark.color is not None and right - left >= 1 and bottom - top >= 1:
                pen.rounded_rectangle([left, top, right - 1, bottom - 1], 3, fill=mark.color)
            if mark.text:
                inset = 6 if mark.color is not None else 0
                text = _fitting(mark.text, right - left - inset)
                x = (left + right) / 2.0 if mark.anchor == "mm" else left + inset
                letters.write(image, (x, (top + bottom) / 2.0), text, mark.ink, anchor=mark.anchor)
        return np.asarray(image)


def _fitting(text: str, width: float) -> str:
    """A text that is cut off where it is wider than the room for it."""
    letters = lettering(LETTERS)
    if letters.width(text) <= width:
        return text
    kept = len(text)
    while kept > 1 and letters.width(text[:kept] + "…") > width:
        kept -= 1
    return text[:kept] + "…"
