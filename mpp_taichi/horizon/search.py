"""Search: the horizon of a run, by companions with coarser and finer steps that are followed before the run begins.

The differences of the run from the two companions, d_coarse and d_fine, grow as its error e does. With e ∝ R⁻ᵏ for steps that
are finer by the factor k, R = d_coarse / d_fine and e = d_fine R / (R − 1); R is 2^order where the steps decide. Where rounding
decides, the difference of two runs does not depend on the step, R ≈ 1 or less, and the rounding errors of two runs add as
squares, e = d_fine / √3: the fine companion has twice as many.
"""

import math
import time as clock
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from mpp_taichi.horizon.budget import LEAST_WORK, SHARE, Budget, budget_of
from mpp_taichi.horizon.companion import HAIR, Companion
from mpp_taichi.horizon.growth import LEAST_POINTS, LEAST_TURNS, first_crossing, law, turns
from mpp_taichi.horizon.horizon import LIMIT, Horizon
from mpp_taichi.scene.contacts import merges
from mpp_taichi.simulation.course import phase_at

if TYPE_CHECKING:
    from mpp_taichi.simulation.simulation import Simulation

SAMPLES = 48
FINE_PART = 0.25  # of the followed part, where this is not the whole run
BY_STEP = 1.3  # the least ratio R of differences of which the step is the cause: a method of first order has 2
SEEN = 1e-2  # of the size: up to this error differences grow as small errors do
PROBES = 128  # parts of the run, in the first of which the evaluations of an adaptive method are counted
COARSE, FINE = 2.0, 0.5
SURE = 0.5  # of LIMIT: a coarser run that stays below it shows that the run itself does
OVER = 4.0  # times LIMIT: a companion that differs so much is not followed farther


def find(simulation: "Simulation", until: float, share: float = SHARE, *, least: float = LEAST_WORK) -> Horizon:
    """The horizon of a run from the present start to the time `until`; the simulation is at its start before and after.

    The search takes `share` of the work of the run, or `least` where this is more.
    """
    reason = _refusal(simulation)
    if reason:
        return Horizon("unknown", until, reason=reason)
    launches, began = simulation.timings.launch_count, clock.perf_counter()
    simulation.try_steps(1)  # compiles the kernels, which the run needs as well
    simulation.restart()
    simulation.timings.compile_seconds += clock.perf_counter() - began
    try:
        return _Search(simulation, until, share, least).result()
    finally:
        simulation.timings.launch_count = launches


def _refusal(simulation: "Simulation") -> str:
    """Why companions would show nothing, or nothing right; empty where they can be followed."""
    for phase in simulation.phases:
        if merges(phase.spec):
            return "spheres merge"
        if phase.spec.contacts is not None:
            return "a collision of spheres enlarges an error by a factor that differs from collision to collision"
    if simulation.total_force.by_tree:
        return "gravity by a tree has an error of its own, which does not depend on the step"
    if not simulation.start.free.any():
        return "no particle moves"
    return ""


