"""Search: the horizon of a run, by reruns with coarser and finer steps that are followed before the run begins.

The run and its coarse rerun are followed, first through an early part, then as far as the budget allows. Where they stay
together, a shorter step would show nothing more. Where they part, the fine rerun tells the error (see cause). Where the
whole run is more than the budget allows, the growth of the error in the part that was followed is extrapolated.
"""

import time as clock
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from mpp_taichi.errors import MppError
from mpp_taichi.horizon.cause import Cause, cause_of
from mpp_taichi.horizon.contact_search import ContactSearch, size_of
from mpp_taichi.horizon.growth import LEAST_POINTS, LEAST_TURNS, beyond, first_crossing, law, strides, turns
from mpp_taichi.horizon.horizon import LIMIT, Horizon
from mpp_taichi.horizon.refusal import refusal
from mpp_taichi.horizon.rerun import HAIR
from mpp_taichi.horizon.samples import Walk, sample_times
from mpp_taichi.horizon.work_budget import FINE_PART, LEAST_WORK, SHARE, WorkBudget, budget_of

if TYPE_CHECKING:
    from mpp_taichi.simulation.simulation import Simulation

STAGES = {1.0 / 16.0: 24, 1.0: 48}  # parts of the part of the run that may be followed, and samples in each
PROBES = 128  # parts of the run, in the first of which the evaluations of an adaptive method are counted
COARSE, FINE = 2.0, 0.5
SURE = 0.5  # of LIMIT: a coarser run that stays below it shows that the run itself does
LONG_STRIDE = 0.3  # of the size, between two samples: from here on the error between two samples may be larger than at both
FINELY = 256  # samples up to a crossing that the first samples have told late
OVER = 4.0  # times LIMIT: a rerun that differs so much is not followed farther


def nothing() -> None:
    """Look at nothing."""


def compile_step(simulation: "Simulation") -> None:
    """Compile the step, which the run needs as well, before a search whose time is measured."""
    launches, began = simulation.timings.launch_count, clock.perf_counter()
    simulation.try_steps(1)
    simulation.phase.launcher.clear_trouble()
    simulation.restart()
    simulation.timings.launch_count = launches
    simulation.timings.compile_seconds += clock.perf_counter() - began


def find(
    simulation: "Simulation",
    until: float,
    share: float = SHARE,
    *,
    least: float = LEAST_WORK,
    look: Callable[[], None] = nothing,
) -> Horizon:
    """The horizon of a run from the present start to the time `until`; the simulation is at its start before and after.

    The search takes `share` of the work of the run, or `least` where this is more. `look` is called between two samples, and
    may raise; the simulation is at its start then, too.
    """
    if reason := refusal(simulation):
        return Horizon("unknown", until, reason=reason)
    launches = simulation.timings.launch_count
    try:
        touches = any(phase.spec.contacts is not None for phase in simulation.phases)
        search = ContactSearch if touches else _Search
        return search(simulation, until, share, least, look).result()
    except MppError as error:
        return Horizon("unknown", until, reason=str(error).splitlines()[0])
    finally:
        simulation.timings.launch_count = launches


