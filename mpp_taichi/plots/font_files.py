"""Fonts of the machine, for characters that the program's own font lacks: found by fontconfig, or in the usual folders."""

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from PIL import Image, ImageDraw, ImageFont

PROBE_HEIGHT = 32  # pixels of the letters by which a font shows whether it has a character
STRIKES = (109, 136, 128, 160, 96, 64)  # heights of the only letters that fonts of coloured bitmaps have [pixels]
ABSENT = "\U0010ffff"  # Unicode gives this number to no character, so that a font draws its box for it
SECONDS = 10.0  # for a program of fontconfig
SUFFIXES = (".ttf", ".otf", ".ttc", ".otc")
# Beginnings of file names that are looked at first: fonts of macOS and Windows for large scripts, then any others.
FIRST = (
    *("noto", "pingfang", "hiragino", "applesdgothic", "apple color", "apple symbols", "arial unicode", "geeza", "arialhb"),
    *("msyh", "yugoth", "msgothic", "malgun", "segoeui.", "seguisym", "seguiemj", "nirmala", "leelaw", "arial.", "dejavusans."),
)
STYLES = ("bold", "italic", "oblique", "light", "thin", "black", "mono", "condensed", "serif")  # looked at after the others
WITHOUT_LETTERS = ("lastresort", "adobeblank", "adobe blank")  # these fonts draw something, or nothing, for every character


@dataclass(frozen=True)
class FontFile:
    """A font in a file; `strike` is the height of the only letters that a font of bitmaps has, 0 for a font of outlines."""

    path: str
    index: int = 0
    strike: int = 0

    @classmethod
    def of(cls, path: str, index: int = 0) -> "FontFile | None":
        """The font in a file, or None where the file is no font that can be drawn."""
        if Path(path).name.lower().startswith(WITHOUT_LETTERS):
            return None
        for strike in (0, *STRIKES):
            font = cls(path, index, strike)
            try:
                font.opened(PROBE_HEIGHT)
            except OSError:
                continue
            return font
        return None

    def opened(self, height: int) -> ImageFont.FreeTypeFont:
        """The font with letters of so many pixels, or of the only height that it has."""
        return _opened(self.path, self.index, self.strike or height)

    def holds(self, characters: str) -> bool:
        """Whether the font has all of these characters."""
        return all(holds(self.opened(PROBE_HEIGHT), character) for character in characters)


def holds(font: ImageFont.FreeTypeFont, character: str) -> bool:
    """Whether a font has a character: for a character that it lacks, a font draws the same box as for any other."""
    try:
        plain = _without_layout(font)
        return _glyph(plain, character) != _glyph(plain, ABSENT)
    except (OSError, ValueError):  # a font whose drawing of this character is damaged
        return False


@lru_cache(maxsize=512)
def find(characters: str) -> FontFile | None:
    """A font of this machine that has all of these characters, or None."""
    seen: set[tuple[str, int]] = set()
    for path, index in _candidates(characters):
        if (path, index) not in seen:
            seen.add((path, index))
            font = FontFile.of(path, index)
            if font is not None and font.holds(characters):
                return font
    return None


def _candidates(characters: str) -> Iterator[tuple[str, int]]:
    """Files that may have the characters, with the number of the font in the file, the likeliest first."""
    if shutil.which("fc-list") and shutil.which("fc-match"):
        # Not the font of the nearest style alone, which need not have the characters; only fonts of the list have them.
        charset = "charset=" + " ".join(f"{ord(character):x}" for character in characters)
        yield from _told("fc-match", f"sans-serif:{charset}")
        yield from sorted(_told("fc-list", f":{charset}"), key=lambda found: _order(Path(found[0])))
        return
    files = {file for folder in _folders() for file in _files(folder)}
    yield from ((str(file), 0) for file in sorted(files, key=_order))


def _told(program: str, pattern: str) -> list[tuple[str, int]]:
    command = [program, "--format", "%{file}\t%{index}\n", pattern]
    try:
        done = subprocess.run(command, stdin=subprocess.DEVNULL, capture_output=True, timeout=SECONDS, check=False)
    except (OSError, subprocess.TimeoutExpired):
        return []
    lines = (line.rpartition("\t") for line in os.fsdecode(done.stdout).splitlines())
    return [(path, int(index)) for path, _, index in lines if path and index.isdecimal()]


def _order(file: Path) -> tuple[bool, int, int, str]:
    """Plain fonts before bold and slanted fonts, then the fonts of `FIRST` in their order, then by name."""
    name = file.name.lower()
    rank = next((number for number, beginning in enumerate(FIRST) if name.startswith(beginning)), len(FIRST))
    styles = sum(style in name for style in STYLES)
    return rank == len(FIRST), styles, rank, name


def _folders() -> list[Path]:
    home, environment = Path.home(), os.environ
    if sys.platform == "darwin":
        return [Path("/System/Library/Fonts"), Path("/Library/Fonts"), home / "Library/Fonts"]
    if sys.platform == "win32":
        own = environment.get("LOCALAPPDATA", str(home / "AppData/Local"))
        return [Path(environment.get("WINDIR", "C:/Windows")) / "Fonts", Path(own) / "Microsoft/Windows/Fonts"]
    own = environment.get("XDG_DATA_HOME") or str(home / ".local/share")
    return [Path("/usr/share/fonts"), Path("/usr/local/share/fonts"), Path(own) / "fonts", home / ".fonts"]


@lru_cache(maxsize=8)
def _files(folder: Path) -> tuple[Path, ...]:
    found = (Path(place) / name for place, _, names in os.walk(folder) for name in names)
    return tuple(sorted(file for file in found if file.suffix.lower() in SUFFIXES))


@lru_cache(maxsize=32)
def _opened(path: str, index: int, height: int) -> ImageFont.FreeTypeFont:
    return ImageFont.truetype(path, height, index=index)


@lru_cache(maxsize=32)
def _without_layout(font: ImageFont.FreeTypeFont) -> ImageFont.FreeTypeFont:
    """The font with each letter by itself; otherwise a mark, even one that is absent, is set above the letter before it."""
    return font.font_variant(layout_engine=ImageFont.Layout.BASIC)


def _glyph(font: ImageFont.FreeTypeFont, character: str) -> tuple[float, bytes]:
    """Its advance and its picture; parts of very large letters that do not lie in the picture are left out."""
    height = round(font.size)
    picture = Image.new("RGBA", (2 * height, 2 * height))
    place = height // 2, height * 3 // 2
    ImageDraw.Draw(picture).text(place, character, (255, 255, 255, 255), font, anchor="ls", embedded_color=True)
    return font.getlength(character), picture.tobytes()
