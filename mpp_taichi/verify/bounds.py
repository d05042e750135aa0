"""Bounds: how large the rounding errors of a run may become, from the number of its roundings and the growth of each."""

import math
from functools import cache

import numpy as np

from mpp_taichi.verify.place import Place

ROUNDINGS = 3  # of a stage: position, velocity and force


def rounding(place: Place, *, steps: int, stages: int, phase: float, leverage: float = 1.0) -> tuple[float, str]:
    """The bound of the error of a place in parts of the size of an orbit, and the words for it.

    √(3 n s) r (1 + 3 φ L): n steps of s stages have 3 n s roundings of relative size r at random. A rounding changes the
    energy by 2 r L of itself, and with it the frequency, so that the phase is off by 3 r L φ after φ radians. r is the
    rounding of a place, or of a force times the part φ/n of a radian that a step takes, if that is larger.

    phase     φ [rad]
    leverage  L: 1/(1 − e) for an orbit of eccentricity e; 0 for harmonic motion, whose frequency does not change
    """
    of_step = max(place.u, place.force_u * phase / steps)
    bound = math.sqrt(ROUNDINGS * steps * stages) * of_step * (1.0 + 3.0 * phase * leverage)
    grows = f", each of which grows to 1 + 3φL times its size, φ = {phase:.3g} rad, L = {leverage:.3g}" if leverage else ""
    return bound, f"√(3 n s) roundings of r = {of_step:.1g} at random, n = {steps} steps of s = {stages} stages{grows}"


def grown(place: Place, *, steps: int, stages: int, growth: float, span: float = 0.0) -> tuple[float, str]:
    """The bound of the relative error of places at the end of a run whose errors grow, and the words for it.

    √(3 n s) r g: as `rounding`, with the growth g of a relative error of a place or of a velocity until the end of the run.

    growth  g, the root mean square over the run of the norm of the variational solution, from the program's own equations
            integrated by SciPy
    span    of the run [time], in a unit of about a radian of the motion: a rounding of a force counts span/n of itself
    """
    of_step = max(place.u, place.force_u * span / steps)
    bound = math.sqrt(ROUNDINGS * steps * stages) * of_step * growth
    why = f"√(3 n s) roundings of r = {of_step:.1g} at random, n = {steps} steps of s = {stages} stages"
    return bound, f"{why}, each of which grows by g = {growth:.3g}"


def half_digit(printed: str) -> float:
    """Half a unit of the last digit of a number as it is printed, "0.707107" or "3.6e-4"."""
    digits, _, power = printed.lower().partition("e")
    return 0.5 * 10.0 ** (int(power or 0) - len(digits.partition(".")[2]))


def chance_beyond(t: float, freedom: int) -> float:
    """Probability that a t-distributed number of so many degrees of freedom is farther from 0 than t.

    ∫ cos^(ν−1) θ dθ from arctan(t/√ν) to π/2, over the same integral from 0, by 200 Gauss points. Source: Student, Biometrika
    6 (1908) 1.
    """
    nodes, weights = _gauss()

    def part(begin: float) -> float:
        half = 0.5 * (0.5 * math.pi - begin)
        return half * float(np.sum(weights * np.cos(begin + half * (nodes + 1.0)) ** (freedom - 1)))

    return part(math.atan(abs(t) / math.sqrt(freedom))) / part(0.0)


@cache
def _gauss() -> tuple[np.ndarray, np.ndarray]:
    return np.polynomial.legendre.leggauss(200)


def student(chance: float, freedom: int) -> float:
    """The number that a t-distributed number of so many degrees of freedom exceeds in size with this probability."""
    low, high = 0.0, 1e6
    while high - low > 1e-9 * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if chance_beyond(middle, freedom) > chance else (low, middle)
    return high


def rounded(count: float) -> float:
    """√(3 n): three standard deviations of the sum of n roundings at random, in units of the largest error of one of them."""
    return math.sqrt(3.0 * count)
