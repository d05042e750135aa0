"""Extremes and values at a time of a quantity along the runs of many members: what lies between samples counts too.

They follow the reductions of a single run (diagnostics/_reductions.py, _track.py), entry by entry.
"""

from typing import Any

import numpy as np

from mpp_taichi.arithmetic.hermite import cubic
from mpp_taichi.diagnostics._reductions import ROUNDING
from mpp_taichi.diagnostics._track import SAMPLE_ANGLE
from mpp_taichi.quantities._base import Quantity
from mpp_taichi.sweep.reductions import ManyResults, PartOfRuns


class Extremes(ManyResults):
    """The largest or smallest value between two times; where the rate is known also of the cubics between the samples."""

    def __init__(
        self, count: int, quantity: Quantity, *, largest: bool, after: float | None = None, until: float | None = None
    ) -> None:
        """There are no samples yet."""
        self.expect(count)
        self.quantity, self._part = quantity, PartOfRuns(count, after, until)
        self._sign = -1.0 if largest else 1.0
        self._smallest = np.full(count, np.inf)
        self._seen = np.zeros(count, bool)
        self._has_two = np.zeros(count, bool)  # samples, which tell how fast the quantity changes
        self._middle, self._time, self._value, self._rate = (np.zeros(count) for _ in range(4))
        self._farthest, self._fastest, self._steepest = (np.zeros(count) for _ in range(3))

    def observe(self, sample: Any, who: np.ndarray) -> None:
        """Account for the sample, and for the time since the sample before it."""
        takes = self._part.takes(sample.time, who)
        self.interval[who] = self._part.limited(np.full(len(who), np.inf), sample.time)
        if not takes.any():
            return
        value = self._sign * self.quantity.measure_many(sample)
        who_takes = who[takes]
        if not self.quantity.has_rate:
            self._smallest[who_takes] = np.fmin(self._smallest[who_takes], value[takes])
            return
        rate = self._sign * self.quantity.rate_many(sample)
        self._follow(who_takes, sample.time, value[takes], rate[takes])
        wanted = self.quantity.sampling_interval_many(sample)
        self.interval[who] = self._part.limited(self._by_rates(who) if wanted is None else wanted, sample.time)

    def _follow(self, who: np.ndarray, time: float, value: np.ndarray, rate: np.ndarray) -> None:
        first = ~self._seen[who]
        self._middle[who[first]] = value[first]
        self._farthest[who] = np.maximum(self._farthest[who], np.abs(value - self._middle[who]))
        self._fastest[who] = np.maximum(self._fastest[who], np.abs(rate))
        span = time - self._time[who]
        passed = ~first & (span > 0.0)
        later = who[passed]
        change = np.abs(rate - self._rate[who])[passed] / span[passed]
        self._steepest[later] = np.maximum(self._steepest[later], change)
        before = self._value[later], self._rate[later]
        between = lowest(span[passed], before, (value[passed], rate[passed]))
        self._smallest[who] = np.fmin(self._smallest[who], value)
        self._smallest[later] = np.fmin(self._smallest[later], between)
        self._time[who], self._value[who], self._rate[who] = time, value, rate
        self._has_two[who] |= self._seen[who]
        self._seen[who] = True

    def _by_rates(self, who: np.ndarray) -> np.ndarray:
        """A small part of an oscillation, as of a Track; 0 before the second sample."""
        by_distance = _ratio(self._fastest[who], self._farthest[who])
        fastest = np.maximum(by_distance, _ratio(self._steepest[who], self._fastest[who]))
        wanted = np.where(fastest > 0.0, SAMPLE_ANGLE / np.where(fastest > 0.0, fastest, 1.0), np.inf)
        return np.where(self._has_two[who], wanted, 0.0)

    def results(self) -> np.ndarray:
        """The extremes; NaN where the run has not come to the end of the part that counts."""
        found = np.where(np.isfinite(self._smallest), self._sign * self._smallest, np.nan)
        return self._part.ended(found)


class ValuesAtTime(ManyResults):
    """A quantity with a known rate at a time: on the cubic through values and rates of the samples around it (Hermite)."""

    def __init__(self, count: int, quantity: Quantity, at: float) -> None:
        """There are no samples yet."""
        self.expect(count)
        self.quantity, self.at = quantity, at
        self._samples = np.full((2, 3, count), np.nan)  # before and after; time, value, rate

    def observe(self, sample: Any, who: np.ndarray) -> None:
        """Keep the last sample before the time and the first from it on."""
        last = self._samples[1, 0, who]
        takes = np.isnan(last) | (last < self.at)
        self.interval[who] = self.at - sample.time if sample.time < self.at else np.inf
        if not takes.any():
            return
        chosen = who[takes]
        self._samples[0][:, chosen] = self._samples[1][:, chosen]
        self._samples[1, 0, chosen] = sample.time
        self._samples[1, 1, chosen] = self.quantity.measure_many(sample)[takes]
        self._samples[1, 2, chosen] = self.quantity.rate_many(sample)[takes]

    def results(self) -> np.ndarray:
        """The values then; NaN where the run has not come to the time."""
        (begin, *before), (end, *after) = self._samples
        share = np.minimum(1.0, (self.at - begin) / np.where(end > begin, end - begin, 1.0))
        found = np.where(np.isnan(begin), after[0], cubic(share, end - begin, (before[0], before[1]), (after[0], after[1])))
        return np.where(self.at <= end * (1.0 + ROUNDING), found, np.nan)


def lowest(span: np.ndarray, before: tuple[np.ndarray, np.ndarray], after: tuple[np.ndarray, np.ndarray]) -> np.ndarray:
    """Smallest values of the cubics between two samples, as of a Track."""
    (x0, v0), (x1, v1) = before, after
    a, b, c = span * v0, 6.0 * (x1 - x0) - span * (4.0 * v0 + 2.0 * v1), 6.0 * (x0 - x1) + 3.0 * span * (v0 + v1)
    inside = b * b - 4.0 * a * c
    q = -0.5 * (b + np.copysign(np.sqrt(np.maximum(inside, 0.0)), b))
    result = np.fmin(x0, x1)
    for root in (_ratio(q, c), _ratio(a, q)):
        takes = (inside >= 0.0) & (root >= 0.0) & (root <= 1.0)
        result = np.where(takes, np.fmin(result, cubic(np.where(takes, root, 0.0), span, before, after)), result)
    return result


def _ratio(number: np.ndarray, divisor: np.ndarray) -> np.ndarray:
    """number / divisor, and 0 where the divisor is 0."""
    return np.where(divisor != 0.0, number / np.where(divisor != 0.0, divisor, 1.0), 0.0)
