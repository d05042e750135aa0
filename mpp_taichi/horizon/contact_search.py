"""Contact search: the horizon of a run in which spheres touch.

A contact enlarges an error by a factor of some tens, so that errors grow exponentially with the contacts. The run is followed,
then a rerun with twice the step from a start that is shifted by a rounding, and, where these two part, a second rerun from the
start shifted to the other side: these differ by rounding alone, which tells rounding from the step. A fine rerun then tells
the error by the step. Event-driven flight has no step, and its rerun shows rounding. The error of a contact depends on the
place of the contact in the step, so that errors of different steps are independent of each other.
"""

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from mpp_taichi.horizon.cause import LARGEST_RATIO, SEEN, Cause
from mpp_taichi.horizon.growth import LEAST_POINTS, LEAST_TURNS, beyond, first_crossing, law, turns
from mpp_taichi.horizon.horizon import LIMIT, Horizon
from mpp_taichi.horizon.samples import Walk, sample_times
from mpp_taichi.horizon.work_budget import WorkBudget, budget_of

if TYPE_CHECKING:
    from mpp_taichi.simulation.simulation import Simulation

STAGES = {1.0 / 16.0: 24, 1.0: 48}  # parts of the part of the run that may be followed, and samples in each
PROBES = 256  # parts of the run, in the first of which contacts or evaluations are counted
COARSE, FINE = 2.0, 0.5
LEAST_MEETINGS = 5.0  # of a sphere with others and with walls, in a piece from which the growth by contacts can be told
STEEP = 10.0  # between two samples: the crossing between them is looked for with more samples
SURE = 0.5  # of LIMIT: a rerun that stays below it shows that the run itself does
OVER = 4.0  # times LIMIT: a rerun that differs so much is not followed farther
BY_STEP = 1e3  # over the difference by rounding: from here on the step makes the error
SMOOTH = 2.5  # the ratio of differences that fall with the step; errors of first order have 2 or less
SCATTERED = 1.0 / math.sqrt(1.0 + FINE**2)  # error over the fine difference, of independent errors of first order
ROUNDING_FACTOR = 1.0 / math.sqrt(2.0)  # error over difference, of two independent errors of the same size


