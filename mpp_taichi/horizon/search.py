"""Search: the horizon of a run, by companions with coarser and finer steps that are followed before the run begins.

The run and its coarse companion are followed in stages. Where they stay together, a shorter step shows nothing more. Where they
part, the fine companion tells the error (see cause). Where the whole run is more than the budget allows, its first part is
followed, and the growth of the error in it is extrapolated.
"""

import math
import time as clock
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from mpp_taichi.errors import MppError
from mpp_taichi.horizon.budget import FINE_PART, LEAST_WORK, SHARE, Budget, budget_of
from mpp_taichi.horizon.cause import Cause, cause_of
from mpp_taichi.horizon.companion import HAIR, Companion
from mpp_taichi.horizon.growth import LEAST_POINTS, LEAST_TURNS, first_crossing, law, turns
from mpp_taichi.horizon.horizon import LIMIT, Horizon
from mpp_taichi.horizon.refusal import refusal
from mpp_taichi.simulation.course import phase_at

if TYPE_CHECKING:
    from mpp_taichi.simulation.simulation import Simulation

Look = Callable[[], None]
STAGES = {1.0 / 16.0: 24, 1.0: 48}  # parts of the part of the run that may be followed, and samples in each
PROBES = 128  # parts of the run, in the first of which the evaluations of an adaptive method are counted
COARSE, FINE = 2.0, 0.5
SURE = 0.5  # of LIMIT: a coarser run that stays below it shows that the run itself does
OVER = 4.0  # times LIMIT: a companion that differs so much is not followed farther


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
    simulation: "Simulation", until: float, share: float = SHARE, *, least: float = LEAST_WORK, look: Look = nothing
) -> Horizon:
    """The horizon of a run from the present start to the time `until`; the simulation is at its start before and after.

    `look` is called between two samples, and may raise. The search takes `share` of the work of the run, or `least` where this is more.
    """
    reason = refusal(simulation)
    if reason:
        return Horizon("unknown", until, reason=reason)
    launches = simulation.timings.launch_count
    try:
        return _Search(simulation, until, share, least, look).result()
    except MppError as error:
        return Horizon("unknown", until, reason=str(error).splitlines()[0])
    finally:
        simulation.timings.launch_count = launches


def even_and_early(last: int, count: int) -> list[int]:
    """Whole numbers from 1 to `last`: `count` of equal distances, and before the first of them powers of two."""
    even = {round(last * k / count) for k in range(1, count + 1)} if count else set()
    return sorted(even | {2**k for k in range(last.bit_length()) if 2**k * count < last})


