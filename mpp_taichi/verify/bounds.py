"""Bounds: how large the rounding errors of a run may become, from the number of its roundings and the growth of each."""

import math

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


def rounded(count: float) -> float:
    """√(3 n): three standard deviations of the sum of n roundings at random, in units of the largest error of one of them."""
    return math.sqrt(3.0 * count)
