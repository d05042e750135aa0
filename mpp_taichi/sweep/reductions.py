"""Reductions of a quantity along the runs of many members, all in arrays: the value at the end or at a time, extremes, means.

They follow the reductions of a single run (diagnostics/_reductions.py), entry by entry; `who` are the members that are sampled.
"""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any

import numpy as np

from mpp_taichi.diagnostics._base import Diagnostic
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


class NotMeasured(ManyResults):
    """No number: only the end of a member tells it, or it is not defined for these scenes. It asks for no samples."""

    def __init__(self, count: int) -> None:
        """Nothing is measured."""
        self.expect(count)

    def observe(self, sample: Any, who: np.ndarray) -> None:
        """Nothing."""

    def results(self) -> np.ndarray:
        """No numbers."""
        return np.full(self.count, np.nan)


class PartOfRuns:
    """The part of each run that counts: from `after` to the first sample from `until` on, by default the whole run."""

    def __init__(self, count: int, after: float | None, until: float | None) -> None:
        """There are no samples yet."""
        self._after, self._until = after, until
        self._is_over = np.zeros(count, bool)

    def takes(self, time: float, who: np.ndarray) -> np.ndarray:
        """Whether the sample at this time counts, for each of these members; called once for each sample."""
        found = ~self._is_over[who]
        if self._until is not None:
            self._is_over[who] |= time >= self._until
        return found if self._after is None or time >= self._after else np.zeros(len(who), bool)

    def limited(self, wanted: np.ndarray, time: float) -> np.ndarray:
        """The wanted times until the next samples, but no longer than to the beginning or the end of the part."""
        if self._until is not None and time >= self._until:
            return np.full_like(wanted, np.inf)
        ends = [end - time for end in (self._after, self._until) if end is not None and end > time]
        return np.minimum(wanted, min(ends)) if ends else wanted

    def ended(self, results: np.ndarray) -> np.ndarray:
        """The results; NaN for a member whose run has not come to the end of the part."""
        return results if self._until is None else np.where(self._is_over, results, np.nan)


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


class Means(ManyResults):
    """The mean over time between two times, by the trapezoidal rule."""

    def __init__(self, count: int, quantity: Quantity, *, after: float | None = None, until: float | None = None) -> None:
        """There are no samples yet."""
        self.expect(count)
        self.quantity, self._part = quantity, PartOfRuns(count, after, until)
        self._area, self._time, self._value = (np.zeros(count) for _ in range(3))
        self._begin = np.full(count, np.nan)

    def observe(self, sample: Any, who: np.ndarray) -> None:
        """Account for the sample."""
        takes = self._part.takes(sample.time, who)
        self.interval[who] = self._part.limited(np.full(len(who), np.inf), sample.time)
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
        return self._part.ended(found)


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
