"""The rows of half-springs that the kernels gather."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from mpp_taichi.snapshot import Snapshot

from .bonds import Bond
from .formula import bits
from .program import Memory

DAMPING = {"none": 0, "axial": 1, "full": 2}  # as kernels are told it


def rows(memory: Memory, snapshot: Snapshot, bonds: Sequence[Bond]) -> tuple[Any, ...]:
    """Buffers start, neighbor, stiffness, rest_length, damping: both ends of every spring, by the particle they pull at.

    Where there are bonds, a last buffer has the bits of the bonds of each half-spring. Row i is start[i] … start[i + 1]; the
    half-springs of a row stand in the order of the springs of the scene.
    """
    springs = snapshot.springs
    ends, others = springs.between.T.ravel(), springs.between[:, ::-1].T.ravel()
    number = np.tile(np.arange(len(springs)), 2)
    order = np.argsort(ends, kind="stable")
    start = np.concatenate([[0], np.cumsum(np.bincount(ends, minlength=snapshot.particle_count))])
    reals = (values[number[order]] for values in (springs.stiffness, springs.rest_length, springs.damping))
    return (
        memory.buffer(start.astype(np.int32)),
        memory.buffer(others[order].astype(np.int32)),
        *(memory.reals(values) for values in reals),
        *([memory.buffer(bits(bonds, len(springs))[number[order]])] if bonds else []),
    )
