"""Trails that a user switches on in a window: of so many particles that the window still answers."""

from dataclasses import replace

import numpy as np

from mpp_taichi.views._base import Frame
from mpp_taichi.views.trails import Trails

MOST_PIECES = 10_000
"""Particles times frames. Trails of all 3,073 particles of a ring through 60 frames would take 0.2 s for each picture."""


class FewTrails:
    """The trails of all particles, or of particles evenly chosen among many; `length` is a number of frames.

    With `everything` all particles have trails, however many there are.
    """

    def __init__(self, length: int, *, everything: bool = False) -> None:
        """Begin without positions."""
        self._trails, self._everything = Trails(length), everything
        self._most = max(1, MOST_PIECES // length)
        self._chosen = np.arange(0)
        self._count = 0

    @property
    def message(self) -> str:
        """A line about the particles that have no trail; empty where all have trails."""
        if len(self._chosen) == self._count:
            return ""
        return f"trails of {len(self._chosen):,} of {self._count:,} particles"

    def clear(self) -> None:
        """Forget every position."""
        self._trails.clear()

    def add(self, frame: Frame) -> None:
        """Add the positions of a frame."""
        if len(frame.position) != self._count:
            self._count = len(frame.position)
            every = 1 if self._everything else max(1, -(-self._count // self._most))
            self._chosen = np.arange(0, self._count, every)
        if len(self._chosen) < self._count:
            velocity = None if frame.velocity is None else frame.velocity[self._chosen]
            frame = replace(frame, position=frame.position[self._chosen], velocity=velocity, path_index=None)
        self._trails.add(frame)

    def segments(
        self, color: np.ndarray, background: np.ndarray, tolerance: float = np.inf
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Ends, colours of the ends and ages, as of `Trails`; `color` is of all particles."""
        return self._trails.segments(np.asarray(color)[self._chosen], background, tolerance)
