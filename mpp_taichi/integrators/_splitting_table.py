"""Coefficients of splitting methods: how tables are composed, and by which method a kick is solved."""

import math

from mpp_taichi.integrators import _runge_kutta

# How v' = A + f(v) is solved inside a kick when a force depends on velocity: to the order of the whole method.
KICK_METHODS = {
    1: _runge_kutta.EULER,
    2: _runge_kutta.MIDPOINT,
    3: _runge_kutta.HEUN3,
    4: _runge_kutta.CLASSICAL,
    6: _runge_kutta.taylor(6),
    8: _runge_kutta.taylor(8),
}


def of_leapfrogs(*weights: float) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """(drifts, kicks) of drift–kick–drift leapfrogs of lengths w₁, …, w_m, …, w₁; adjacent drifts are joined.

    `weights` are w₁ … w_{m−1}. The middle length is w_m = 1 − 2 (w₁ + … + w_{m−1}), so that the lengths add up to 1 exactly.
    """
    middle = 1.0 - 2.0 * math.fsum(weights)
    kicks = (*weights, middle, *reversed(weights))
    between = tuple((a + b) / 2 for a, b in zip(kicks, kicks[1:]))
    return (kicks[0] / 2, *between, kicks[0] / 2), kicks


def without_rounding(number: float) -> float:
    """The number, or 0 where it is only the rounding of a sum of coefficients."""
    return 0.0 if abs(number) < 1e-14 else number
