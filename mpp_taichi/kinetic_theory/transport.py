"""Slow changes of a gas of hard spheres: diffusion, a heavy sphere in a bath, cooling by inelastic collisions, compression.

Temperatures are energies, k T.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from mpp_taichi.kinetic_theory.collision_rate import enskog_rate, enskog_rates_of_mixture
from mpp_taichi.kinetic_theory.equation_of_state import compressibility


def self_diffusion(density: float, radius: float, mass: float, temperature: float, dimensions: int) -> float:
    """D of equal spheres by Enskog's first approximation [length² / time], D = k T / (m ξ), ξ = 2 Γ / d.

    d = 3: 3 / (8 n σ² g) √(k T / π m); the second approximation is 1.9 % larger. Dense gases diffuse more slowly than this, as
    neighbours throw a sphere back, and in two dimensions ⟨x²⟩ grows a little faster than t in the long run.
    Source: Chapman & Cowling, ch. 16; Gass, J. Chem. Phys. 54 (1971) 1898.
    """
    friction = 2.0 / dimensions * enskog_rate(density, radius, mass, temperature, dimensions)
    return temperature / (mass * friction)


def friction_in_bath(
    mass: float, radius: float, *, density: float, bath_mass: float, bath_radius: float, temperature: float, dimensions: int
) -> float:
    """ξ of one sphere in a bath of others, dv/dt = −ξ v + noise [time⁻¹].

    ξ = (4/d) Γ μ / M, Γ its collision rate, μ the reduced mass; for M ≫ m and d = 3 that is (8/3) √(2π m k T) n σ² g / M. Its
    velocity is forgotten like exp(−ξ t). Sonine's first approximation, exact for M ≫ m in a dilute and large bath.
    """
    rates = enskog_rates_of_mixture(
        np.array([0.0, density]), np.array([radius, bath_radius]), np.array([mass, bath_mass]), temperature, dimensions
    )
    return 4.0 / dimensions * float(rates[0, 1]) * bath_mass / (mass + bath_mass)


def brownian_square_displacement(time: Any, mass: float, friction: float, temperature: float, dimensions: int) -> Any:
    """⟨x²⟩ = 2 d (k T / M ξ) [t − (1 − exp(−ξ t)) / ξ]: (d k T / M) t² at first, 2 d D t in the end [length²].

    Source: Ornstein & Uhlenbeck, Phys. Rev. 36 (1930) 823.
    """
    t = np.asarray(time, dtype=float)
    found = 2.0 * dimensions * temperature / (mass * friction) * (t + np.expm1(-friction * t) / friction)
    return found if found.ndim else float(found)


def haff_time(rate: float, restitution: float, dimensions: int) -> float:
    """τ of Haff's law [time]: 1/τ = (1 − e²) Γ(T₀) / (2 d), infinite for e = 1.

    A collision takes (1 − e²) k T on average, as ⟨½ μ v_n²⟩ = k T over collisions. Source: Haff, J. Fluid Mech. 134 (1983) 401.
    """
    loss = (1.0 - restitution**2) * rate
    return 2.0 * dimensions / loss if loss > 0.0 else math.inf


def haff_temperature(time: Any, temperature: float, tau: float) -> Any:
    """T = T₀ / (1 + t/τ)², while the gas stays homogeneous."""
    return temperature / (1.0 + np.asarray(time, dtype=float) / tau) ** 2


def adiabatic_temperature_ratio(
    packing: float, packing_after: float, dimensions: int, state: Callable[[Any, int], Any] = compressibility
) -> float:
    """T₂ / T₁ of a gas that is compressed slowly, without heat: exp[(2/d) ∫ Z(η) dη/η] from η₁ to η₂.

    For points, Z = 1, that is T V^(2/d) = const. `state` gives Z(η, d); the integral over ln η is by 64 Gauss points.
    """
    if not (packing > 0.0 and packing_after > 0.0):
        return math.nan
    nodes, weights = np.polynomial.legendre.leggauss(64)
    half = 0.5 * math.log(packing_after / packing)
    eta = packing * np.exp(half * (nodes + 1.0))
    return math.exp(2.0 / dimensions * half * float(np.sum(weights * state(eta, dimensions))))
