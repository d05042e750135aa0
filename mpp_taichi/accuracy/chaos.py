"""Chaos: the rate at which two trajectories separate that begin at almost the same state.

Two runs of one method are kept 10⁻⁸ apart: after each of equal pieces of the run their distance is noted and set back
(Benettin, Galgani, Giorgilli, Strelcyn, Meccanica 15 (1980) 9). S(t), the sum of the logarithms of growth, rises as λ t where
the motion is chaotic and as ln t where it is not, so S over the last three quarters distinguishes the two: a rise by 4 is
more than any power up to t² gives there, ln 4² = 2.8. The Lyapunov time is 1/λ.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from mpp_taichi.accuracy.budget import Budget
from mpp_taichi.accuracy.workbench import Machine, Phase

APART = 1e-8  # of the size of the system, and of its typical velocity
PIECES = 96
LEAST_RISE = 4.0  # of S over the last three quarters of the run
ACCURATE = 1e-3  # of the size: the largest error of a position that still has a meaning
ROUND_OFF = {"f32": 2.0**-23, "f64": 2.0**-52}
LEAST_LENGTH = 1e-300  # so that the logarithm exists for two runs at the same state
SEED = 1


@dataclass(frozen=True)
class Chaos:
    """The separation of two neighbouring trajectories.

    lyapunov_time   [time]; None where the run shows no chaos
    rise            of ln(distance) over the last three quarters of the run
    """

    lyapunov_time: float | None
    rise: float
    span: float

    def horizon(self, precision: str) -> float | None:
        """Time at which the round-off of a precision has grown to ACCURATE [time]; None without chaos."""
        if self.lyapunov_time is None:
            return None
        return self.lyapunov_time * math.log(ACCURATE / ROUND_OFF[precision])

    def facts(self) -> dict[str, Any]:
        """The result as plain data."""
        found = {**vars(self)}
        return {**found, "horizon_f64": self.horizon("f64"), "horizon_f32": self.horizon("f32")}


def measure(machine: Machine, steps: int, size: float, budget: Budget) -> Chaos:
    """Follow the scene and a neighbour of it with `steps` steps.

    Raises:
        OutOfTime: the budget ended first.
    """
    problem = machine.problem
    steps = -(-steps // PIECES) * PIECES
    piece, dt = steps // PIECES, problem.span / steps
    free = problem.start.free.astype(float)
    free[:, problem.spec.dimensions :] = 0.0
    one: Phase = (problem.start.position, problem.start.velocity * problem.start.free)
    random = np.random.default_rng(SEED)
    away: Phase = (random.standard_normal(free.shape) * free, random.standard_normal(free.shape) * free)
    speed = max(size / problem.span, _rms(one[1]))
    length = _length(away, size, speed)
    logarithms: list[float] = []
    for number in range(PIECES):
        other: Phase = (one[0] + away[0] * (APART / length), one[1] + away[1] * (APART / length))
        before, stop = number * piece, (number + 1) * piece
        one = machine.advance_from(one, before, stop, dt, budget)
        other = machine.advance_from(other, before, stop, dt, budget)
        away = (other[0] - one[0], other[1] - one[1])
        length = _length(away, size, speed)
        if not math.isfinite(length):
            break
        logarithms.append(math.log(max(length, LEAST_LENGTH) / APART))
    return judge(logarithms, problem.span)


def judge(logarithms: list[float], span: float) -> Chaos:
    """Distinguish exponential growth from growth by a power of time."""
    begin = len(logarithms) // 4
    rise = float(sum(logarithms[begin:]))
    if rise < LEAST_RISE:
        return Chaos(None, rise, span)
    return Chaos(span * (1.0 - begin / PIECES) / rise, rise, span)


def _length(away: Phase, size: float, speed: float) -> float:
    """Distance in the space of positions and velocities, each in its own unit."""
    return math.hypot(_rms(away[0]) / size, _rms(away[1]) / speed)


def _rms(vectors: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.sum(vectors**2, axis=1))))
