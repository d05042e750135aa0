"""Trails: the last positions of every particle, drawn as lines that fade."""

from bisect import bisect_left

import numpy as np

from mpp_taichi.views._base import Frame


class Trails:
    """The last positions of every particle, as line segments that fade into the background.

    `length` is a number of frames. A frame at the same time as the last frame (a paused simulation) adds no position. A
    frame at an earlier time removes the positions after that time. A frame with another number of particles begins new
    trails.
    """

    def __init__(self, length: int) -> None:
        """Begin without positions."""
        self.length = length
        self._positions: list[np.ndarray] = []
        self._times: list[float] = []

    def clear(self) -> None:
        """Forget every position."""
        self._positions.clear()
        self._times.clear()

    def add(self, frame: Frame) -> None:
        """Add the positions of a frame."""
        if self.length < 1 or (self._times and frame.time == self._times[-1]):
            return
        if self._positions and len(self._positions[-1]) != len(frame.position):
            self.clear()
        kept = bisect_left(self._times, frame.time)
        del self._times[kept:], self._positions[kept:]
        self._times.append(frame.time)
        self._positions.append(np.array(frame.position, dtype=float))
        del self._times[: -(self.length + 1)], self._positions[: -(self.length + 1)]

    def segments(self, color: np.ndarray, background: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Segments from oldest to newest: ends (count, 2, 3) and colours of both ends (count, 2, 3), then the ages.

        The age of a segment, shape (count,), is 0 for the newest and grows to 1 for the oldest.
        """
        steps = len(self._positions) - 1
        if steps < 1 or self.length < 1:
            return np.zeros((0, 2, 3)), np.zeros((0, 2, 3)), np.zeros(0)
        path = np.stack(self._positions)
        ends = np.stack([path[:-1], path[1:]], axis=2).reshape(-1, 2, 3)
        brightness = 1.0 - np.arange(steps, -1, -1)[:, None, None] / self.length
        fading = background + brightness * (np.asarray(color, dtype=float) - background)
        colors = np.stack([fading[:-1], fading[1:]], axis=2).reshape(-1, 2, 3)
        age = np.repeat(1.0 - brightness[1:, 0, 0], len(color))
        return ends, colors, age
