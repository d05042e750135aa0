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
from mpp_taichi.accuracy.machine import Machine
from mpp_taichi.accuracy.stretches import legs
from mpp_taichi.accuracy.trace import PhasePoint

APART = 1e-8  # of the size of the system, and of its typical velocity
PIECES = 96
FIRST_PART = 0.25  # of the run, which does not count
ROUNDING = 1e-12  # of a time
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
    free = np.any([stretch.particles.free for stretch in problem.stretches], axis=0).astype(float)
    free[:, problem.spec.dimensions :] = 0.0
    one: PhasePoint = (problem.start.position, problem.start.velocity * problem.start.free)
    random = np.random.default_rng(SEED)
    away: PhasePoint = (random.standard_normal(free.shape) * free, random.standard_normal(free.shape) * free)
    speed = max(size / problem.span, _rms(one[1]))
    length = _length(away, size, speed)
    logarithms: list[float] = []
    times: list[float] = []
    for leg in legs(problem.stretches, steps):
        machine.enter(leg)
        pieces = min(leg.steps, max(1, round(PIECES * leg.stretch.share)))
        stops = [round(k * leg.steps / pieces) for k in range(pieces + 1)]
        for before, stop in zip(stops, stops[1:]):
            held = leg.stretch.particles.free
            away = (away[0], away[1] * held)
            other: PhasePoint = (one[0] + away[0] * (APART / length), (one[1] + away[1] * (APART / length)) * held)
            one = machine.advance_from((one[0], one[1] * held), leg, before, stop, budget)
            other = machine.advance_from(other, leg, before, stop, budget)
            away = (other[0] - one[0], other[1] - one[1])
            length = _length(away, size, speed)
            if not math.isfinite(length):
                return judge(logarithms, times, problem.span)
            logarithms.append(math.log(max(length, LEAST_LENGTH) / APART))
            times.append(leg.time(stop) - problem.stretches[0].began)
    return judge(logarithms, times, problem.span)


def judge(logarithms: list[float], times: list[float], span: float) -> Chaos:
    """Distinguish exponential growth from growth by a power of time; `times` are the ends of the pieces of the run."""
    late = [logarithm for logarithm, time in zip(logarithms, times) if time > FIRST_PART * span * (1.0 + ROUNDING)]
    rise = float(sum(late))
    if rise < LEAST_RISE:
        return Chaos(None, rise, span)
    begin = times[-len(late) - 1] if len(late) < len(times) else 0.0
    return Chaos((times[-1] - begin) / rise, rise, span)


def _length(away: PhasePoint, size: float, speed: float) -> float:
    """Distance in the space of positions and velocities, each in its own unit."""
    return math.hypot(_rms(away[0]) / size, _rms(away[1]) / speed)


def _rms(vectors: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.sum(vectors**2, axis=1))))
