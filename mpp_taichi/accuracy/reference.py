"""Reference: a run so fine that a finer one no longer differs, with the difference as its error bar.

The available method of the highest order runs in f64 with N, 2N, 4N … steps. Let d be the difference of the final positions
of two successive runs. The finer run of the pair with the least d is the reference, since finer steps may only add rounding
errors. If errors fall by r at each halving, its error is d / (r − 1): less than d where r ≥ 2. The error bar is d, and more
where r is smaller, or much smaller than the order of the method says, since then rounding errors count, and those of two runs
may nearly cancel. The bar is at least as large as the difference of the reference from every run with finer steps.

The bar is trusted only where d was seen to fall, or is at the level of round-off: a single pair of runs proves nothing.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

import numpy as np

from mpp_taichi.accuracy.budget import Budget
from mpp_taichi.accuracy.contact_methods import exact_solvers
from mpp_taichi.accuracy.machine import Machine
from mpp_taichi.accuracy.sample import MeasuredError, Sample
from mpp_taichi.accuracy.trace import Trace

ROUND_OFF = 1e-13  # of the size of the system: smaller differences are close to rounding
FALLING = 2.0  # the least ratio of differences at a halved step that shows convergence
SUSPICIOUS = 0.25  # part of the expected fall 2^order: a difference that fell by less is probably one of rounding errors
LUCK = 4.0  # times a difference of two rounding errors, which may nearly cancel: a bar that either seldom exceeds
FLOOR = 1e-9  # differences that stop falling below this value do so by rounding, above it for another reason
MEANING = 1e-3  # of the size of the system: an error above which positions have no meaning


@dataclass(eq=False)
class ReferenceSolution:
    """Final positions from which the errors of other runs are measured.

    size         of the system: root mean square distance of the moving particles from their mean, over the run [length]
    bar          largest error over particles at the end, relative to size; bar_rms the root mean square error
    trusted      whether convergence has confirmed the bar
    differences  of each pair of runs, relative to size, coarse to fine
    meaning      time until which the runs differ by less than MEANING [time]; None if they do to the end
    by_rounding  whether the runs differ by the growth of rounding errors alone, so that no other run would agree for longer
    """

    integrator: str
    order: int
    steps: int
    end: np.ndarray
    size: float
    bar: float
    bar_rms: float
    trusted: bool
    differences: list[float] = field(default_factory=list)
    meaning: float | None = None
    by_rounding: bool = False
    control: str = ""  # of an adaptive method, as in Configuration
    tolerance: float | None = None

    def errors(self, sample: Sample) -> tuple[MeasuredError, MeasuredError]:
        """Errors of a sample's final positions, largest and root mean square over the particles, relative to the size."""
        if sample.end is None:
            return MeasuredError(None), MeasuredError(None)
        largest, rms = distance(sample.end, self.end, self.size)
        return MeasuredError.against(largest, self.bar), MeasuredError.against(rms, self.bar_rms)

    @property
    def positions_mean_something(self) -> bool:
        """Whether chaos leaves the final positions a meaning, so that they can be compared."""
        return self.trusted and self.bar < MEANING

    @property
    def horizon(self) -> float | None:
        """Time before the end at which the positions lose their meaning [time]; None where that was not found."""
        return self.meaning if self.by_rounding and not self.positions_mean_something else None

    @property
    def told(self) -> str:
        """`pefrl in f64, 12,800 steps, good to 3e-14 of the system's size`."""
        good = f"good to {self.bar:.0e} of the system's size" if self.trusted else "not shown to have converged"
        if self.integrator in exact_solvers():
            return f"event-driven flight in f64, {good if self.trusted else 'whose end round-off decides'}"
        how = f"{self.steps:,} steps" if self.tolerance is None else f"{self.control} = {self.tolerance:.2g}"
        return f"{self.integrator} in f64, {how}, {good}"

    def facts(self) -> dict[str, Any]:
        """The reference as plain data, without the positions."""
        return {key: value for key, value in vars(self).items() if key != "end"}


def distance(one: np.ndarray, other: np.ndarray, size: float) -> tuple[float, float]:
    """Largest and root mean square distance of particles, relative to `size`.

    Of spheres that merge, the distance of those that are left; infinite where other spheres have merged in the two runs.
    """
    gone = np.isnan(one[:, 0])
    if not (np.array_equal(gone, np.isnan(other[:, 0])) and np.array_equal(one[gone, 1], other[gone, 1])):
        return math.inf, math.inf
    apart = np.linalg.norm(one[~gone] - other[~gone], axis=-1) / size
    return float(apart.max()), float(np.sqrt(np.mean(apart**2)))


def size_of(trace: Trace) -> float:
    """Root mean square distance of the particles from their mean position, over all of them and the run [length]."""
    return float(np.sqrt(np.mean(np.sum((trace.position - trace.position.mean(axis=(0, 1))) ** 2, axis=-1))))


def lost_at(coarse: Trace, fine: Trace, size: float) -> float | None:
    """Time until which two runs differ by less than MEANING of the size; None if they do to the end."""
    every = (len(fine.times) - 1) // (len(coarse.times) - 1)  # a run of few steps has fewer samples
    if len(fine.times[::every]) != len(coarse.times) or not np.allclose(fine.times[::every], coarse.times):
        return None  # samples at other times cannot be compared
    apart = np.linalg.norm(coarse.position - fine.position[::every], axis=-1).max(axis=1) / size
    lost = np.flatnonzero(~(apart < MEANING))
    return float(coarse.times[max(0, lost[0] - 1)]) if len(lost) else None


