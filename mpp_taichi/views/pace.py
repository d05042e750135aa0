"""Pace: how many steps a frame of a window takes, so that it runs as fast as it is asked to and still answers."""

import time

SLOW_SECONDS = 0.08  # an advance that takes longer is halved, so that the window answers
QUICK_SECONDS = 0.02  # one that takes less is doubled again, up to what was asked for
RATE_SECONDS = 0.5  # over which steps per second are counted
SLOWEST, FASTEST = -8, 12  # powers of two


class Pace:
    """Steps for each frame: `asked` by the scene, times two to the power `speed` by the user, less where steps are slow."""

    def __init__(self, asked: int) -> None:
        """Begin at the speed asked for."""
        self.asked, self.speed = asked, 0
        self._most = asked
        self._credit = 0.0

    @property
    def wanted(self) -> float:
        """Steps for each frame that are asked for; below one, some frames have none."""
        return float(self.asked * 2.0**self.speed)

    def change(self, by: int) -> None:
        """Twice as fast, or half as fast, so many times."""
        self.speed = min(max(self.speed + by, SLOWEST), FASTEST)
        self._most = max(1, round(self.wanted))

    def take(self) -> int:
        """Steps of the next frame."""
        self._credit += min(self.wanted, self._most)
        steps = int(self._credit)
        self._credit -= steps
        return steps

    def took(self, seconds: float) -> None:
        """Say how long they took."""
        if seconds > SLOW_SECONDS:
            self._most = max(self._most // 2, 1)
        elif seconds < QUICK_SECONDS:
            self._most = min(self._most * 2, max(1, round(self.wanted)))

    @property
    def text(self) -> str:
        """How much faster than the scene asks, where the user has changed it."""
        return "" if self.speed == 0 else f" x{2**self.speed}" if self.speed > 0 else f" x1/{2**-self.speed}"


class Rate:
    """Steps per second over the last half second."""

    def __init__(self) -> None:
        """Begin to count."""
        self._since, self._steps, self._rate = time.perf_counter(), 0, 0.0

    def count(self, steps: int) -> float:
        """Add steps, and say how many there are in a second."""
        self._steps += steps
        passed = time.perf_counter() - self._since
        if passed >= RATE_SECONDS:
            self._rate = self._steps / passed
            self._since, self._steps = time.perf_counter(), 0
        return self._rate
