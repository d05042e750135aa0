"""Growth: the error of a run over time, the time at which it reaches a limit, and its extrapolation."""

import math
from dataclasses import dataclass

import numpy as np

RISE = 4.0  # of ln(error) over the last three quarters: more than any power up to t² gives, ln 4² = 2.8 (see accuracy/chaos)
LARGEST_POWER = 2.9  # RISE over ln 4
LEAST_TURNS = 3.0  # oscillations or revolutions in a piece from which growth can be told from the motion itself
WAY_OF_A_TURN = 2.0  # there and back, in extents of the path; a circle has π
LEAST_POINTS = 8


@dataclass(frozen=True)
class Growth:
    """The law of growth over the last three quarters of a piece, whose last error is `last` at the time `span`.

    power   exponent p of error ∝ t^p; None where the growth is exponential
    rate    of exponential growth [1/time]; None where the growth is by a power
    """

    span: float
    last: float
    power: float | None
    rate: float | None

    def time_of(self, limit: float) -> float:
        """Time at which the error reaches a limit that is above `last`, if it goes on growing by this law."""
        if self.last <= 0.0:
            return math.inf
        ratio = math.log(limit / self.last)
        if self.rate is not None:
            return self.span + ratio / self.rate
        assert self.power is not None
        return self.span * math.exp(min(600.0, ratio / self.power))

    def at(self, time: float) -> float:
        """The error at a later time by this law."""
        exponent = (time - self.span) * self.rate if self.rate is not None else math.log(time / self.span) * (self.power or 0.0)
        return self.last * math.exp(min(600.0, exponent))


def first_crossing(times: np.ndarray, errors: np.ndarray, limit: float) -> float | None:
    """The first time at which the error reaches the limit, between two samples on a straight line in ln t and ln error."""
    above = np.flatnonzero(~(errors < limit))
    if not len(above):
        return None
    k = int(above[0])
    if k == 0:
        return float(times[0])
    before, after = max(errors[k - 1], 1e-300), errors[k]
    if not math.isfinite(after) or times[k - 1] <= 0.0:
        return float(times[k - 1]) or float(times[k])
    share = math.log(limit / before) / math.log(after / before)
    return float(times[k - 1] * (times[k] / times[k - 1]) ** share)


def law(times: np.ndarray, errors: np.ndarray) -> Growth | None:
    """The law of growth of the largest error so far; None where there is none to be seen."""
    largest = np.maximum.accumulate(errors)
    if len(times) < LEAST_POINTS or not largest[-1] > 0.0:
        return None
    begin = len(times) // 4
    rise = math.log(largest[-1] / max(largest[begin], 1e-300))
    if rise >= RISE:
        return Growth(float(times[-1]), float(largest[-1]), None, rise / float(times[-1] - times[begin]))
    power = rise / math.log(times[-1] / times[begin])
    return Growth(float(times[-1]), float(largest[-1]), min(max(power, 0.0), LARGEST_POWER), None)


def beyond(growth: Growth, begin: float, until: float, limit: float, followed: str) -> tuple[float | None, str]:
    """The time before `until` at which an error that goes on growing so reaches a limit; else None, and the reason.

    Times of the law count from `begin`; `followed` names the part of the run that was followed.
    """
    reached = begin + growth.time_of(limit)
    if reached < until:
        return reached, ""
    return None, (
        f"in {followed} the error reaches {growth.last:.1g} of the system's size; if it goes on so, it is "
        f"{growth.at(until - begin):.1g} at the end"
    )


def turns(path: np.ndarray) -> float:
    """Oscillations or revolutions in a path (samples, particles, 3), the median over the particles: way over extent, halved."""
    inner = path - path.mean(axis=1, keepdims=True) if path.shape[1] > 2 else path
    way = np.linalg.norm(np.diff(inner, axis=0), axis=2).sum(axis=0)
    extent = np.linalg.norm(inner.max(axis=0) - inner.min(axis=0), axis=1)
    moving = extent > 0.0
    return float(np.median(way[moving] / (WAY_OF_A_TURN * extent[moving]))) if moving.any() else 0.0


def strides(path: np.ndarray) -> float:
    """The median over the samples of the longest way of a particle from one sample to the next [length]."""
    return float(np.median(np.linalg.norm(np.diff(path, axis=0), axis=2).max(axis=1))) if len(path) > 1 else 0.0
