"""The speeds of a gas in equilibrium: Maxwell and Boltzmann, in two and three dimensions. Temperatures are energies, k T.

b² = 2 k T / m is the most frequent squared speed of three dimensions, and the mean squared speed of two.
"""

import math
from typing import Any

import numpy as np

_erf = np.vectorize(math.erf, otypes=[float])


def speed_scale(mass: Any, temperature: float) -> Any:
    """b = √(2 k T / m) [length / time]."""
    return np.sqrt(2.0 * temperature / np.asarray(mass, dtype=float))


def speed_density(speed: Any, scale: float, dimensions: int) -> Any:
    """f(v), of which ∫ f dv = 1 [time / length].

    d = 2: 2 v / b² exp(−v²/b²) (T. Müller, arXiv:1403.1695, eq. 21).   d = 3: 4 v² / (√π b³) exp(−v²/b²).
    """
    x = np.asarray(speed, dtype=float) / scale
    shape = 2.0 * x if dimensions == 2 else 4.0 / math.sqrt(math.pi) * x**2
    return shape * np.exp(-(x**2)) / scale


def component_density(velocity: Any, scale: float) -> Any:
    """f(v_x) = exp(−v_x²/b²) / (√π b) of one component, of which ∫ f dv_x = 1 [time / length]."""
    return np.exp(-((np.asarray(velocity, dtype=float) / scale) ** 2)) / (math.sqrt(math.pi) * scale)


def speed_cumulative(speed: Any, scale: Any, dimensions: int) -> Any:
    """F(v), the share of particles slower than v.

    d = 2: 1 − exp(−v²/b²).   d = 3: erf(v/b) − 2 v / (√π b) exp(−v²/b²).
    """
    x = np.asarray(speed, dtype=float) / scale
    if dimensions == 2:
        return -np.expm1(-(x**2))
    return _erf(x) - 2.0 / math.sqrt(math.pi) * x * np.exp(-(x**2))


def mean_speed(mass: float, temperature: float, dimensions: int) -> float:
    """⟨v⟩ = √(π k T / 2 m) in two dimensions, √(8 k T / π m) in three."""
    return math.sqrt((0.5 * math.pi if dimensions == 2 else 8.0 / math.pi) * temperature / mass)


def kinetic_temperature(velocity: np.ndarray, mass: np.ndarray, dimensions: int, *, drift: bool = False) -> float:
    """k T = Σ m v² / (d N) [energy]; with `drift` of the velocities against the common motion, Σ m (v − V)² / (d (N − 1)).

    velocity (n, 3) and mass (n,); infinite or zero masses are not of a gas and must be left out. N − 1: the common motion
    takes d of the d N degrees of freedom.
    """
    count = len(mass)
    if drift:
        velocity = velocity - np.sum(mass[:, None] * velocity, axis=0) / np.sum(mass)
    freedoms = dimensions * (count - 1 if drift else count)
    return float(np.sum(mass[:, None] * velocity**2) / freedoms) if freedoms > 0 else 0.0
