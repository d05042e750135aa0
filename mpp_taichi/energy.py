"""Energies and momenta: terms on the device in its widest float, sums on the host in float64, in a fixed order."""

import math
from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.snapshot import Snapshot
from mpp_taichi.state import State
from mpp_taichi.total_force import TotalForce


@ti.data_oriented
class EnergyMeter:
    """Potential energy of the first replica, one term per particle."""

    def __init__(self, state: State, total_force: TotalForce):
        """Allocate one number per particle."""
        self.state = state
        self.total_force = total_force
        self.terms = ti.field(state.wide, shape=state.particle_count)

    @ti.kernel
    def _measure(self, time: float):
        for i in range(self.state.particle_count):
            self.terms[i] = self.total_force.potential_energy_of(self.state, 0, i, time)

    def potential_energy(self, time: float) -> float:
        """Sum over all forces that have a potential."""
        if not self.total_force.forces:
            return 0.0
        self._measure(time)
        return math.fsum(self.terms.to_numpy().astype(np.float64))


def mechanics(snapshot: Snapshot, potential_energy: float) -> dict[str, Any]:
    """The conserved quantities of a snapshot.

    kinetic_energy ½ Σ m v², potential_energy, total_energy; momentum Σ m v, angular_momentum Σ m x × v (about the origin),
    center_of_mass Σ m x / Σ m, each (3,); momentum_scale Σ m |v| and angular_momentum_scale Σ m |x| |v| to measure errors by.
    Particles whose axes are all fixed are left out of the momenta: they belong to the laboratory.
    """
    moving = snapshot.free.any(axis=1)
    mass = snapshot.mass
    velocity = snapshot.velocity
    kinetic = 0.5 * math.fsum(mass * np.einsum("ij,ij->i", velocity, velocity))
    held = np.where(moving, mass, 0.0)
    speed = np.linalg.norm(velocity, axis=1)
    distance = np.linalg.norm(snapshot.position, axis=1)
    total_mass = float(mass.sum())
    center = (mass @ snapshot.position) / total_mass if total_mass else snapshot.position.mean(axis=0)
    return {
        "time": snapshot.time,
        "step": snapshot.step,
        "kinetic_energy": kinetic,
        "potential_energy": potential_energy,
        "total_energy": kinetic + potential_energy,
        "momentum": held @ velocity,
        "angular_momentum": held @ np.cross(snapshot.position, velocity),
        "center_of_mass": center,
        "momentum_scale": float(np.abs(held) @ speed),
        "angular_momentum_scale": float(np.abs(held) @ (distance * speed)),
    }
