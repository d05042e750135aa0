"""Felt forces: the accelerations of a simulation at its present positions, by the loops of its own plan."""

from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.forces._total_force import TotalForce
from mpp_taichi.state.state import State
from mpp_taichi.step.force_sum import ForceSum


@ti.data_oriented
class FeltForces:
    """The sum of the forces as a step computes it, with the forces that depend on velocity added."""

    def __init__(self, state: State, total_force: TotalForce, force_sum: ForceSum) -> None:
        """Bind the parts."""
        self.state, self.total_force, self.force_sum = state, total_force, force_sum

    def measure(self, time: float) -> np.ndarray:
        """Accelerations, (N, dimensions), in float64."""
        acceleration: Any = self.state.acceleration
        acceleration.fill(0.0)
        if self.total_force.has_velocity_independent:
            self.force_sum.add_up(self.total_force, time)
        if self.total_force.depends_on_velocity:
            self._add_friction(time)
        return acceleration.to_numpy().astype(np.float64)

    @ti.kernel
    def _add_friction(self, time: float):
        for i in range(self.state.particle_count):
            more = self.total_force.local_acceleration(self.state, 0, i, time, True)
            self.state.acceleration[i] = self.state.acceleration[i] + more
