"""The course of a number between two samples: the cubic through both values and both rates (Hermite)."""

import math

from mpp_taichi.arithmetic.hermite import crossing, cubic

SAMPLE_ANGLE = 0.1  # radians of an oscillation between two samples: the cubic errs by 0.1⁴/384 = 3e-7 of the amplitude


class Track:
    """The last two samples of a number, and the longest time until the next.

    The angular frequency of an oscillation is the largest rate over the largest distance from the middle, and the largest
    change of the rate over the largest rate. Early on the larger of the two is the inverse of the time since the start.
    """

    def __init__(self, middle: float) -> None:
        """There are no samples yet; distances are from `middle`."""
        self.samples: list[tuple[float, float, float]] = []  # time, value, rate
        self._middle = middle
        self._farthest = self._fastest = self._steepest = 0.0

    def add(self, time: float, value: float, rate: float) -> None:
        """Keep a sample."""
        self.samples = [*self.samples[-1:], (time, value, rate)]
        self._farthest = max(self._farthest, abs(value - self._middle))
        self._fastest = max(self._fastest, abs(rate))
        if len(self.samples) == 2 and time > self.samples[0][0]:
            self._steepest = max(self._steepest, abs(rate - self.samples[0][2]) / (time - self.samples[0][0]))

    @property
    def interval(self) -> float:
        """A small part of an oscillation; infinite for a number that does not change."""
        if len(self.samples) < 2:
            return 0.0
        by_distance = self._fastest / self._farthest if self._farthest > 0.0 else 0.0
        by_speed = self._steepest / self._fastest if self._fastest > 0.0 else 0.0
        return SAMPLE_ANGLE / max(by_distance, by_speed) if max(by_distance, by_speed) > 0.0 else math.inf

    def value(self, s: float) -> float:
        """The cubic at the part s in 0…1 of the time between the two samples."""
        (begin, *before), (end, *after) = self.samples
        return cubic(s, end - begin, (before[0], before[1]), (after[0], after[1]))

    def first_crossing(self, level: float) -> float:
        """Time between the samples at which the number passes a level that lies between its two values."""
        (begin, *before), (end, *after) = self.samples
        return crossing(begin, end, (before[0], before[1]), (after[0], after[1]), level=level)

    def lowest(self) -> float:
        """Smallest value of the cubic between the samples."""
        (begin, x0, v0), (end, x1, v1) = self.samples
        h = end - begin
        # The derivative of the cubic is a + b s + c s².
        a, b, c = h * v0, 6.0 * (x1 - x0) - h * (4.0 * v0 + 2.0 * v1), 6.0 * (x0 - x1) + 3.0 * h * (v0 + v1)
        root = b * b - 4.0 * a * c
        candidates = [0.0, 1.0]
        if root >= 0.0:
            q = -0.5 * (b + math.copysign(math.sqrt(root), b))
            candidates += [q / c if c else 0.0, a / q if q else 0.0]
        return min(self.value(s) for s in candidates if 0.0 <= s <= 1.0)
