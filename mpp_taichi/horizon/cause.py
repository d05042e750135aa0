"""Cause: whether the step or rounding makes the differences of a run from its reruns, and the error that they tell.

The differences of the run from the reruns with twice and half the step are d_coarse and d_fine. Where the error e of the
run comes from the step of a method of order p, d_coarse = (R − 1) e and d_fine = (1 − 1/R) e with R = 2^p. So R is
d_coarse / d_fine, and e = d_fine R / (R − 1). R is measured, and so right where a method has not its full order.

Rounding errors do not fall with the step. They add as squares, and their number is proportional to the steps. With variances
σ², σ²/2 and 2 σ² of the run, the coarse and the fine rerun, e = d_fine / √3 is expected, d_coarse / d_fine is 0.7, and the
best linear estimate from both is e = (4 d_coarse + d_fine) / 7. Where the coarse rerun is off by its step, the ratio lies
between 0.7 and 2^p, and d_fine alone tells the error. A run may have two or three times less rounding error than expected.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

SEEN = 1e-2  # of the size: up to this error differences grow as small errors do
LEAST_RATIO = 1.3  # R by a step; a method of first order has 2
FULL_SHARE = 0.25  # of 2^p: from here on R is by the step alone
ADAPTIVE_RATIO = 2.5  # the same of tolerances that differ by factors of 4
LARGEST_RATIO = 1e6
COARSE_WEIGHT, FINE_WEIGHT = 4.0 / 7.0, 1.0 / 7.0  # of two differences by rounding
PLENTY = 30.0  # roundings for the square root of the number of steps: an early difference above them is by the step
ROUND_OFF = {"f64": 2.0**-53, "df64": 2.0**-47}
SINGLE = 2.0**-24  # of all other precisions, whose forces are computed in f32


@dataclass(frozen=True)
class Cause:
    """The cause of the error, "step" or "rounding", or None where no differences were seen, and the error over d_fine."""

    by: str | None
    factor: float
    uses_coarse: bool = False

    def errors(self, coarse: np.ndarray, fine: np.ndarray) -> np.ndarray:
        """The error of the run at the samples of the fine rerun, and from its end on in proportion to the coarse one."""
        both = min(len(coarse), len(fine))
        found = self.factor * fine
        if self.uses_coarse:
            found[:both] = COARSE_WEIGHT * coarse[:both] + FINE_WEIGHT * fine[:both]
        if len(coarse) <= len(fine):
            return found
        before = coarse[len(fine) - 1]
        return np.concatenate([found, coarse[len(fine) :] * (found[-1] / before if before > 0.0 else 1.0)])


def cause_of(coarse: np.ndarray, fine: np.ndarray, steps: np.ndarray, precision: str, integrator: Any) -> Cause:
    """The cause that the differences at samples after so many steps of the run show."""
    both = min(len(coarse), len(fine))
    small = (coarse[:both] < SEEN) & (fine[:both] < SEEN) & (coarse[:both] > 0.0) & (fine[:both] > 0.0)
    full = 2.0 ** max(1, integrator.order)
    found = coarse[:both][small] / fine[:both][small]
    if not len(found):
        return Cause(None, full / (full - 1.0))
    ratio = float(np.median(found[len(found) // 2 :]))
    early = int(np.flatnonzero(small)[0])
    rounded = fine[early] < PLENTY * ROUND_OFF.get(precision, SINGLE) * math.sqrt(max(1.0, steps[early]))
    surely = ADAPTIVE_RATIO if integrator.controlled_by else FULL_SHARE * full
    by_step = ratio > LEAST_RATIO and (not rounded or ratio > surely)
    if not by_step:
        return Cause("rounding", 1.0 / math.sqrt(3.0), uses_coarse=ratio < LEAST_RATIO)
    ratio = min(ratio, LARGEST_RATIO)
    return Cause("step", ratio / (ratio - 1.0))
