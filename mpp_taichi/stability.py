"""Stability: how large a step the springs of a scene allow."""

import numpy as np

from mpp_taichi.snapshot import Snapshot


def spring_step_limit(start: Snapshot) -> float | None:
    """Largest stable dt of leapfrog with these springs [time], 2/ω_max with ω_max² ≤ max_i (2/m_i) Σ D; None without springs.

    The bound is Gershgorin's: a row of M⁻¹K holds its diagonal and as much again beside it. Fixed particles do not swing. It is
    a safe one: springs at right angles, or a fixed end, allow up to √2 more. Other explicit methods differ by a small factor.
    """
    if not len(start.springs):
        return None
    stiffness = np.zeros(start.particle_count)
    for end in (0, 1):
        np.add.at(stiffness, start.springs.between[:, end], start.springs.stiffness)
    swings = start.free.any(axis=1) & (start.mass > 0.0) & (stiffness > 0.0)
    if not swings.any():
        return None
    return float(2.0 / np.sqrt(np.max(2.0 * stiffness[swings] / start.mass[swings])))
