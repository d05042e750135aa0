"""Words of a text with their places, and numbers among them."""

import math
import re
from collections.abc import Iterator
from dataclasses import dataclass

from mpp_taichi.errors import SceneError
from mpp_taichi.scene.location import Location
from mpp_taichi.wording.told_apart import told_apart

LONGEST_SHOWN = 40


@dataclass(frozen=True)
class Word:
    """A text between white space, and the place of its first character."""

    text: str
    location: Location

    def fault(self, message: str) -> SceneError:
        """An error at this word."""
        return SceneError(f"{self.location}: {message}")

    def number(self, what: str, least: float = -math.inf) -> float:
        """The word as a finite number that is at least `least`; SceneError if it is no such number."""
        try:
            value = float(self.text)
        except ValueError:
            value = math.nan
        if not math.isfinite(value) or "_" in self.text:
            raise self.fault(f"{what} must be a number, not {self.shown}")
        if value < least:
            bound, given = told_apart(least, value)
            raise self.fault(f"{what} must be at least {bound}, not {given}")
        return value

    def whole(self, what: str, least: int, most: int) -> int:
        """The word as a whole number within a range; SceneError if it is no such number."""
        if not (self.text.isascii() and self.text.isdigit() and len(self.text) < 12 and least <= int(self.text) <= most):
            raise self.fault(f"{what} must be a whole number from {least} to {most}, not {self.shown}")
        return int(self.text)

    @property
    def shown(self) -> str:
        """The word as a message shows it."""
        return repr(self.text if len(self.text) <= LONGEST_SHOWN else self.text[:LONGEST_SHOWN] + "…")


def words(text: str, source: str, *, comments: tuple[str, ...] = ()) -> Iterator[list[Word]]:
    """The words of each line that has any; the text after a mark of `comments` is left out."""
    for number, line in enumerate(text.splitlines(), start=1):
        for mark in comments:
            line = line.partition(mark)[0]
        found = [Word(match[0], Location(source, number, match.start() + 1)) for match in re.finditer(r"\S+", line)]
        if found:
            yield found
