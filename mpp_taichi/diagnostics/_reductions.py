"""Reductions of a quantity along a run to one number: its value at the end or at a time, an extreme, the mean."""

import math

import numpy as np

from mpp_taichi.diagnostics._base import Diagnostic
from mpp_taichi.diagnostics._track import Track
from mpp_taichi.quantities._base import NoResultError, Quantity, RunSample, Setting
from mpp_taichi.wording.told_apart import told_apart

ROUNDING = 1e-9  # of the time: the steps of a run need not add up to its end in the last bit


class AtEnd(Diagnostic):
    """The quantity at the end of the run, or in the first sample from `until` on."""

    def __init__(self, quantity: Quantity, *, until: float | None = None) -> None:
        """There are no samples yet."""
        self.quantity, self.until = quantity, until
        self._sample: RunSample | None = None
        self._value: float | None = None
        self._time = 0.0

    def begin(self, setting: Setting) -> None:
        """Prepare the quantity."""
        self.quantity.begin(setting)

    def observe(self, sample: RunSample) -> None:
        """Keep the sample, up to the last sample that counts; measure it at once only where this is necessary."""
        if self.until is not None and self._sample is not None and self._time >= self.until:
            return
        self._sample, self._time, self._value = sample, sample.time, None
        if self.quantity.remembers or (self.until is not None and self._time >= self.until):
            self.finish()

    @property
    def interval(self) -> float:
        """Until the time that is asked for."""
        if self.until is None or self._sample is None:
            return math.inf
        return self.until - self._time if self._time < self.until else math.inf

    def finish(self) -> None:
        """Measure the sample."""
        if self._sample is not None and self._value is None:
            self._value = self.quantity.measure(self._sample)

    def result(self) -> float:
        """The number."""
        if self._sample is None:
            raise NoResultError("the run was never sampled")
        if self.until is not None and self._time < self.until:
            raise NoResultError(f"the run ended before time {self.until:g}")
        self.finish()
        assert self._value is not None
        return self._value


class AtTime(Diagnostic):
    """A quantity with a known rate at a time: on the cubic through values and rates of the samples around it (Hermite)."""

    def __init__(self, quantity: Quantity, at: float) -> None:
        """There are no samples yet."""
        self.quantity, self.at = quantity, at
        self._track = Track(0.0)

    def begin(self, setting: Setting) -> None:
        """Prepare the quantity."""
        self.quantity.begin(setting)

    def observe(self, sample: RunSample) -> None:
        """Keep the last sample before the time and the first from it on."""
        if not self._track.samples or self._track.samples[-1][0] < self.at:
            self._track.add(sample.time, self.quantity.measure(sample), self.quantity.rate(sample))

    @property
    def interval(self) -> float:
        """Until the time; the samples around it are then a step apart."""
        missing = self.at - self._track.samples[-1][0] if self._track.samples else 0.0
        return missing if missing > 0.0 else math.inf

    def result(self) -> float:
        """The number then."""
        samples = self._track.samples
        if not samples:
            raise NoResultError("the run was never sampled")
        times = [sample[0] for sample in samples]
        if not times[0] <= self.at <= times[-1] * (1.0 + ROUNDING):
            first, last, asked = told_apart(times[0], times[-1], self.at)
            raise NoResultError(f"the run was at times {first} and {last}, not at {asked}")
        if len(times) < 2:
            return samples[0][1]
        return self._track.value(min(1.0, (self.at - times[0]) / (times[1] - times[0])))