class ContactSearch:
    """The search in one simulation; times are those of the simulation, and differences parts of the system's size."""

    def __init__(self, simulation: "Simulation", until: float, share: float, least: float, look: Callable[[], None]) -> None:
        """Bind the parts; where the work of a run is not known before, count it in the first part."""
        self.simulation, self.until, self.begin = simulation, until, simulation.time
        self.span, self.look = until - self.begin, look
        self.counts = bool(simulation.integrator.controlled_by) or not simulation.launcher.takes_steps
        self.spent = 0.0  # steps of the run, or evaluations of an adaptive method, or contacts of a flight
        self.spheres = max(1, int(simulation.start.free.any(axis=1).sum()))
        work = self._counted() if self.counts else max(1.0, self.span / simulation.dt)
        self.budget: WorkBudget = budget_of(simulation, work, share, least)
        self.part = self._allowed_part()

    def _counted(self) -> float:
        probe = Walk(self.simulation, 1.0, np.array([self.begin + self.span / PROBES]), self.look)
        probe.positions()
        self.spent += self._cost(probe, 1.0)
        return PROBES * max(1.0, self._cost(probe, 1.0))

    def _allowed_part(self) -> float:
        """Part of the run that it and a rerun can be followed; the second rerun is followed as far as the budget allows."""
        return min(1.0, self.budget.allowed / (2.0 * self.budget.run)) if self.counts else self.budget.part

    def result(self) -> Horizon:
        """Follow an early part, then all of the part that the budget allows, until the error reaches LIMIT."""
        for stage, samples in STAGES.items():
            times = sample_times(self.simulation, self.begin + stage * self.part * self.span, samples)
            if len(times) < LEAST_POINTS:
                continue
            own, meetings = self._own_path(times)
            if len(own) < len(times):
                return self._unknown("the run breaks off before its end")
            size = size_of(own)
            apart = self._differences(COARSE, times, own, size, 1.0)
            last = stage == 1.0
            if len(apart) == len(times) and not last and apart.max() < SURE * LIMIT:
                self._count_again(times)
                continue
            if last and self.part >= 1.0 and len(apart) == len(times) and apart.max() < SURE * LIMIT:
                return Horizon("after_end", self.until, error=float(apart.max()), part=1.0, share=self._share)
            by, errors = self._errors(times, own, apart, size)
            crossing = first_crossing(times[: len(errors)] - self.begin, errors, LIMIT)
            if crossing is not None:
                return self._sharpened(times, apart, errors, crossing, size, by)
            self._count_again(times)
            if last:
                return self._not_reached(times, own, errors, meetings, by)
        return self._unknown(f"{self._followed} has too few steps")

    def _own_path(self, times: np.ndarray) -> tuple[np.ndarray, float]:
        """The run itself, (samples, followed, 3), and the contacts of each sphere."""
        walk = Walk(self.simulation, 1.0, times, self.look)
        path = walk.positions()
        self._work = self._cost(walk, 1.0)
        self.spent += self._work
        return path, walk.meetings / self.spheres

    def _count_again(self, times: np.ndarray) -> None:
        """The work of the run, now that more of it was followed, and the part of it that the budget allows."""
        if not self.counts:
            return
        followed = float(times[-1] - self.begin) / self.span
        self.budget = self.budget.with_steps(max(1.0, self._work) / followed)
        self.part = max(followed, self._allowed_part())

    def _differences(self, coarseness: float, times: np.ndarray, own: np.ndarray, size: float, shift: float) -> np.ndarray:
        walk = Walk(self.simulation, coarseness, times, self.look, shift)
        found = walk.differences(own, OVER * LIMIT * size) / size
        self.spent += self._cost(walk, coarseness)
        self._rerun_path = np.array(walk.path)
        return found

    def _errors(self, times: np.ndarray, own: np.ndarray, apart: np.ndarray, size: float) -> tuple[str | None, np.ndarray]:
        """The cause of the error of the run, and the error at the first of the times."""
        if not self.simulation.launcher.takes_steps:
            return "rounding", ROUNDING_FACTOR * apart
        path = self._rerun_path
        rounded = self._differences(COARSE, self._affordable(times[: len(path)], COARSE), path, size, -1.0)
        last = min(len(apart), len(rounded)) - 1
        if not apart[last] > BY_STEP * rounded[last]:
            return "rounding", ROUNDING_FACTOR * apart
        fine = self._differences(FINE, self._affordable(times, FINE), own, size, 0.0)
        return "step", step_errors(apart, fine)

    def _affordable(self, times: np.ndarray, coarseness: float) -> np.ndarray:
        """The times that another rerun may reach."""
        left = coarseness * (self.budget.allowed / self.budget.step - self.spent) / self.budget.steps
        return times[: max(LEAST_POINTS, int(np.searchsorted((times - self.begin) / self.span, left, side="right")))]

    def _sharpened(
        self, times: np.ndarray, apart: np.ndarray, errors: np.ndarray, crossing: float, size: float, by: str | None
    ) -> Horizon:
        """The horizon, looked for again with more samples where the error rises steeply between the two around it."""
        k = int(np.flatnonzero(~(errors < LIMIT))[0])
        if k == 0 or errors[k] > STEEP * errors[k - 1]:
            nearer = sample_times(self.simulation, float(times[k]), max(STAGES.values()))
            own, _ = self._own_path(nearer)
            j = min(k, len(apart) - 1)
            found = errors[j] / apart[j] * self._differences(COARSE, nearer, own, size, 1.0)
            crossing = first_crossing(nearer[: len(found)] - self.begin, found, LIMIT) or crossing
        return Horizon("before_end", self.until, self.begin + crossing, error=LIMIT, **self._known(by))

    def _not_reached(self, times: np.ndarray, own: np.ndarray, errors: np.ndarray, meetings: float, by: str | None) -> Horizon:
        """The answer where the error stays below LIMIT in the part that was followed."""
        if self.part >= 1.0:
            largest = float(errors.max())
            return Horizon("after_end", self.until, error=largest, **self._known(by))
        growth = law(times[: len(errors)] - self.begin, errors)
        if growth is None or (meetings < LEAST_MEETINGS and (meetings > 0.0 or turns(own) < LEAST_TURNS)):
            return self._unknown(
                f"in {self._followed} each sphere has {meetings:.2g} contacts, too few to tell how contacts enlarge the error"
            )
        reached, reason = beyond(growth, self.begin, self.until, LIMIT, self._followed)
        if reached is None:
            return self._unknown(reason)
        return Horizon("extrapolated", self.until, reached, error=LIMIT, **self._known(by))

    def _cost(self, walk: Walk, coarseness: float) -> float:
        """Work of a walk that has ended: in steps of the run, or in the evaluations or contacts that it had."""
        if not self.simulation.launcher.takes_steps:
            return 0.5 * walk.meetings
        if self.counts:
            return walk.evaluations
        return (walk.reached - self.begin) / self.simulation.dt / coarseness

    @property
    def _followed(self) -> str:
        if self.part >= 1.0:
            return "the run"
        return f"the first {self.part:.2g} of the run, all that the search may follow,"

    def _known(self, by: str | None) -> dict[str, Any]:
        return {"by": by, "part": self.part, "share": self._share}

    @property
    def _share(self) -> float:
        return self.spent / self.budget.steps

    def _unknown(self, reason: str) -> Horizon:
        return Horizon("unknown", self.until, part=self.part, share=self._share, reason=reason)


def step_errors(coarse: np.ndarray, fine: np.ndarray) -> np.ndarray:
    """The error of a run by its step, from its differences from reruns with twice and half the step.

    Without contacts it is d_fine R / (R − 1) with R = d_coarse / d_fine, see `cause`; of independent errors d_fine / 1.1.
    """
    both = min(len(coarse), len(fine))
    small = (coarse[:both] < SEEN) & (fine[:both] < SEEN) & (fine[:both] > 0.0)
    ratios = coarse[:both][small] / fine[:both][small]
    ratio = min(float(np.median(ratios[len(ratios) // 2 :])), LARGEST_RATIO) if len(ratios) else 1.0
    return Cause("step", ratio / (ratio - 1.0) if ratio > SMOOTH else SCATTERED).errors(coarse, fine)


def size_of(path: np.ndarray) -> float:
    """Root mean square distance of the particles from their common mean place, over (samples, followed, 3) [length]."""
    return float(np.sqrt(np.mean(np.sum((path - path.mean(axis=(0, 1))) ** 2, axis=-1)))) or 1.0
