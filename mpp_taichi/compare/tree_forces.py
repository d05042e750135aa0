"""Tree forces: whether gravity by a tree is within its accuracy of the direct sum, for the promised share of particles."""

import math

import numpy as np

from mpp_taichi.compare.course import CHANCE, Finding
from mpp_taichi.compare.numpy_reference import norm

SHARE = 0.01  # of the particles, that may be farther off than the accuracy


def exceptions(looked_at: int, count: int) -> int:
    """The number of compared particles whose error may exceed the accuracy.

    It is a hundredth where all particles are compared. In a sample the number may be larger by chance: a sample of a tree with
    exactly a hundredth of exceptions has more than the returned number with a probability below CHANCE.
    """
    if looked_at == count:
        return int(SHARE * count)
    beyond, few = 1.0, 0
    while True:
        beyond -= math.comb(looked_at, few) * SHARE**few * (1.0 - SHARE) ** (looked_at - few)
        if beyond < CHANCE or few == looked_at:
            return few
        few += 1


def finding(
    name: str, off: np.ndarray, allowed: np.ndarray, pull: np.ndarray, accuracy: float, rows: np.ndarray, count: int
) -> Finding:
    """The error of the first particle that is no exception; arrays (rows, 3): errors, errors allowed by rounding, gravity.

    The error is relative to the particle's own gravity, after the allowance for rounding.
    """
    size = norm(pull)
    error = norm(np.maximum(off - allowed, 0.0))
    share = np.divide(error, size, out=np.where(error > 0.0, math.inf, 0.0), where=size > 0.0)
    share = np.where(np.isfinite(off).all(axis=1), share, math.inf)
    few = exceptions(len(rows), count)
    row = int(np.argsort(-share, kind="stable")[min(few, len(rows) - 1)])
    sampled = f"{len(rows):,} of {count:,} particles" if len(rows) < count else f"all {count:,} particles"
    looked_at = f"{sampled}, without the {few:,} farthest off" if few else sampled
    return Finding(
        name, float(share[row]) / accuracy, float(share[row]), accuracy, "its own gravity", int(rows[row]), looked_at
    )
