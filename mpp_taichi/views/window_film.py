"""A film of what a window shows, from one press of a key to the next, in the pace in which it was seen."""

from collections.abc import Callable
from typing import Protocol

import numpy as np

from mpp_taichi.errors import MppError

FILM_FPS = 30
MOST_REPEATS = 30  # pictures of a film for one picture of the window, which took long


class Tape(Protocol):
    """A film that is being written to `path`."""

    path: object

    def write(self, picture: np.ndarray) -> None:
        """Add a picture."""

    def close(self) -> None:
        """Finish the film."""


def no_film(size: tuple[int, int], fps: float) -> Tape:
    """Refuse: a window by itself writes no films."""
    raise MppError("no film can be written from here")


class WindowFilm:
    """Records pictures while it is on; `start` opens a film of (width, height) pixels."""

    def __init__(self, start: Callable[[tuple[int, int], float], Tape]) -> None:
        """Nothing is recorded yet."""
        self._start = start
        self._tape: Tape | None = None
        self._size = (0, 0)
        self._due = 0.0

    @property
    def on(self) -> bool:
        """Whether pictures are recorded."""
        return self._tape is not None

    def toggle(self, picture: np.ndarray | None) -> str:
        """Begin a film of pictures like this one, or end the film; returns a line about it."""
        if self._tape is not None:
            return self.end()
        if picture is None:
            return "only the look of films is recorded: press D"
        self._size, self._due = (picture.shape[1], picture.shape[0]), 1.0
        try:
            self._tape = self._start((_even(self._size[0]), _even(self._size[1])), FILM_FPS)
        except MppError as error:
            return str(error)
        return f"records {self._tape.path}"

    def add(self, picture: np.ndarray | None, seconds: float) -> str:
        """Add a picture that was seen for so many seconds; returns a line where the film ends by this."""
        if self._tape is None:
            return ""
        if picture is None or picture.shape[1::-1] != self._size:
            return self.end() + ", as the picture has another size"
        self._due += min(seconds * FILM_FPS, MOST_REPEATS)
        try:
            while self._due >= 1.0:
                self._tape.write(picture[: _even(self._size[1]), : _even(self._size[0])])
                self._due -= 1.0
        except MppError as error:
            self._tape = None
            return str(error)
        return ""

    def end(self) -> str:
        """End the film, if there is one; returns a line about it."""
        tape, self._tape = self._tape, None
        if tape is None:
            return ""
        try:
            tape.close()
        except MppError as error:
            return str(error)
        return f"saved {tape.path}"


def _even(pixels: int) -> int:
    """Films have an even number of rows and columns."""
    return pixels - pixels % 2
