"""Lines of text in pictures: measured and drawn here alone, each character in a font that has it.

Characters that the program's own font lacks come from fonts of the machine, so a line consists of runs: pieces of text in one
font, drawn one after the other on one base line. A character that no font has is drawn as a box, and told of.
"""

import logging
from collections.abc import Sequence
from functools import lru_cache
from itertools import groupby
from typing import NamedTuple

from PIL import Image, ImageDraw, ImageFont

from mpp_taichi.plots.characters import clusters, needed, package_with, script_of, shown, written_from_the_right
from mpp_taichi.plots.font_files import PROBE_HEIGHT, FontFile, find, holds
from mpp_taichi.plots.fonts import font_of

logger = logging.getLogger(__name__)
Ink = tuple[int, ...]
MOST_TOLD = 8  # characters in a message

_told_scripts: set[str] = set()


class Run(NamedTuple):
    """A piece of a line in one font; None is the program's own font."""

    text: str
    file: FontFile | None


class Lettering:
    """Text whose letters have a height [pixels]."""

    def __init__(self, height: int) -> None:
        """Nothing is opened yet but the program's own font."""
        self.height = height
        self._own = font_of(height)

    def width(self, text: str) -> float:
        """The way from the beginning of a line to its end [pixels]."""
        return sum(self._font(file).getlength(piece) * self._scale(file) for piece, file in runs(text))

    def write(
        self,
        picture: Image.Image,
        place: tuple[float, float],
        text: str,
        ink: Ink,
        *,
        anchor: str = "la",
        shadow: Ink | None = None,
        outline: tuple[int, Ink] | None = None,
    ) -> None:
        """Write a line into a picture.

        `anchor` is as Pillow's: `l`, `m` or `r`, and `a`, `m` or `s` for the top, the middle or the base line. `shadow` is the
        colour of a copy one pixel to the right and below; `outline` is the width and the colour of a rim around the letters.
        """
        if shadow is not None:
            self._write(picture, (place[0] + 1, place[1] + 1), text, shadow, anchor, None, colored=False)
        self._write(picture, place, text, ink, anchor, outline, colored=True)

    def write_lines(
        self, picture: Image.Image, place: tuple[float, float], lines: Sequence[str], ink: Ink, *, spacing: int, shadow: Ink
    ) -> None:
        """Write lines below one another, with so many pixels between them; shadows of all lines lie below all letters."""
        for color, shift in ((shadow, 1), (ink, 0)):
            for number, line in enumerate(lines):
                there = place[0] + shift, place[1] + shift + number * self._step(spacing)
                self._write(picture, there, line, color, "la", None, colored=color is ink)

    def reach(self, lines: Sequence[str], *, spacing: int) -> tuple[int, int]:
        """How far lines with so many pixels between them reach to the right and below [pixels]."""
        right = bottom = 0.0
        for number, line in enumerate(lines):
            top = number * self._step(spacing)
            for piece, file, x, y in self._placed((0.0, top), line, "la"):
                box, scale = self._font(file).getbbox(piece, anchor="ls"), self._scale(file)
                right, bottom = max(right, x + box[2] * scale), max(bottom, y + box[3] * scale)
        return int(right), int(bottom)

    def _write(
        self,
        picture: Image.Image,
        place: tuple[float, float],
        text: str,
        ink: Ink,
        anchor: str,
        outline: tuple[int, Ink] | None,
        *,
        colored: bool,
    ) -> None:
        found, pen = runs(text), ImageDraw.Draw(picture)
        if len(found) == 1 and found[0].file is None:
            width, rim = outline or (0, None)
            pen.text(place, found[0].text, ink, self._own, anchor=anchor, stroke_width=width, stroke_fill=rim)
            return
        for piece, file, x, y in self._placed(place, text, anchor):
            if file is not None and file.strike:
                self._paste(picture, (x, y), piece, file.opened(self.height), None if colored else ink)
                continue
            font = self._font(file)
            if outline is not None:
                pen.text((x, y), piece, outline[1], font, anchor="ls", stroke_width=outline[0])
            pen.text((x, y), piece, ink, font, anchor="ls", embedded_color=colored and file is not None)

    def _placed(self, place: tuple[float, float], text: str, anchor: str) -> list[tuple[str, FontFile | None, float, float]]:
        """The runs of a line with the left end of each on the base line."""
        x = place[0] - {"l": 0.0, "m": 0.5, "r": 1.0}[anchor[0]] * self.width(text)
        y = place[1]
        if anchor[1] != "s" and isinstance(self._own, ImageFont.FreeTypeFont):
            ascent, descent = self._own.getmetrics()
            y += ascent if anchor[1] == "a" else (ascent - descent) / 2.0
        placed = []
        for piece, file in runs(text):
            placed.append((piece, file, x, y))
            x += self._font(file).getlength(piece) * self._scale(file)
        return placed

    def _paste(
        self, picture: Image.Image, place: tuple[float, float], text: str, font: ImageFont.FreeTypeFont, ink: Ink | None
    ) -> None:
        """Scale letters that are bitmaps of one height; they have colours of their own unless an ink is given."""
        left, top, right, bottom = (round(side) for side in font.getbbox(text, anchor="ls"))
        if right <= left or bottom <= top:
            return
        scale = self.height / font.size
        letters = Image.new("RGBA", (right - left, bottom - top))
        ImageDraw.Draw(letters).text((-left, -top), text, (255, 255, 255, 255), font, anchor="ls", embedded_color=True)
        size = max(1, round(scale * letters.width)), max(1, round(scale * letters.height))
        letters = letters.resize(size, Image.Resampling.LANCZOS)
        corner = round(place[0] + scale * left), round(place[1] + scale * top)
        box = (*corner, corner[0] + size[0], corner[1] + size[1])
        picture.paste(letters if ink is None else ink, box, letters.getchannel("A"))

    def _font(self, file: FontFile | None) -> ImageFont.FreeTypeFont | ImageFont.ImageFont:
        return self._own if file is None else file.opened(self.height)

    def _scale(self, file: FontFile | None) -> float:
        return self.height / file.strike if file is not None and file.strike else 1.0

    def _step(self, spacing: int) -> float:
        return self._own.getbbox("A")[3] + spacing