class Convergence:
    """Runs with repeatedly halved steps: `add` each run, until the differences are small: `is_enough`.

    enough      an error bar below which no finer run is wanted
    next_steps  steps of the next run
    """

    def __init__(self, order: int, steps: int, *, enough: float = 0.0) -> None:
        """Begin without a run."""
        self.order, self.next_steps, self.enough = order, steps, enough
        self.runs: list[tuple[Sample, Trace]] = []
        self.differences: list[tuple[float, float]] = []
        self.size = 0.0

    def add(self, sample: Sample, trace: Trace) -> None:
        """Add the next run, of twice the steps."""
        self.size = size_of(trace) or 1.0
        if self.runs:
            self.differences.append(distance(_end(self.runs[-1]), _end((sample, trace)), self.size))
        self.runs.append((sample, trace))

    def refine(self) -> None:
        """Go on with half the step."""
        self.next_steps *= 2

    @property
    def is_enough(self) -> bool:
        """Whether finer runs would show nothing new: a bar that is small enough, or differences that no longer fall.

        Below FLOOR one difference that does not fall is enough; above it two differences that rise in turn, after differences
        so small that positions have a meaning.
        """
        found = [largest for largest, _ in self.differences]
        if len(found) < 2:
            return False
        if found[-1] < ROUND_OFF or (found[-2] < FLOOR and found[-1] > found[-2] / FALLING):
            return True
        rises = len(found) > 2 and found[-3] < found[-2] < found[-1]
        known = self.reference()
        return known.positions_mean_something and (rises or known.bar <= self.enough)

    @property
    def is_trusted(self) -> bool:
        """Whether the runs so far give positions that can be compared."""
        return bool(self.differences) and self.reference().positions_mean_something

    def reference(self) -> ReferenceSolution:
        """The finer run of the pair that agrees best, with its bar."""
        found = [largest for largest, _ in self.differences]
        best = min(range(len(found)), key=found.__getitem__, default=-1)
        sample, _ = self.runs[best + 1]
        bar = tuple(self._bar(best, part) for part in (0, 1))
        return ReferenceSolution(
            integrator=sample.configuration.integrator,
            order=self.order,
            steps=sample.configuration.steps,
            end=_end(self.runs[best + 1]),
            size=self.size,
            bar=bar[0],
            bar_rms=bar[1],
            trusted=self._is_trusted(best),
            differences=found,
            meaning=self._meaning(),
        )

    def _bar(self, best: int, part: int) -> float:
        if best < 0:
            return float("inf")
        here = max(self.differences[best][part], np.finfo(float).eps)
        end = _end(self.runs[best + 1])
        later = [distance(end, _end(run), self.size)[part] for run in self.runs[best + 2 :]]
        before = self.differences[best - 1][part] if best else math.inf
        if later:
            return max([here, *later])
        if before >= FALLING * here:  # by less than the order says where the rounding errors of both runs count as well
            return here if before >= SUSPICIOUS * 2.0**self.order * here else min(before, LUCK * here)
        return max(before, here, here / max(before / here - 1.0, 0.1))

    def _is_trusted(self, best: int) -> bool:
        found = [largest for largest, _ in self.differences]
        if len(found) < 2 or not found[best] < MEANING:
            return False
        falls = best > 0 and found[best - 1] >= FALLING * found[best]
        return falls or max(found[-2:]) < FLOOR

    def _meaning(self) -> float | None:
        """The longest time for which the runs of any pair stayed close to each other."""
        longest = 0.0
        for (_, coarse), (_, fine) in zip(self.runs, self.runs[1:]):
            lost = lost_at(coarse, fine, self.size)
            if lost is None:
                return None
            longest = max(longest, lost)
        return longest if self.differences else None


class Refinement(Protocol):
    """Runs with ever shorter steps, of which the best gives the reference."""

    runs: list[tuple[Sample, Trace]]
    next_steps: int

    @property
    def is_enough(self) -> bool:
        """Whether finer runs would show nothing new."""

    def add(self, sample: Sample, trace: Trace) -> None:
        """Add the next run."""

    def refine(self) -> None:
        """Go on with a shorter step."""

    def reference(self) -> ReferenceSolution:
        """The best run so far, with its bar."""


def converge(
    convergence: Refinement,
    machine: Machine,
    budget: Budget,
    *,
    share: float,
    add: Callable[[Sample], None],
    until: Callable[[], bool] = lambda: False,
) -> None:
    """Halve the steps until the runs converge or the share of the budget is spent, or `until` holds.

    `add` is called with each sample. A first step that is unstable is replaced by a finer one.
    """
    while not (convergence.is_enough or until()):
        if convergence.runs and convergence.next_steps * machine.budget_per_step > budget.left(share):
            return
        budget.check()
        sample, trace = machine.run(machine.configuration(convergence.next_steps), budget, follow=True)
        add(sample)
        if trace is not None:
            convergence.add(sample, trace)
        convergence.refine()


def _end(run: tuple[Sample, Trace]) -> np.ndarray:
    end = run[0].end
    assert end is not None
    return end
