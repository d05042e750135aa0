"""Pace: the number of steps in a frame of a window, so that a run has the requested speed and the window still answers."""

import time

SLOW_SECONDS = 0.08  # an advance that takes longer is halved, so that the window answers
QUICK_SECONDS = 0.02  # an advance that takes less is doubled, up to the requested number of steps
RATE_SECONDS = 0.5  # time over which steps per second are counted
SLOWEST, FASTEST = -8, 12  # powers of two


class Pace:
    """Steps for each frame: `asked` by the scene, times 2 to the power of the user's `speed`; fewer where steps are slow."""

    def __init__(self, asked: int) -> None:
        """Begin at the speed of the scene."""
        self.asked, self.speed = asked, 0
        self._most = asked
        self._credit = 0.0

    @property
    def wanted(self) -> float:
        """Requested steps for each frame; below 1, some frames have no step."""
        return float(self.asked * 2.0**self.speed)

    def change(self, by: int) -> None:
        """Double the speed the given number of times; a negative number halves it."""
        self.speed = min(max(self.speed + by, SLOWEST), FASTEST)
        self._most = max(1, round(self.wanted))

    def take(self) -> int:
        """Number of steps of the next frame."""
        self._credit += min(self.wanted, self._most)
        steps = int(self._credit)
        self._credit -= steps
        return steps

    def took(self, seconds: float) -> None:
        """Take note of the time that the steps took."""
        if seconds > SLOW_SECONDS:
            self._most = max(self._most // 2, 1)
        elif seconds < QUICK_SECONDS:
            self._most = min(self._most * 2, max(1, round(self.wanted)))

    @property
    def text(self) -> str:
        """A text with the factor between the user's speed and the scene's, empty where they are equal."""
        return "" if self.speed == 0 else f" x{2**self.speed}" if self.speed > 0 else f" x1/{2**-self.speed}"


class Rate:
    """Steps per second over the last half second."""

    def __init__(self) -> None:
        """Begin to count steps."""
        self._since, self._steps, self._rate = time.perf_counter(), 0, 0.0

    def count(self, steps: int) -> float:
        """Add steps, and return the steps per second."""
        self._steps += steps
        passed = time.perf_counter() - self._since
        if passed >= RATE_SECONDS:
            self._rate = self._steps / passed
            self._since, self._steps = time.perf_counter(), 0
        return self._rate
