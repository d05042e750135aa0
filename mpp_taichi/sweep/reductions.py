"""Reductions of a quantity along the runs of many members, all in arrays: the value at the end or at a time, extremes, means.

They follow the reductions of a single run (diagnostics/_reductions.py), entry by entry; `who` are the members that are sampled.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any

import numpy as np

from mpp_taichi.arithmetic.hermite import cubic
from mpp_taichi.diagnostics._base import Diagnostic
from mpp_taichi.diagnostics._reductions import ROUNDING
from mpp_taichi.diagnostics._track import SAMPLE_ANGLE
from mpp_taichi.energy.energy_error import ZERO_ENERGY
from mpp_taichi.energy.mechanics import kinetic_of_copies
from mpp_taichi.quantities._base import NoResultError, Quantity, Setting


class ManyResults(ABC):
    """A number of each member, found from its samples.

    interval   longest time until the next sample of each member [time]
    """

    def expect(self, count: int) -> None:
        """There are so many members, and no samples yet."""
        self.count = count
        self.interval = np.full(count, np.inf)

    @abstractmethod
    def observe(self, sample: Any, who: np.ndarray) -> None:
        """Take a sample of these members."""

    def finish(self, number: int) -> None:  # noqa: B027 most have their number by then
        """The member has had its last sample, and the run still stands there."""

    @abstractmethod
    def results(self) -> np.ndarray:
        """The numbers so far, (members,); NaN where there is none."""


class KnownAtEnd(ManyResults):
    """A number that only the end of a member tells; it asks for no samples."""

    def __init__(self, count: int) -> None:
        """Nothing is measured."""
        self.expect(count)

    def observe(self, sample: Any, who: np.ndarray) -> None:
        """Nothing."""

    def results(self) -> np.ndarray:
        """Nothing is known."""
        return np.full(self.count, np.nan)


class Undefined(ManyResults):
    """A quantity that is not defined for these scenes."""

    def __init__(self, count: int) -> None:
        """Nothing is measured."""
        self.expect(count)

    def observe(self, sample: Any, who: np.ndarray) -> None:
        """Nothing."""

    def results(self) -> np.ndarray:
        """No numbers."""
        return np.full(self.count, np.nan)


class LastValues(ManyResults):
    """The value in the last sample, or in the first from `until` on."""

    def __init__(self, count: int, quantity: Quantity, until: float | None = None) -> None:
        """There are no samples yet."""
        self.expect(count)
        self.quantity, self.until = quantity, until
        self._values = np.full(count, np.nan)
        self._is_over = np.zeros(count, bool)

    def observe(self, sample: Any, who: np.ndarray) -> None:
        """Measure."""
        values = self.quantity.measure_many(sample)
        taken = ~self._is_over[who]
        self._values[who[taken]] = values[taken]
        if self.until is not None:
            self._is_over[who] |= sample.time >= self.until
            self.interval[who] = self.until - sample.time if sample.time < self.until else np.inf

    def results(self) -> np.ndarray:
        """The values; NaN where the run has not come to `until`."""
        return self._values if self.until is None else np.where(self._is_over, self._values, np.nan)


class Extremes(ManyResults):
    """The largest or smallest value between two times; where the rate is known also of the cubics between the samples."""

    def __init__(
        self, count: int, quantity: Quantity, *, largest: bool, after: float | None = None, until: float | None = None
    ) -> None:
        """There are no samples yet."""
        self.expect(count)
        self.quantity, self._after, self._until = quantity, after, until
        self._sign = -1.0 if largest else 1.0
        self._smallest = np.full(count, np.inf)
        self._seen, self._is_over = np.zeros(count, bool), np.zeros(count, bool)
        self._has_two = np.zeros(count, bool)  # samples, which tell how fast the quantity changes
        self._middle, self._time, self._value, self._rate = (np.zeros(count) for _ in range(4))
        self._farthest, self._fastest, self._steepest = (np.zeros(count) for _ in range(3))

    def observe(self, sample: Any, who: np.ndarray) -> None:
        """Account for the sample, and for the time since the sample before it."""
        takes = ~self._is_over[who]
        if self._until is not None:
            self._is_over[who] |= sample.time >= self._until
        if self._after is not None and sample.time < self._after:
            takes[:] = False
        if not takes.any():
            self.interval[who] = self._limited(np.full(len(who), np.inf), sample.time)
            return
        value = self._sign * self.quantity.measure_many(sample)
        who_takes = who[takes]
        if not self.quantity.has_rate:
            self._smallest[who_takes] = np.fmin(self._smallest[who_takes], value[takes])
            self.interval[who] = self._limited(np.full(len(who), np.inf), sample.time)
            return
        rate = self._sign * self.quantity.rate_many(sample)
        self._follow(who_takes, sample.time, value[takes], rate[takes])
        wanted = self.quantity.sampling_interval_many(sample)
        self.interval[who] = self._limited(self._by_rates(who) if wanted is None else wanted, sample.time)

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

    def _limited(self, wanted: np.ndarray, time: float) -> np.ndarray:
        ends = [end - time for end in (self._after, self._until) if end is not None and end > time]
        if self._until is not None and time >= self._until:
            return np.full_like(wanted, np.inf)
        return np.minimum(wanted, min(ends)) if ends else wanted

    def results(self) -> np.ndarray:
        """The extremes; NaN where the run has not come to the end of the part that counts."""
        found = np.where(np.isfinite(self._smallest), self._sign * self._smallest, np.nan)
        return found if self._until is None else np.where(self._is_over, found, np.nan)


class Means(ManyResults):
    """The mean over time between two times, by the trapezoidal rule."""

    def __init__(self, count: int, quantity: Quantity, *, after: float | None = None, until: float | None = None) -> None:
        """There are no samples yet."""
        self.expect(count)
        self.quantity, self._after, self._until = quantity, after, until
        self._area, self._begin, self._time, self._value = (
            np.zeros(count),
            np.full(count, np.nan),
            np.zeros(count),
            np.zeros(count),
        )
        self._is_over = np.zeros(count, bool)

    def observe(self, sample: Any, who: np.ndarray) -> None:
        """Account for the sample."""
        takes = ~self._is_over[who]
        if self._until is not None:
            self._is_over[who] |= sample.time >= self._until
        if self._after is not None and sample.time < self._after:
            takes[:] = False
        ends = [end - sample.time for end in (self._after, self._until) if end is not None and end > sample.time]
        self.interval[who] = min(ends, default=np.inf)
        if not takes.any():
            return
        value, who = self.quantity.measure_many(sample)[takes], who[takes]
        begun = ~np.isnan(self._begin[who])
        old = who[begun]
        self._area[old] += (sample.time - self._time[old]) * 0.5 * (value[begun] + self._value[old])
        self._begin[who[~begun]] = sample.time
        self._time[who], self._value[who] = sample.time, value

    def results(self) -> np.ndarray:
        """The means; of a single sample its value."""
        span = self._time - self._begin
        found = np.where(
            span > 0.0, self._area / np.where(span > 0.0, span, 1.0), np.where(np.isnan(span), np.nan, self._value)
        )
        return found if self._until is None else np.where(self._is_over, found, np.nan)


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


class EnergyErrors(ManyResults):
    """The largest |E − E₀| / |E₀| of each member; see `energy.energy_error`."""

    def __init__(self, count: int) -> None:
        """There are no samples yet."""
        self.expect(count)
        self._start, self._turned, self._largest = np.full(count, np.nan), np.zeros(count), np.zeros(count)

    def observe(self, sample: Any, who: np.ndarray) -> None:
        """Compare with the first sample."""
        kinetic, potential = kinetic_of_copies(sample.snapshot), sample.potential_energy
        energy = kinetic + potential
        self._start[who] = np.where(np.isnan(self._start[who]), energy, self._start[who])
        self._turned[who] = np.maximum(self._turned[who], kinetic + np.abs(potential))
        start = self._start[who]
        scale = np.where(np.abs(start) > ZERO_ENERGY * self._turned[who], np.abs(start), self._turned[who])
        change = np.abs(energy - start)
        found = np.where(scale > 0.0, change / np.where(scale > 0.0, scale, 1.0), np.where(change == 0.0, 0.0, np.inf))
        self._largest[who] = np.fmax(self._largest[who], found)

    def results(self) -> np.ndarray:
        """The errors."""
        return np.where(np.isnan(self._start), np.nan, self._largest)


class OneByOne(ManyResults):
    """A diagnostic for each member, for quantities that measure one copy at a time."""

    def __init__(self, diagnostics: Sequence[Diagnostic], settings: Sequence[Setting]) -> None:
        """Prepare each for its own scene."""
        self.expect(len(diagnostics))
        self._diagnostics, self._failed = list(diagnostics), np.zeros(len(diagnostics), bool)
        for number, setting in enumerate(settings):
            self._try(number, lambda diagnostic, setting=setting: diagnostic.begin(setting))

    def observe(self, sample: Any, who: np.ndarray) -> None:
        """Let each take its own sample."""
        for number in who:
            self._try(number, lambda diagnostic, number=number: diagnostic.observe(sample.one(number)))
            self.interval[number] = np.inf if self._failed[number] else self._diagnostics[number].interval

    def finish(self, number: int) -> None:
        """Measure the data that only the last sample has."""
        self._try(number, lambda diagnostic: diagnostic.finish())

    def _try(self, number: int, do: Any) -> None:
        if not self._failed[number]:
            try:
                do(self._diagnostics[number])
            except NoResultError:
                self._failed[number] = True

    def results(self) -> np.ndarray:
        """The results."""
        return np.array([self._result(number) for number in range(self.count)])

    def _result(self, number: int) -> float:
        try:
            return np.nan if self._failed[number] else self._diagnostics[number].result()
        except NoResultError:
            return float(np.nan)


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