@lru_cache(maxsize=8)
def lettering(height: int) -> Lettering:
    """Text whose letters have a height [pixels]."""
    return Lettering(height)


@lru_cache(maxsize=1024)
def runs(text: str) -> tuple[Run, ...]:
    """The pieces of a line; one piece in the program's own font where this has all characters, as nearly always."""
    text = shown(text)
    if not isinstance(font_of(PROBE_HEIGHT), ImageFont.FreeTypeFont) or _own_has(text):
        return (Run(text, None),)
    if written_from_the_right(text):
        # One font for the whole line: the order of words of both directions is known to raqm, for one font only.
        whole = find("".join(sorted(set(needed(text)))))
        if whole is not None:
            return (Run(text, whole),)
    pieces = clusters(text)
    files = [_file_for(piece) for piece in pieces]
    for n in range(1, len(pieces) - 1):
        # A space between words of one font is drawn in that font, so that the words stay one run.
        before, after = files[n - 1], files[n + 1]
        if pieces[n].isspace() and before is not None and before == after and before.holds(pieces[n]):
            files[n] = before
    _tell(tuple(piece for piece, file in zip(pieces, files) if file is None and not _own_has(piece)))
    numbered = groupby(range(len(pieces)), key=lambda n: files[n])
    return tuple(Run("".join(pieces[n] for n in group), file) for file, group in numbered)


def _own_has(text: str) -> bool:
    return all(_own_font_has(character) for character in needed(text))


@lru_cache(maxsize=4096)
def _own_font_has(character: str) -> bool:
    font = font_of(PROBE_HEIGHT)
    return not isinstance(font, ImageFont.FreeTypeFont) or holds(font, character)


@lru_cache(maxsize=4096)
def _file_for(cluster: str) -> FontFile | None:
    """The font for a letter with its marks; None is the program's own font, also where no font has them."""
    if _own_has(cluster):
        return None
    whole = needed(cluster)
    return find(whole) or find(whole[0])


def _tell(lacking: tuple[str, ...]) -> None:
    """Write one line about characters that no font has, once for each script."""
    lacking = tuple(each for each in dict.fromkeys(lacking) if script_of(each) not in _told_scripts)
    if not lacking:
        return
    _told_scripts.update(script_of(each) for each in lacking)
    codes = [f"U+{ord(each[0]):04X}" for each in lacking[:MOST_TOLD]]
    named = ", ".join(f"{each} ({code})" if each.isprintable() else code for each, code in zip(lacking, codes))
    more = f" and {len(lacking) - MOST_TOLD} more" if len(lacking) > MOST_TOLD else ""
    cures = "; ".join(dict.fromkeys(package_with(each) for each in lacking))
    logger.warning("no font of this machine has %s%s: boxes are drawn; %s", named, more, cures)
