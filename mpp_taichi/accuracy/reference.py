"""Reference: a run so fine that a finer one no longer differs, with the difference as its error bar.

The available method of the highest order runs in f64 with N, 2N, 4N … steps. Let d be the difference of the final positions
of two successive runs, and r the ratio of the last two d. If errors fall by r at each halving, the error of the finer run of
a pair is d / (r − 1): less than d where r ≥ 2. The error bar is d, and more where r is smaller; where d no longer falls,
because of round-off, the bar is the larger of the last two d.

The bar is trusted only where d was seen to fall, or is at the level of round-off: a single pair of runs proves nothing.
"""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mpp_taichi.accuracy.budget import Budget
from mpp_taichi.accuracy.contact_methods import exact_solvers
from mpp_taichi.accuracy.problem import Problem
from mpp_taichi.accuracy.sample import MeasuredError, Sample
from mpp_taichi.accuracy.workbench import Machine, Trace

ROUND_OFF = 1e-13  # of the size of the system: smaller differences are close to rounding
FALLING = 2.0  # the least ratio of differences at a halved step that shows convergence
FLOOR = 1e-9  # differences that stop falling below this value do so by rounding, above it for another reason
MEANING = 1e-3  # of the size of the system: an error above which positions have no meaning


@dataclass(eq=False)
class ReferenceSolution:
    """Final positions from which the errors of other runs are measured.

    size         of the system: root mean square distance of the moving particles from their mean, over the run [length]
    bar          largest error over particles at the end, relative to size; bar_rms the root mean square error
    trusted      whether convergence has confirmed the bar
    differences  of each pair of runs, relative to size, coarse to fine
    meaning      time until which the pair differs by less than MEANING [time]; None if it does to the end
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
    """Largest and root mean square distance of particles, relative to `size`."""
    apart = np.linalg.norm(one - other, axis=-1) / size
    return float(apart.max()), float(np.sqrt(np.mean(apart**2)))


def size_of(trace: Trace) -> float:
    """Root mean square distance of the particles from their mean position, over all of them and the run [length]."""
    return float(np.sqrt(np.mean(np.sum((trace.position - trace.position.mean(axis=(0, 1))) ** 2, axis=-1))))


def lost_at(coarse: Trace, fine: Trace, size: float) -> float | None:
    """Time until which two runs differ by less than MEANING of the size; None if they do to the end."""
    every = (len(fine.times) - 1) // (len(coarse.times) - 1)  # a run of few steps has fewer samples
    apart = np.linalg.norm(coarse.position - fine.position[::every], axis=-1).max(axis=1) / size
    lost = np.flatnonzero(~(apart < MEANING))
    return float(coarse.times[max(0, lost[0] - 1)]) if len(lost) else None


class Convergence:
    """Runs with repeatedly halved steps: `add` each run, until the differences are small: `is_enough`."""

    def __init__(self, problem: Problem, order: int) -> None:
        """Begin without a run."""
        self.problem, self.order = problem, order
        self.runs: list[tuple[Sample, Trace]] = []
        self.differences: list[tuple[float, float]] = []
        self.size = 0.0

    def add(self, sample: Sample, trace: Trace) -> None:
        """Add the next run, of twice the steps."""
        self.size = size_of(trace) or 1.0
        if self.runs:
            before, now = self.runs[-1][0].end, sample.end
            assert before is not None and now is not None
            self.differences.append(distance(before, now, self.size))
        self.runs.append((sample, trace))

    @property
    def is_enough(self) -> bool:
        """Whether a finer run would show nothing new: at round-off, or no longer falling although small."""
        found = [largest for largest, _ in self.differences]
        if not found:
            return False
        stalls = len(found) > 1 and found[-1] > found[-2] / FALLING and found[-2] < FLOOR
        return stalls or (found[-1] < ROUND_OFF and len(found) > 1)

    def reference(self) -> ReferenceSolution:
        """The finer run of the last pair, or of the pair before it if that pair agreed better, with its bar."""
        found = self.differences
        best = len(found) - 1
        if len(found) > 1 and found[-2][0] < found[-1][0]:
            best -= 1
        sample, trace = self.runs[best + 1] if found else self.runs[-1]
        bar = tuple(self._bar(best, part) for part in (0, 1))
        end = sample.end
        assert end is not None
        return ReferenceSolution(
            integrator=sample.configuration.integrator,
            order=self.order,
            steps=sample.configuration.steps,
            end=end,
            size=self.size,
            bar=bar[0],
            bar_rms=bar[1],
            trusted=self._is_trusted(best),
            differences=[largest for largest, _ in found],
            meaning=self._meaning(),
        )

    def _bar(self, best: int, part: int) -> float:
        if not self.differences:
            return float("inf")
        found = [pair[part] for pair in self.differences]
        neighbors = found[max(0, best - 1) : best + 2]
        here = max(found[best], np.finfo(float).eps)
        if best < len(found) - 1:  # the next pair did not agree better: round-off
            return max(here, found[best + 1])
        if len(neighbors) < 2 or neighbors[0] >= FALLING * here:
            return here
        ratio = neighbors[0] / here
        return max(max(neighbors), here / max(ratio - 1.0, 0.1))

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


def converge(machine: Machine, start: int, budget: Budget, *, share: float, add: Any) -> Convergence:
    """Run with `start` steps, then twice as many and so on, until they converge or the share of the budget is spent.

    `add` is called with each sample. A first step that is unstable is replaced by a finer one.
    """
    convergence, steps = Convergence(machine.problem, machine.order), start
    while True:
        predicted = steps * machine.seconds_per_step
        if convergence.runs and predicted > budget.left(share):
            return convergence
        budget.check()
        sample, trace = machine.run(machine.configuration(steps), budget, follow=True)
        add(sample)
        if trace is not None:
            convergence.add(sample, trace)
        if convergence.is_enough:
            return convergence
        steps *= 2
