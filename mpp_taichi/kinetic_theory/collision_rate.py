"""Collisions of hard spheres: Enskog's collision rates, and the mean free path.

Temperatures are energies, k T. Rates are per particle: a collision counts for both partners, so that N particles have
N Γ / 2 collisions in a unit of time.
"""

import math

import numpy as np

from mpp_taichi.kinetic_theory.equation_of_state import contact_value, contact_values_of_mixture
from mpp_taichi.kinetic_theory.packing import UNIT_SURFACE, packing_fraction
from mpp_taichi.kinetic_theory.speeds import mean_speed


def enskog_rate(density: float, radius: float, mass: float, temperature: float, dimensions: int) -> float:
    """Collisions of a particle in a unit of time, in a gas of equal spheres far from walls [time⁻¹].

    Γ = 2 n σ g √(π k T / m) in two dimensions, 4 n σ² g √(π k T / m) in three, σ the diameter, g the contact value.
    Source: Chapman & Cowling, The Mathematical Theory of Non-Uniform Gases, ch. 16; for disks Gass, J. Chem. Phys. 54
    (1971) 1898.
    """
    contact = contact_value(packing_fraction(density, radius, dimensions), dimensions)
    area = UNIT_SURFACE[dimensions] * (2.0 * radius) ** (dimensions - 1)
    return density * area * float(contact) * math.sqrt(temperature / (math.pi * mass))


def enskog_rates_of_mixture(
    density: np.ndarray, radius: np.ndarray, mass: np.ndarray, temperature: float, dimensions: int
) -> np.ndarray:
    """Γ_ij: collisions of one particle of species i with particles of species j in a unit of time, shape (k, k) [time⁻¹].

    Γ_ij = n_j S σ_ij^(d−1) g_ij √(k T / 2π μ_ij), S = 2π or 4π, σ_ij = r_i + r_j, μ_ij the reduced mass.
    """
    r, m = np.asarray(radius, dtype=float), np.asarray(mass, dtype=float)
    reach = r[:, None] + r[None, :]
    contact = contact_values_of_mixture(density, r, dimensions)
    flux = np.sqrt(temperature / (2.0 * math.pi) * (1.0 / m[:, None] + 1.0 / m[None, :]))
    return np.asarray(density)[None, :] * UNIT_SURFACE[dimensions] * reach ** (dimensions - 1) * contact * flux


def mean_free_path(rate: float, mass: float, temperature: float, dimensions: int) -> float:
    """λ = ⟨v⟩ / Γ, the mean way between two collisions of a particle [length]."""
    return mean_speed(mass, temperature, dimensions) / rate


def wall_rate(pressure: float, mass: float, temperature: float) -> float:
    """Hits of a wall in a unit of time and area [time⁻¹ length¹⁻ᵈ]: β P √(k T / 2π m), as βP is the density at the wall."""
    return pressure / temperature * math.sqrt(temperature / (2.0 * math.pi * mass))