class _Search:
    """The search in one simulation."""

    def __init__(self, simulation: "Simulation", until: float, share: float, least: float) -> None:
        self.simulation, self.until, self.begin = simulation, until, simulation.time
        self.span = until - self.begin
        self.adaptive = bool(simulation.integrator.controlled_by)
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
        """Follow the companions as far as the budget allows, and judge their differences from the run."""
        whole = self.budget.follows_all
        self.part = 1.0 if whole else self.budget.part(FINE_PART)
        times = self._times()
        if len(times) < LEAST_POINTS:
            return self._unknown(f"{self.part:.1%} of the run, all that the search may follow, are too few steps")
        own = np.array(list(self._follow(1.0, times)))
        if len(own) < len(times):
            return self._unknown("the run breaks off before its end")
        size = float(np.sqrt(np.mean(np.sum((own - own.mean(axis=(0, 1))) ** 2, axis=-1)))) or 1.0
        coarse = self._differences(COARSE, times, own, size)
        if self.part >= 1.0 and len(coarse) == len(times) and coarse.max() < SURE * LIMIT:
            return Horizon("after_end", self.until, error=float(coarse.max()), part=1.0, share=self._share)
        kept = len(times) if whole else max(LEAST_POINTS, int(FINE_PART * len(times)))
        fine = self._differences(FINE, times[:kept], own, size)
        return self._judged(times - self.begin, own, coarse, fine)

    def _judged(self, times: np.ndarray, own: np.ndarray, coarse: np.ndarray, fine: np.ndarray) -> Horizon:
        """The horizon that the differences of both companions tell; `times` since the start."""
        ratio = _ratio(coarse, fine)
        by = None if ratio is None else "step" if ratio > BY_STEP else "rounding"
        errors = _errors(coarse, fine, by, ratio or 2.0 ** max(1, self.simulation.integrator.order))
        known: dict[str, Any] = {"by": by, "part": self.part, "share": self._share}
        crossing = first_crossing(times[: len(errors)], errors, LIMIT)
        if crossing is not None:
            return Horizon("before_end", self.until, self.begin + crossing, error=LIMIT, **known)
        if len(errors) < len(times):
            return self._unknown("a run with other steps breaks off")
        if self.part >= 1.0:
            largest = float(errors.max())
            time = self.until if largest > SURE * LIMIT else None
            return Horizon("before_end" if time else "after_end", self.until, time, error=largest, **known)
        seen = turns(own)
        growth = law(times, errors)
        if seen < LEAST_TURNS or growth is None:
            return self._unknown(
                f"the motion turns {seen:.1g} times in the first {self.part:.2g} of the run, all that the search may follow, "
                "too few to tell growth of the error from the motion"
            )
        reached = self.begin + growth.time_of(LIMIT)
        if reached < self.until:
            return Horizon("extrapolated", self.until, reached, error=LIMIT, **known)
        return self._unknown(
            f"in the first {self.part:.2g} of the run, all that the search may follow, the error reaches {growth.last:.1g} of the "
            f"system's size; if it goes on so, it is {growth.at(self.span):.1g} at the end"
        )

    def _times(self) -> np.ndarray:
        """Times at which positions are compared: after even numbers of steps of each phase, and at the end of each phase."""
        simulation, last = self.simulation, self.begin + self.part * self.span
        if self.adaptive:
            return np.linspace(self.begin, last, SAMPLES + 1)[1:]
        begins = [self.begin, *(phase.at for phase in simulation.phases if self.begin < phase.at < last)]
        found: list[float] = []
        for number, began in enumerate(begins):
            end = begins[number + 1] if number + 1 < len(begins) else last
            dt = simulation.dt if number == 0 else simulation.phases[phase_at(simulation.phases, began)].dt
            pairs = int((end - began) / (2.0 * dt) + HAIR)
            count = min(pairs, max(2, round(SAMPLES * (end - began) / (last - self.begin))))
            found += [began + 2.0 * dt * round(pairs * k / count) for k in range(1, count + 1)]
        return np.array(found)

    def _follow(self, coarseness: float, times: np.ndarray) -> Iterator[np.ndarray]:
        """Positions along the run or a companion; its cost is booked when it ends."""
        companion, reached = Companion(self.simulation, coarseness), self.begin
        walk = companion.positions([float(time) for time in times])
        try:
            for place, reached in zip(walk, times):
                yield place
        finally:
            walk.close()
            self.spent += companion.evaluations if self.adaptive else self._part_of(reached) / coarseness
    
    def _part_of(self, reached: float) -> float:
        return (reached - self.begin) / self.span * self.budget.run / self.budget.step

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


def _ratio(coarse: np.ndarray, fine: np.ndarray) -> float | None:
    """R = d_coarse / d_fine, the median over the later half of the samples at which both are small; None without such samples."""
    both = min(len(coarse), len(fine))
    one, other = coarse[:both], fine[:both]
    small = (one < SEEN) & (other < SEEN) & (one > 0.0) & (other > 0.0)
    found = one[small] / other[small]
    return float(np.median(found[len(found) // 2 :])) if len(found) else None


def _errors(coarse: np.ndarray, fine: np.ndarray, by: str | None, ratio: float) -> np.ndarray:
    """Estimate of the error of the run: from the fine companion, and beyond its end from the coarse one."""
    if by == "rounding":
        return np.concatenate([fine / math.sqrt(3.0), coarse[len(fine) :] / math.sqrt(1.5)])
    return np.concatenate([fine * ratio / (ratio - 1.0), coarse[len(fine) :] / (ratio - 1.0)])