class _Search:
    """The search in one simulation; times are those of the simulation, and differences lengths."""

    def __init__(self, simulation: "Simulation", until: float, share: float, least: float, look: Callable[[], None]) -> None:
        self.simulation, self.until, self.begin = simulation, until, simulation.time
        self.span, self.look = until - self.begin, look
        self.adaptive = bool(simulation.integrator.controlled_by)
        self.spent = 0.0  # steps of the run, or evaluations where the method chooses its steps
        self.budget: WorkBudget = budget_of(simulation, self._steps(), share, least)
        self.part = self.budget.part

    def _steps(self) -> float:
        """Steps of the run; of a method that chooses its steps the evaluations, as counted in its first part."""
        if not self.adaptive:
            return max(1.0, self.span / self.simulation.dt)
        probe = Walk(self.simulation, 1.0, np.array([self.begin + self.span / PROBES]), self.look)
        probe.positions()
        self.spent += probe.evaluations
        return PROBES * max(1.0, float(probe.evaluations))

    def result(self) -> Horizon:
        """Follow an early part, then all of the part that the budget allows, until the error reaches LIMIT."""
        early: tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray] | None = None
        for stage, samples in STAGES.items():
            times = sample_times(self.simulation, self.begin + stage * self.part * self.span, samples)
            if len(times) < LEAST_POINTS:
                continue
            own = self._own_path(times)
            if len(own) < len(times):
                return self._unknown("the run breaks off before its end")
            last = stage == 1.0 or self._is_all(stage)
            size = size_of(own)
            if early is not None and (told := self._crossing(*early, size)):
                return told
            coarse = self._differences(COARSE, times, own, size)
            parted = len(coarse) < len(times) or not coarse[-1] < OVER * LIMIT * size
            if not parted and not last:
                continue
            if not parted and self.part >= 1.0 and coarse.max() < SURE * LIMIT * size:
                error = float(coarse.max()) / size
                return Horizon("after_end", self.until, error=error, part=1.0, share=self._share)
            kept = int(np.searchsorted(self._steps_until(times), self.budget.fine_steps(self.spent), side="right"))
            kept = max(LEAST_POINTS, kept if parted else min(kept, int(FINE_PART * len(times))))
            fine = self._differences(FINE, times[:kept], own, size)
            told = self._crossing(times, own, coarse, fine, size)
            if last or (told and turns(own) >= LEAST_TURNS):
                return told or self._not_reached(times, own, coarse, fine, size)
            early = (times, own, coarse, fine)  # judged again when the size of the system in the whole run is known
        whole = "the run" if self.part >= 1.0 else f"the first {self.part:.2g} of the run, all that the search may follow,"
        return self._unknown(f"{whole} has too few steps")

    def _crossing(
        self, times: np.ndarray, own: np.ndarray, coarse: np.ndarray, fine: np.ndarray, size: float
    ) -> Horizon | None:
        """The horizon where the error reaches LIMIT at one of the times; None where it does not."""
        cause, errors = self._errors(times, coarse / size, fine / size)
        crossing = first_crossing(times[: len(errors)] - self.begin, errors, LIMIT)
        if crossing is None:
            return None
        if strides(own[: len(errors)]) > LONG_STRIDE * size:
            crossing = min(crossing, self._sharpened(times, coarse, fine, errors, size))
        return Horizon("before_end", self.until, self.begin + crossing, error=LIMIT, **self._known(cause))

    def _sharpened(self, times: np.ndarray, coarse: np.ndarray, fine: np.ndarray, errors: np.ndarray, size: float) -> float:
        """The time of the crossing, looked for with more samples, as the error may be large only near a pericentre."""
        k = int(np.flatnonzero(~(errors < LIMIT * (1.0 - HAIR)))[0])
        nearer = sample_times(self.simulation, float(times[k]), FINELY)
        own = self._own_path(nearer)
        affordable = self.budget.fine_steps(self.spent) >= self._steps_until(times)[k]
        coarseness, before = (FINE, fine) if affordable else (COARSE, coarse)
        j = min(k, len(before) - 1)
        if not before[j] > 0.0:
            return float("inf")
        scale = errors[j] * size / before[j]
        found = scale / size * self._differences(coarseness, nearer, own, size, over=max(OVER, OVER / scale))
        crossing = first_crossing(nearer[: len(found)] - self.begin, found, LIMIT)
        return float("inf") if crossing is None else crossing

    def _not_reached(self, times: np.ndarray, own: np.ndarray, coarse: np.ndarray, fine: np.ndarray, size: float) -> Horizon:
        """The answer where the error stays below LIMIT in the part that was followed."""
        cause, errors = self._errors(times, coarse / size, fine / size)
        count = len(errors)
        if count < len(times):
            self.part = float(times[max(0, count - 1)] - self.begin) / self.span
        if self.part >= 1.0:
            largest = float(errors.max())
            time = self.until if largest > SURE * LIMIT else None
            return Horizon("before_end" if time else "after_end", self.until, time, error=largest, **self._known(cause))
        seen, growth = turns(own[:count]), law(times[:count] - self.begin, errors)
        if seen < LEAST_TURNS or growth is None:
            return self._unknown(
                f"the motion turns {seen:.1g} times in the first {self.part:.2g} of the run, all that the search may follow, "
                "too few to tell growth of the error from the motion"
            )
        followed = f"the first {self.part:.2g} of the run, all that the search may follow,"
        reached, reason = beyond(growth, self.begin, self.until, LIMIT, followed)
        if reached is None:
            return self._unknown(reason)
        return Horizon("extrapolated", self.until, reached, error=LIMIT, **self._known(cause))

    def _errors(self, times: np.ndarray, coarse: np.ndarray, fine: np.ndarray) -> tuple[Cause, np.ndarray]:
        """The cause of the error, and the error at the first of the times [of the size]."""
        simulation = self.simulation
        cause = cause_of(coarse, fine, self._steps_until(times), simulation.device.precision, simulation.integrator)
        return cause, cause.errors(coarse, fine)

    def _own_path(self, times: np.ndarray) -> np.ndarray:
        """The run itself, (samples, followed, 3); of an adaptive method the budget is known better afterwards."""
        walk = Walk(self.simulation, 1.0, times, self.look)
        path = walk.positions()
        self._book(walk, 1.0)
        if self.adaptive:
            self.budget = self.budget.with_steps(max(1, walk.evaluations) * self.span / (times[-1] - self.begin))
        return path

    def _is_all(self, stage: float) -> bool:
        """Whether an adaptive method has already spent its budget in the early part; else the part that it allows is set."""
        if not self.adaptive:
            return False
        followed = stage * self.part
        self.part = max(followed, self.budget.part)
        return self.part == followed

    def _differences(
        self, coarseness: float, times: np.ndarray, own: np.ndarray, size: float, over: float = OVER
    ) -> np.ndarray:
        walk = Walk(self.simulation, coarseness, times, self.look)
        found = walk.differences(own, over * LIMIT * size)
        self._book(walk, coarseness)
        return found

    def _book(self, walk: Walk, coarseness: float) -> None:
        """Add the cost of a walk that has ended."""
        steps = (walk.reached - self.begin) / self.span * self.budget.steps / coarseness
        self.spent += walk.evaluations if self.adaptive else steps

    def _steps_until(self, times: np.ndarray) -> np.ndarray:
        """Steps of the run, or evaluations of an adaptive method, until each time."""
        return (times - self.begin) / self.span * self.budget.steps

    def _known(self, cause: Cause) -> dict[str, Any]:
        return {"by": cause.by, "part": self.part, "share": self._share}

    @property
    def _share(self) -> float:
        return self.spent / self.budget.steps

    def _unknown(self, reason: str) -> Horizon:
        return Horizon("unknown", self.until, part=self.part, share=self._share, reason=reason)