class _Search:
    """The search in one simulation."""

    def __init__(self, simulation: "Simulation", until: float, share: float, least: float, look: Look) -> None:
        self.simulation, self.until, self.begin = simulation, until, simulation.time
        self.span = until - self.begin
        self.part, self.look = 0.0, look
        self.cause: Cause | None = None
        self.adaptive = bool(simulation.integrator.controlled_by)
        self.counted = 0.0  # evaluations of the last run or companion
        self.spent = 0.0  # steps of the run, or evaluations where the method chooses its steps
        self.budget: Budget = budget_of(simulation, self._steps(), share, least)

    def _steps(self) -> float:
        """Steps of the run; of a method that chooses its steps the evaluations, as counted in its first part."""
        if not self.adaptive:
            return max(1.0, self.span / self.simulation.dt)
        probe = Companion(self.simulation, 1.0)
        list(probe.positions([self.begin + self.span / PROBES]))
        self.spent += probe.evaluations
        return PROBES * max(1.0, float(probe.evaluations))

    def result(self) -> Horizon:
        """Follow a sixty-fourth, an eighth and the whole of the part that the budget allows, until the error reaches LIMIT."""
        self.part = self.budget.part
        coarse, ends, seen_to = np.array([]), False, 0.0
        for stage, samples in STAGES.items():
            times = self._times(stage * self.part, samples)
            if len(times) < LEAST_POINTS:
                continue
            own = np.array(list(self._follow(1.0, times)))
            if len(own) < len(times):
                return self._unknown("the run breaks off before its end")
            size = float(np.sqrt(np.mean(np.sum((own - own.mean(axis=(0, 1))) ** 2, axis=-1)))) or 1.0
            last = stage == 1.0
            if self.adaptive:  # now the evaluations are known better
                self.budget = self.budget.with_steps(self.counted * self.span / (times[-1] - self.begin))
                if not last:
                    followed = stage * self.part
                    self.part = max(followed, self.budget.part)
                    last = self.part == followed
            if not ends:
                coarse = self._differences(COARSE, times, own, size)
                ends, seen_to = len(coarse) < len(times) or not coarse[-1] < OVER * LIMIT, stage
            if not ends and not last:
                continue
            if not ends and self.part >= 1.0 and coarse.max() < SURE * LIMIT:
                return Horizon("after_end", self.until, error=float(coarse.max()), part=1.0, share=self._share)
            kept = int(np.searchsorted(self._steps_until(times), self.budget.fine_steps(self.spent), side="right"))
            kept = max(LEAST_POINTS, kept if ends else min(kept, int(FINE_PART * len(times))))
            fine = self._differences(FINE, times[:kept], own, size)
            if self.cause is None:
                simulation = self.simulation
                steps, precision = self._steps_until(times), simulation.device.precision
                self.cause = cause_of(coarse, fine, steps, precision, simulation.integrator)
            errors = self.cause.errors(coarse if stage == seen_to else coarse[:0], fine)
            crossing = first_crossing(times[: len(errors)] - self.begin, errors, LIMIT)
            if crossing is not None:
                return Horizon("before_end", self.until, self.begin + crossing, error=LIMIT, **self._known())
            if last or len(errors) < len(times):
                if len(errors) < len(times):
                    self.part = float(times[max(0, len(errors) - 1)] - self.begin) / self.span
                return self._not_reached(times[: len(errors)] - self.begin, own[: len(errors)], errors)
        return self._unknown(f"{self.part:.2g} of the run, all that the search may follow, are too few steps")

    def _not_reached(self, times: np.ndarray, own: np.ndarray, errors: np.ndarray) -> Horizon:
        """The answer where the error stays below LIMIT in the part that was followed; `times` since the start."""
        if self.part >= 1.0:
            largest = float(errors.max())
            time = self.until if largest > SURE * LIMIT else None
            return Horizon("before_end" if time else "after_end", self.until, time, error=largest, **self._known())
        seen, growth = turns(own), law(times, errors)
        if seen < LEAST_TURNS or growth is None:
            return self._unknown(
                f"the motion turns {seen:.1g} times in the first {self.part:.2g} of the run, all that the search may follow, "
                "too few to tell growth of the error from the motion"
            )
        reached = self.begin + growth.time_of(LIMIT)
        if reached < self.until:
            return Horizon("extrapolated", self.until, reached, error=LIMIT, **self._known())
        return self._unknown(
            f"in the first {self.part:.2g} of the run, all that the search may follow, the error reaches {growth.last:.1g} of "
            f"the system's size; if it goes on so, it is {growth.at(self.span):.1g} at the end"
        )

    def _known(self) -> dict[str, Any]:
        return {"by": self.cause.by if self.cause else None, "part": self.part, "share": self._share}

    def _steps_until(self, times: np.ndarray) -> np.ndarray:
        """Steps of the run, or evaluations of an adaptive method, until each time."""
        return (times - self.begin) / self.span * (self.budget.run / self.budget.step)

    def _times(self, part: float, samples: int) -> np.ndarray:
        """Times in the first part of the run at which positions are compared: after even numbers of steps of each phase."""
        simulation, last = self.simulation, self.begin + part * self.span
        if self.adaptive:
            return np.linspace(self.begin, last, samples + 1)[1:]
        begins = [self.begin, *(phase.at for phase in simulation.phases if self.begin < phase.at < last)]
        found: list[float] = []
        for number, began in enumerate(begins):
            end = begins[number + 1] if number + 1 < len(begins) else last
            dt = simulation.dt if number == 0 else simulation.phases[phase_at(simulation.phases, began)].dt
            pairs = int((end - began) / (2.0 * dt) + HAIR)
            count = min(pairs, max(2, round(samples * (end - began) / (last - self.begin))))
            found += [began + 2.0 * dt * k for k in even_and_early(pairs, count)]
        return np.array(found)

    def _follow(self, coarseness: float, times: np.ndarray) -> Iterator[np.ndarray]:
        """Positions along the run or a companion; its cost is booked when it ends."""
        companion, reached = Companion(self.simulation, coarseness), self.begin
        walk = companion.positions([float(time) for time in times])
        try:
            for place, reached in zip(walk, times):
                self.look()
                yield place
        finally:
            walk.close()
            self.counted = float(companion.evaluations)
            self.spent += self.counted if self.adaptive else float(self._steps_until(reached)) / coarseness

    def _differences(self, coarseness: float, times: np.ndarray, own: np.ndarray, size: float) -> np.ndarray:
        """Largest distance of a particle from its place in the run at each time, of the size, until it is far above LIMIT."""
        found: list[float] = []
        for k, place in enumerate(self._follow(coarseness, times)):
            found.append(float(np.linalg.norm(place - own[k], axis=1).max()) / size)
            if not found[-1] < OVER * LIMIT:
                break
        return np.array(found)

    @property
    def _share(self) -> float:
        return self.spent * self.budget.step / self.budget.run

    def _unknown(self, reason: str) -> Horizon:
        return Horizon("unknown", self.until, part=self.part, share=self._share, reason=reason)
