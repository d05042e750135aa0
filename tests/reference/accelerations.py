"""Accelerations and energies by the textbook formulas, all in float64."""

import numpy as np


def gravity(position, mass, strength, softening=0.0):
    """G Σ_j m_j d / (|d|² + ε²)^(3/2)."""
    d = position[None, :, :] - position[:, None, :]
    r2 = (d**2).sum(-1) + softening**2
    np.fill_diagonal(r2, 1.0)
    return strength * (mass[None, :, None] * d / r2[:, :, None] ** 1.5).sum(1)


def gravity_energy(position, mass, strength, softening=0.0):
    """−Σ_{i<j} G m_i m_j / √(|d|² + ε²)."""
    i, j = np.triu_indices(len(mass), 1)
    r = np.sqrt(((position[j] - position[i]) ** 2).sum(-1) + softening**2)
    return -(strength * mass[i] * mass[j] / r).sum()


def coulomb(position, mass, charge, constant, softening=0.0):
    """−k q_i Σ_j q_j d / (|d|² + ε²)^(3/2) / m_i."""
    return -charge[:, None] / mass[:, None] * gravity(position, charge, constant, softening)


def springs(position, velocity, mass, between, stiffness, damping, rest_length, *, full=False):
    """Damped springs, one after the other."""
    force = np.zeros_like(position)
    for (i, j), k, c, length in zip(between, stiffness, damping, rest_length):
        d = position[j] - position[i]
        distance = np.sqrt(d @ d)
        n = d / distance
        relative = velocity[j] - velocity[i]
        f = k * (distance - length) * n + c * (relative if full else (relative @ n) * n)
        force[i] += f
        force[j] -= f
    return force / mass[:, None]