class Part:
    """The part of a run that counts: from `after` to the first sample from `until` on, by default the whole run."""

    def __init__(self, after: float | None, until: float | None) -> None:
        """There are no samples yet."""
        self._after, self._until = after, until
        self._time: float | None = None

    def takes(self, time: float) -> bool:
        """Whether the sample at this time counts; called once for each sample."""
        if self._is_over:
            return False
        self._time = time
        return self._after is None or time >= self._after

    def interval(self, wanted: float) -> float:
        """The wanted time until the next sample, but no longer than to the beginning or the end of the part."""
        if self._time is None:
            return 0.0
        ends = [end - self._time for end in (self._after, self._until) if end is not None and end > self._time]
        return math.inf if self._is_over else min([wanted, *ends])

    def require_end(self) -> None:
        """NoResultError where the run ended before the part did."""
        if self._time is None:
            raise NoResultError("the run was never sampled")
        for end in (self._after, self._until):
            if end is not None and self._time < end:
                raise NoResultError(f"the run ended before time {end:g}")

    @property
    def _is_over(self) -> bool:
        return self._time is not None and self._until is not None and self._time >= self._until


class Extreme(Diagnostic):
    """The largest or smallest value of a quantity; where its rate is known also of the cubics between the samples."""

    def __init__(self, quantity: Quantity, *, largest: bool, after: float | None = None, until: float | None = None) -> None:
        """There are no samples yet."""
        self.quantity, self._part = quantity, Part(after, until)
        self._sign = -1.0 if largest else 1.0  # the smallest of the quantity, or of its negative
        self._track: Track | None = None
        self._smallest = math.inf
        self._wanted = math.inf

    def begin(self, setting: Setting) -> None:
        """Prepare the quantity."""
        self.quantity.begin(setting)

    def observe(self, sample: RunSample) -> None:
        """Account for the sample, and for the time since the sample before it."""
        takes = self._part.takes(sample.time)
        if not takes and not self.quantity.remembers:
            return
        value = self._sign * self.quantity.measure(sample)
        if not takes:
            return
        if not self.quantity.has_rate:
            self._smallest = min(self._smallest, value)
            return
        self._track = self._track or Track(value)
        self._track.add(sample.time, value, self._sign * self.quantity.rate(sample))
        self._smallest = min(self._smallest, self._track.lowest() if len(self._track.samples) == 2 else value)
        wanted = self.quantity.sampling_interval(sample)
        self._wanted = self._track.interval if wanted is None else wanted

    @property
    def interval(self) -> float:
        """Often enough for the cubic."""
        return self._part.interval(self._wanted)

    def result(self) -> float:
        """The extreme."""
        self._part.require_end()
        return self._sign * self._smallest


class Mean(Diagnostic):
    """The mean of a quantity over time, by the trapezoidal rule."""

    def __init__(self, quantity: Quantity, *, after: float | None = None, until: float | None = None) -> None:
        """There are no samples yet."""
        self.quantity, self._part = quantity, Part(after, until)
        self._times: list[float] = []
        self._values: list[float] = []

    def begin(self, setting: Setting) -> None:
        """Prepare the quantity."""
        self.quantity.begin(setting)

    def observe(self, sample: RunSample) -> None:
        """Account for the sample."""
        takes = self._part.takes(sample.time)
        if not takes and not self.quantity.remembers:
            return
        value = self.quantity.measure(sample)
        if takes:
            self._times.append(sample.time)
            self._values.append(value)

    @property
    def interval(self) -> float:
        """The samples of the table will do."""
        return self._part.interval(math.inf)

    def result(self) -> float:
        """The mean; of a single sample its value."""
        self._part.require_end()
        times, values = np.array(self._times), np.array(self._values)
        span = float(times[-1] - times[0])
        return float(np.sum(np.diff(times) * 0.5 * (values[1:] + values[:-1]))) / span if span > 0.0 else float(values[-1])


def reduced(
    quantity: Quantity, *, when: str = "end", at: float | None = None, after: float | None = None, until: float | None = None
) -> Diagnostic:
    """The reduction that the keys of an expectation ask for; scene.expectations has refused keys that exclude each other."""
    if at is not None:
        return AtTime(quantity, at) if quantity.has_rate else AtEnd(quantity, until=at)
    if when == "end":
        return AtEnd(quantity, until=until)
    if when == "mean":
        return Mean(quantity, after=after, until=until)
    return Extreme(quantity, largest=when == "largest", after=after, until=until)
