"""Gauges: the measured quantities of members that run side by side, and the steps at which each wants its next sample.

A member is sampled at steps that follow from its own motion alone, never from its neighbours in a launch, so that its numbers
do not depend on them: at multiples of a power of two of steps, which most members share.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from mpp_taichi import component
from mpp_taichi.quantities._base import NoResultError, Quantity, Setting
from mpp_taichi.report.expectations import bound_text, diagnostic_of, hold, holds, label_of
from mpp_taichi.scene.expectations import kind_of, reduction_keys
from mpp_taichi.scene.spec import Expectation, RunSpec
from mpp_taichi.sweep.extremes import Extremes, ValuesAtTime
from mpp_taichi.sweep.member import BROKEN, OK, STOPPED, Member, MemberRow
from mpp_taichi.sweep.reductions import (
    EnergyErrors,
    LastValues,
    ManyResults,
    Means,
    NotMeasured,
    OneByOne,
)

SAMPLES = 200  # of a run at least, unless the scene says how many
CLOCK = ("end_time", "time", "steps")
"""Measures that only the end of the member tells."""


def stride_of(run: RunSpec, steps: int) -> int:
    """Steps between samples where no quantity asks for more: `run.every`, or a power of two with at least SAMPLES samples."""
    return run.every or int(below(np.array([steps / SAMPLES]))[0])


def below(numbers: np.ndarray) -> np.ndarray:
    """The largest power of two up to each number; 1 for numbers below 2."""
    return np.asarray(np.int64(1) << np.frexp(np.clip(numbers, 1.0, 2.0**40))[1] - 1)


class Gauges:
    """The measures and conditions of members with the same structure, from their starts to their ends.

    due    the step at which each member wants its next sample
    rows   the results of the members that have ended; None for the others
    """

    def __init__(self, members: Sequence[Member], stride: int, precision: str) -> None:
        """Build the quantities; nothing is measured yet."""
        self.members, self.stride, self.precision = members, stride, precision
        sweep = members[0].spec.sweep
        assert sweep is not None
        self._measures: Sequence[Expectation] = sweep.measure
        self._stops: Sequence[Expectation] = sweep.stop
        settings = [Setting(each.spec, each.start) for each in members]
        self._setting = settings[0]
        self._gauges = [_reduction(each, members, settings) for each in self._measures]
        self._guards = [_reduction(each, members, settings) for each in self._stops]
        self.due = np.zeros(len(members), np.int64)
        self.rows: list[MemberRow | None] = [None] * len(members)
        self._runs = np.ones(len(members), bool)

    @property
    def active(self) -> np.ndarray:
        """Numbers of the members that have not ended, in these arrays."""
        return np.flatnonzero(self._runs)

    def look(self, sample: Any, who: np.ndarray, step: int, dt: float) -> None:
        """Take a sample of these members at a step; those end for which a condition of `stop:` does not hold any more."""
        shortest = np.full(len(who), np.inf)
        with np.errstate(over="ignore", invalid="ignore"):  # of members that are about to diverge
            for gauge in (*self._gauges, *self._guards):
                gauge.observe(sample, who)
                shortest = np.minimum(shortest, gauge.interval[who])
        stride = np.minimum(self.stride, below(shortest / dt))
        self.due[who] = (step // stride + 1) * stride
        for condition, guard in zip(self._stops, self._guards, strict=True):
            is_time = condition.quantity in CLOCK
            values = np.full(len(self.members), sample.time) if is_time else guard.results()
            asked = who[np.isfinite(values[who]) & self._runs[who]]
            for k in asked[~hold(condition, values[asked], self.precision)].tolist():
                self.end(k, sample.time, step, status=STOPPED, reason=self._beyond(condition, values[k]))

    def end(self, k: int, time: float, step: int, *, status: str = OK, particle: int = -1, reason: str = "") -> None:
        """The member k has ended; its last sample was taken then, unless it broke down."""
        self._end([k], time, step, status, particle, reason)

    def end_all(self, time: float, step: int) -> None:
        """All members that are left have reached the end of the run, and had their last sample then."""
        self._end(self.active.tolist(), time, step, OK, -1, "")

    def _end(self, who: Sequence[int], time: float, step: int, status: str, particle: int, reason: str) -> None:
        for k in who:
            for gauge in (*self._gauges, *self._guards):
                gauge.finish(k)
        results = [gauge.results() for gauge in self._gauges]
        ends = {"steps": float(step)}
        for k in who:
            # + 0.0 makes 0.0 of −0.0: of both the larger is the one or the other, as the place in the array is.
            values = [
                ends.get(measure.quantity, time) if measure.quantity in CLOCK else float(found[k]) + 0.0
                for measure, found in zip(self._measures, results, strict=True)
            ]
            broken = self._broken_bound(values) if status == OK else ""
            told = BROKEN if broken else status
            self._runs[k] = False
            self.rows[k] = MemberRow(self.members[k].number, told, values, time, step, particle, broken or reason)

    def _broken_bound(self, values: Sequence[float]) -> str:
        """The first measure that is beyond a bound of its own, with the bound; empty where there is none."""
        for measure, value in zip(self._measures, values, strict=True):
            if _is_bounded(measure) and not (np.isfinite(value) and holds(measure, value, self.precision)):
                return self._beyond(measure, value)
        return ""

    def _beyond(self, measure: Expectation, value: float) -> str:
        """`distance(of=planet) = 3.1, not < 3`."""
        return f"{label_of(measure, self._setting)} = {value:.6g}, not {bound_text(measure, self.precision, value)}"


def _reduction(measure: Expectation, members: Sequence[Member], settings: Sequence[Setting]) -> ManyResults:
    """The reduction of a measure, in arrays where the quantity can be measured so."""
    count, name = len(members), measure.quantity
    if name in CLOCK:
        return NotMeasured(count)
    if name == "relative_energy_error_max":
        return EnergyErrors(count)
    if kind_of(name) == "quantities":
        given = dict(measure.parameters)
        keys = {key: given.pop(key, default) for key, default in reduction_keys(name).items()}
        quantity: Quantity = component.build("quantities", name, given)
        if quantity.takes_many and not quantity.remembers:
            try:
                quantity.begin(settings[0])
            except NoResultError:
                return NotMeasured(count)
            return _in_arrays(count, quantity, **keys)
    return OneByOne([diagnostic_of(measure) for _ in members], settings)


def _in_arrays(
    count: int,
    quantity: Quantity,
    *,
    when: str = "end",
    at: float | None = None,
    after: float | None = None,
    until: float | None = None,
) -> ManyResults:
    if at is not None:
        return ValuesAtTime(count, quantity, at) if quantity.has_rate else LastValues(count, quantity, until=at)
    if when == "end":
        return LastValues(count, quantity, until=until)
    if when == "mean":
        return Means(count, quantity, after=after, until=until)
    return Extremes(count, quantity, largest=when == "largest", after=after, until=until)


def _is_bounded(measure: Expectation) -> bool:
    return any(each is not None for each in (measure.below, measure.above, measure.near))
