"""Painters: lines, rectangles and text, into a picture or an SVG file. Coordinates are pixels from the upper left corner."""

from collections.abc import Iterator, Sequence
from functools import lru_cache
from itertools import groupby
from typing import Protocol
from xml.sax.saxutils import escape

import numpy as np
from PIL import Image, ImageDraw

from mpp_taichi.plots.lettering import lettering
from mpp_taichi.plots.theme import Rgb

RAISED = dict(zip("⁰¹²³⁴⁵⁶⁷⁸⁹⁻", "0123456789−"))
LOWERED = dict(zip("₀₁₂₃₄₅₆₇₈₉", "0123456789"))
SMALL = 0.72  # height of raised and lowered characters over the height of the others; the font has none of its own
RAISE, LOWER = -0.24, 0.18  # of the height
_PLACES = {"l": "start", "m": "middle", "r": "end"}


class Painter(Protocol):
    """Draws the parts of a panel. Anchors of text: `l`, `m` or `r`; y is the middle of the line."""

    def line(self, ends: Sequence[float], color: Rgb, width: float) -> None:
        """A straight line: x, y, x, y."""

    def rectangle(self, box: Sequence[float], color: Rgb) -> None:
        """A filled rectangle: left, top, right, bottom."""

    def text(self, x: float, y: float, text: str, color: Rgb, size: int, anchor: str = "l") -> None:
        """One line of text."""


class PicturePainter:
    """Draws into a picture of Pillow."""

    def __init__(self, picture: Image.Image) -> None:
        """Keep the pen."""
        self._picture, self._pen = picture, ImageDraw.Draw(picture)

    def line(self, ends: Sequence[float], color: Rgb, width: float) -> None:
        """Whole pixels: grids and axes are along rows and columns."""
        self._pen.line([round(each) for each in ends], fill=color, width=max(1, round(width)))

    def rectangle(self, box: Sequence[float], color: Rgb) -> None:
        """Up to, not including, the right column and the bottom row."""
        left, top, right, bottom = (round(each) for each in box)
        if right > left and bottom > top:
            self._pen.rectangle((left, top, right - 1, bottom - 1), fill=color)

    def text(self, x: float, y: float, text: str, color: Rgb, size: int, anchor: str = "l") -> None:
        """Draw the text piece by piece, since raised and lowered pieces are smaller."""
        x -= {"l": 0.0, "m": 0.5, "r": 1.0}[anchor] * text_width(text, size)
        for piece, height, shift in _pieces(text, size):
            lettering(height).write(self._picture, (x, y + shift), piece, color, anchor="lm")
            x += lettering(height).width(piece)


class SvgPainter:
    """Gathers elements of an SVG file; fonts are the reader's own, letters as wide as in a picture."""

    def __init__(self) -> None:
        """Nothing is drawn yet."""
        self.elements: list[str] = []

    def line(self, ends: Sequence[float], color: Rgb, width: float) -> None:
        """A <line>."""
        x0, y0, x1, y1 = ends
        place = f'x1="{x0:.1f}" y1="{y0:.1f}" x2="{x1:.1f}" y2="{y1:.1f}"'
        self.elements.append(f'<line {place} stroke="{_hex(color)}" stroke-width="{width:g}"/>')

    def rectangle(self, box: Sequence[float], color: Rgb) -> None:
        """A <rect>."""
        left, top, right, bottom = box
        place = f'x="{left:.2f}" y="{top:.2f}" width="{right - left:.2f}" height="{bottom - top:.2f}"'
        self.elements.append(f'<rect {place} fill="{_hex(color)}"/>')

    def text(self, x: float, y: float, text: str, color: Rgb, size: int, anchor: str = "l") -> None:
        """A <text>; its middle is a third of its height above the base line."""
        if not text:
            return
        place = f'x="{x:.1f}" y="{y + 0.35 * size:.1f}" font-size="{size}" text-anchor="{_PLACES[anchor]}"'
        place += f' textLength="{text_width(text, size):.1f}" lengthAdjust="spacingAndGlyphs"'
        self.elements.append(f'<text {place} fill="{_hex(color)}">{escape(text)}</text>')

    def polyline(self, points: np.ndarray, color: Rgb, width: float) -> None:
        """A <polyline> through (n, 2) points."""
        path = " ".join(f"{x:.2f},{y:.2f}" for x, y in points)
        style = f'fill="none" stroke="{_hex(color)}" stroke-width="{width:g}" stroke-linejoin="round"'
        self.elements.append(f'<polyline {style} points="{path}"/>')

    def disc(self, x: float, y: float, radius: float, color: Rgb) -> None:
        """A filled <circle>."""
        self.elements.append(f'<circle cx="{x:.2f}" cy="{y:.2f}" r="{radius:g}" fill="{_hex(color)}"/>')


def text_width(text: str, size: int) -> float:
    """The width of a line of text in pixels."""
    return sum(lettering(height).width(piece) for piece, height, _ in _pieces(text, size))


@lru_cache(maxsize=1024)
def _cached_pieces(text: str, size: int) -> tuple[tuple[str, int, float], ...]:
    small = max(8, round(SMALL * size))
    kinds = {"": (size, 0.0, {}), "up": (small, RAISE * size, RAISED), "down": (small, LOWER * size, LOWERED)}
    found = []
    for kind, group in groupby(text, lambda letter: "up" if letter in RAISED else "down" if letter in LOWERED else ""):
        height, shift, letters = kinds[kind]
        found.append(("".join(letters.get(letter, letter) for letter in group), height, shift))
    return tuple(found)


def _pieces(text: str, size: int) -> Iterator[tuple[str, int, float]]:
    """Runs of characters on one level, with their height and their distance below the line."""
    yield from _cached_pieces(text, size)


def _hex(color: Rgb) -> str:
    return "#{:02x}{:02x}{:02x}".format(*color)
