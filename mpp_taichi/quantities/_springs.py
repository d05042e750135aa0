"""The springs that a quantity of springs is about, and their lengths."""

import numpy as np

from mpp_taichi.component import Pair
from mpp_taichi.quantities._base import NoResultError, RunSample, Setting


def chosen_springs(between: Pair | None, setting: Setting) -> np.ndarray:
    """Indices of the spring between two particles, or of all springs.

    Raises:
        NoResultError: there is no such spring.
    """
    ends = setting.start.springs.between
    if between is None:
        found = np.arange(len(ends))
    else:
        found = np.flatnonzero((np.sort(ends, axis=1) == sorted(between)).all(axis=1))
    if len(found) == 0:
        names = "" if between is None else f" between {setting.name_of(between[0])} and {setting.name_of(between[1])}"
        raise NoResultError(f"there is no spring{names}")
    return found


def whole_springs(sample: RunSample, springs: np.ndarray) -> np.ndarray:
    """Those of the springs that have not broken.

    Raises:
        NoResultError: all of them have broken.
    """
    left = springs[sample.snapshot.springs.whole[springs]]
    if len(left) == 0:
        last = sample.snapshot.springs.chosen(springs).breaking_times.max()
        raise NoResultError(f"the last of {len(springs):,} springs broke at time {last:.6g}")
    return left


def lengths(sample: RunSample, springs: np.ndarray) -> np.ndarray:
    """Distances of the ends, (n,)."""
    first, second = sample.snapshot.springs.between[springs].T
    return np.linalg.norm(sample.snapshot.position[second] - sample.snapshot.position[first], axis=1)


def label_of(noun: str, between: Pair | None, setting: Setting) -> str:
    """`length of spring pivot–upper`, or `mean length of springs`."""
    if between is None:
        return f"mean {noun} of springs"
    return f"{noun} of spring {setting.name_of(between[0])}–{setting.name_of(between[1])}"
