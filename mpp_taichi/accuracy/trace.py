"""Trace: the path of a run, from which two runs can be compared at every sample."""

from dataclasses import dataclass, field

import numpy as np

from mpp_taichi.accuracy.problem import Problem

PhasePoint = tuple[np.ndarray, np.ndarray]  # positions and velocities
MOST_FOLLOWED = 1000  # particles whose positions are kept in every sample


@dataclass(eq=False)
class Trace:
    """The path of a run, kept on demand: positions [length] of the followed particles, (samples, followed, 3).

    velocity of the same particles [length / time]
    begins   positions and velocities of all particles at the begin of each stretch of the problem
    """

    times: np.ndarray
    position: np.ndarray
    begins: list[PhasePoint] = field(default_factory=list)
    velocity: np.ndarray = field(default_factory=lambda: np.zeros(0))


def followed(problem: Problem) -> np.ndarray:
    """Indices of the moving particles whose positions are kept: all of them, or at most MOST_FOLLOWED, evenly chosen."""
    moves = np.any([stretch.particles.free.any(axis=1) for stretch in problem.stretches], axis=0)
    moving = np.flatnonzero(moves)
    return moving[:: -(-len(moving) // MOST_FOLLOWED)]
