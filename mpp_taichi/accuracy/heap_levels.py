"""Heap levels: the mean of a quantity where every step and every start gives another heap.

A heap of spheres is one of many in which they may come to rest, and which of them it becomes is decided by differences as small
as the error of any step that can be paid for. The mean over starts that differ a little is the same for every fine step, and
this mean is compared. It is estimated from the POOLED finest numbers of steps together, with RUNS runs each:

    mean  m = Σ m_k / 3,    bar = t s / √(3 · RUNS) + (max m_k − min m_k),

with m_k the mean of level k, s² the mean of the variances within the levels, and t of Student's distribution. The second part
is the error that the steps themselves leave in the mean: of an error of first order, c, c/2 and c/4 in the three levels, it is
3/4 c, and the mean of the three has 7/12 c.
"""

import math

import numpy as np

RUNS = 6  # of a quantity that scatters
POOLED = 3  # levels that give the mean
LEAST = 4  # levels, before means that agree end the search: the coarsest is no part of the mean
STUDENT_POOLED = 2.13  # of 3 · (6 − 1) degrees: a mean exceeds so many standard errors in one of twenty cases
STUDENT_PAIR = 2.23  # of 10 degrees: the same for the difference of two levels of six runs


class HeapLevels:
    """The levels so far, coarse to fine: `add` the values of each, (run_count, entry_count) in the unit of the quantity."""

    def __init__(self) -> None:
        """Begin without a level."""
        self.levels: list[np.ndarray] = []

    def add(self, values: np.ndarray) -> None:
        """Add the runs of a finer level."""
        self.levels.append(values)

    @property
    def is_pooled(self) -> bool:
        """Whether there are levels enough for a mean."""
        return len(self.levels) >= POOLED

    @property
    def means(self) -> np.ndarray:
        """The mean of each of the pooled levels, (POOLED, entry_count)."""
        return np.array([values.mean(axis=0) for values in self.levels[-POOLED:]])

    @property
    def mean(self) -> np.ndarray:
        """m, of each entry."""
        found: np.ndarray = self.means.mean(axis=0)
        return found

    @property
    def scatter(self) -> np.ndarray:
        """s, the standard deviation of a single run about the mean of its level, of each entry."""
        found: np.ndarray = np.sqrt(np.mean([values.var(axis=0, ddof=1) for values in self.levels[-POOLED:]], axis=0))
        return found

    @property
    def bars(self) -> np.ndarray:
        """The bar of m, of each entry."""
        runs = sum(len(values) for values in self.levels[-POOLED:])
        means = self.means
        found: np.ndarray = STUDENT_POOLED * self.scatter / math.sqrt(runs) + means.max(axis=0) - means.min(axis=0)
        return found

    @property
    def agree(self) -> bool:
        """Whether the means of neighbouring pooled levels differ by no more than the scatter of the runs allows."""
        if len(self.levels) < LEAST:
            return False
        allowed = STUDENT_PAIR * self.scatter * math.sqrt(2.0 / len(self.levels[-1]))
        return bool(np.all(np.abs(np.diff(self.means, axis=0)) <= allowed))


def is_lottery(differences: list[float], falling: float, least: float) -> bool:
    """Whether halved steps give other values without an end.

    The difference of the two finest levels, over the value, is above `least`, and over two halvings it has fallen by less than
    the factor `falling`, by which an error of first order falls in one.
    """
    return len(differences) > 2 and differences[-1] > least and falling * differences[-1] > differences[-3]
