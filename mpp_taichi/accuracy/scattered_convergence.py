"""Convergence with scatter: the error of a method whose error depends on where in a step a contact happens.

Halved steps keep the ends of the steps where they were, so that the difference of two runs may nearly vanish by chance while
both have the same error. Here the steps grow by about 1.4, to odd multiples of LOOKS, and contacts fall anywhere within the
steps of each run. The finest run is the reference. Its error bar is the largest of its differences from the three runs
before it, which have up to 2.8 times its steps' length: the differences hold the errors of the coarser runs, so that the bar is
some times the error of the reference itself.
"""

import math

import numpy as np

from mpp_taichi.accuracy.reference import MEANING, ReferenceSolution, distance, lost_at, size_of
from mpp_taichi.accuracy.sample import Sample
from mpp_taichi.accuracy.stretches import LOOKS
from mpp_taichi.accuracy.trace import Trace

COMPARED = 3  # runs before the finest
GROWTH = 1.4


class ScatteredConvergence:
    """Runs with ever shorter steps: `add` each run, until the error bar is small: `is_enough`.

    enough      an error bar below which no finer run is wanted
    next_steps  steps of the next run
    """

    def __init__(self, order: int, steps: int, *, enough: float = 0.0) -> None:
        """Begin without a run."""
        self.order, self.enough = order, enough
        self.next_steps = LOOKS * (math.ceil(steps / LOOKS) | 1)
        self.runs: list[tuple[Sample, Trace]] = []
        self.size = 0.0

    def add(self, sample: Sample, trace: Trace) -> None:
        """Add the next run."""
        self.size = size_of(trace) or 1.0
        self.runs.append((sample, trace))

    def refine(self) -> None:
        """Go on with shorter steps."""
        self.next_steps = LOOKS * (math.ceil(GROWTH * self.next_steps / LOOKS) | 1)

    @property
    def is_enough(self) -> bool:
        """Whether the error bar is small enough."""
        return self.is_trusted and self.reference().bar <= self.enough

    @property
    def is_trusted(self) -> bool:
        """Whether the runs so far give positions that can be compared."""
        return len(self.runs) > COMPARED and self.reference().bar < MEANING

    def reference(self) -> ReferenceSolution:
        """The finest run with its bar."""
        sample, trace = self.runs[-1]
        before = self.runs[-1 - COMPARED : -1]
        assert sample.end is not None
        found = [distance(run.end, sample.end, self.size) for run, _ in before if run.end is not None]
        bar, bar_rms = (max((pair[part] for pair in found), default=math.inf) for part in (0, 1))
        lost = [time for _, path in before if (time := lost_at(path, trace, self.size)) is not None]
        whole = len(before) == COMPARED
        return ReferenceSolution(
            integrator=sample.configuration.integrator,
            order=self.order,
            steps=sample.configuration.steps,
            end=sample.end,
            size=self.size,
            bar=max(bar, np.finfo(float).eps) if whole else math.inf,
            bar_rms=max(bar_rms, np.finfo(float).eps) if whole else math.inf,
            trusted=whole and bar < MEANING,
            differences=[pair[0] for pair in found],
            meaning=min(lost, default=None),
        )
