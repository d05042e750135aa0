"""Pace: the number of steps in a frame of a window, so that a run has the requested speed and the window still answers."""

import time
from collections.abc import Mapping

from mpp_taichi.scene.human_units import TimeScale

SLOW_SECONDS = 0.08  # an advance that takes longer is halved, so that the window answers
QUICK_SECONDS = 0.04  # an advance that takes less is doubled, up to the requested number of steps
RATE_SECONDS = 0.5  # time over which steps per second are counted
SLOWEST, FASTEST = -8, 12  # powers of two
FRAMES_PER_SECOND = 60  # of a window
MOST_FRAMES = 12  # after a longer wait, as for a picture on a slow machine, a run lags behind the clock
KEEPS_UP = 0.8  # share of the requested speed from which on a run keeps up


class Pace:
    """Steps for each frame: `asked` by the scene in a 60th of a second, times 2 to the power of the user's `speed`.

    A run keeps pace with the clock: a frame that took long is followed by more steps, unless the steps themselves are slow.
    """

    def __init__(self, asked: float, speed: int = 0) -> None:
        """Begin at the speed of the scene, or faster."""
        self.asked, self.speed = asked, speed
        self._most = self._limit
        self._credit = 0.0
        self._taken = 0

    @property
    def wanted(self) -> float:
        """Requested steps in a 60th of a second; below 1, some frames have no step."""
        return float(self.asked * 2.0**self.speed)

    @property
    def _limit(self) -> int:
        return max(1, round(self.wanted * MOST_FRAMES))

    def change(self, by: int) -> None:
        """Double the speed the given number of times; a negative number halves it."""
        self.speed = min(max(self.speed + by, SLOWEST), FASTEST)
        self._most = self._limit

    def take(self, seconds: float = 1.0 / FRAMES_PER_SECOND) -> int:
        """Number of steps of the next frame, where the last frame was so many seconds ago."""
        frames = min(seconds * FRAMES_PER_SECOND, MOST_FRAMES)
        self._credit += min(self.wanted * frames, self._most)
        self._taken = int(self._credit)
        self._credit -= self._taken
        return self._taken

    def took(self, seconds: float) -> None:
        """Take note of the time that the steps took."""
        if seconds > SLOW_SECONDS:
            self._most = max(min(self._taken, self._most) // 2, 1)
        elif seconds < QUICK_SECONDS:
            self._most = min(self._most * 2, self._limit)

    @property
    def text(self) -> str:
        """A text with the factor between the user's speed and the scene's, empty where they are equal."""
        return "" if self.speed == 0 else f" x{2**self.speed}" if self.speed > 0 else f" x1/{2**-self.speed}"


class Rate:
    """Steps, and the time of the scene, in a second, over the last half second."""

    def __init__(self) -> None:
        """Begin to count steps."""
        self._since, self._steps, self._span = time.perf_counter(), 0, 0.0
        self.steps, self.time = 0.0, 0.0

    def count(self, steps: int, span: float) -> None:
        """Add steps, and the time of the scene by which they went on."""
        self._steps, self._span = self._steps + steps, self._span + span
        passed = time.perf_counter() - self._since
        if passed >= RATE_SECONDS:
            self.steps, self.time = self._steps / passed, self._span / passed
            self._since, self._steps, self._span = time.perf_counter(), 0, 0.0

    def text(self, pace: Pace, units: Mapping[str, str] | None) -> str:
        """The speed, `1 s = 12.0 h`, with the requested speed where the run does not keep up; and the steps in a second."""
        if self.steps <= 0.0 or self.time <= 0.0:
            return f"{self.steps:,.0f} steps/s{pace.text}"
        wanted = self.time / self.steps * pace.wanted * FRAMES_PER_SECOND
        scale = TimeScale.of(units, max(self.time, wanted))
        behind = "" if self.time >= KEEPS_UP * wanted else f" of {scale.text(wanted)}"
        return f"1 s = {scale.text(self.time)}{behind}, {self.steps:,.0f} steps/s{pace.text}"
