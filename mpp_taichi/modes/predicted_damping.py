"""Numerical damping: the effect of the integrator on an oscillation, predicted from its matrix of one step."""

import cmath
import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

SMALL_STEP = 1e-2  # ω dt at which the principal eigenvalue is the eigenvalue nearest to e^(i ω dt), for every consistent method
FOLLOWED_PER_DECADE = 40
ROUNDING = 8.0 * float(np.finfo(float).eps)  # of |λ|: rounding in a method that conserves the energy


@dataclass(frozen=True)
class NumericalDamping:
    """The effect of steps of dt on a free oscillation of ω.

    energy_loss       share of the energy lost in one oscillation; below 0 where it is gained
    frequency_error   ω_numerical / ω − 1
    Both are None where the step is so large that the method does not oscillate.
    """

    angular_frequency: float
    energy_loss: float | None
    frequency_error: float | None


def predicted_damping(amplification: Callable[[float], np.ndarray], angular_frequency: float, dt: float) -> NumericalDamping:
    """Energy loss and frequency error of a method whose step multiplies the oscillator's state by `amplification(ω dt)`.

    With the principal eigenvalue λ = |λ| e^(iθ), which tends to e^(iω dt), an oscillation takes 2π/θ steps and leaves
    |λ|^(4π/θ) of the energy; the frequency is θ/dt. For methods of several steps, whose matrix has other eigenvalues as well,
    it is followed from a small step on. Source: Hairer, Lubich and Wanner, Geometric Numerical Integration (2006), §I.1.
    """
    step = angular_frequency * dt
    start = min(step, SMALL_STEP)
    count = 1 + math.ceil(FOLLOWED_PER_DECADE * math.log10(step / start)) if step > 0.0 else 1
    principal = cmath.exp(1j * start)
    for angle in np.geomspace(start, step, count) if step > 0.0 else ():
        values = np.linalg.eigvals(amplification(float(angle)))
        principal = complex(values[np.argmin(np.abs(values - principal))])
    theta = cmath.phase(principal)
    if not (0.0 < abs(theta) < math.pi) or principal == 0.0:
        return NumericalDamping(angular_frequency, None, None)
    theta = abs(theta)
    growth = math.log(abs(principal))
    loss = -math.expm1(min(4.0 * math.pi / theta * growth, 700.0)) if abs(growth) > ROUNDING else 0.0
    return NumericalDamping(angular_frequency, loss, theta / step - 1.0)
