"""Acceleration meter: the accelerations of all particles by the forces of a simulation, for recorders and views."""

import numpy as np
import taichi as ti

from mpp_taichi.arithmetic.force_numbers import zero_vector
from mpp_taichi.arithmetic.particle_update import high_part
from mpp_taichi.forces._total_force import TotalForce
from mpp_taichi.snapshot import MERGED_ARRAYS, Snapshot
from mpp_taichi.state.state import State
from mpp_taichi.step.force_sum import ForceSum

PARTS = ("position", "velocity", "position_low", "velocity_low", "position_rest", "velocity_rest")
WRITTEN = (*PARTS, "acceleration", "acceleration_low", "jerk", "snap")
"""Fields that are written by a measurement, and restored after it."""


@ti.data_oriented
class AccelerationMeter:
    """Accelerations dv/dt = F / m of a snapshot by the forces of a step, friction included; the state keeps every bit."""

    def __init__(self, state: State, total_force: TotalForce, force_sum: ForceSum) -> None:
        """Bind the parts of a step; nothing is compiled before the first measurement."""
        self.state, self.total_force, self.force_sum = state, total_force, force_sum
        self.particle_count, self.dimensions = self.state.particle_count, self.state.dimensions
        names = (*WRITTEN, *total_force.memory, *(MERGED_ARRAYS if self.state.merges else ()))
        self._written = [self.state.field(name) for name in names if name in self.state.quantities]

    def measure(self, snapshot: Snapshot) -> np.ndarray:
        """Accelerations [length / time²] of the particles of a snapshot, (particle_count, 3), in float64.

        They are the accelerations by the smooth forces: 0 along an axis that is held, without rods, contacts and walls.
        """
        result = np.zeros((self.particle_count, 3))
        if not self.total_force.forces:
            return result
        before, frame = [field.to_numpy() for field in self._written], self.state.frame
        if self.state.merges:
            self.state.write_spheres(snapshot)
        self.state.write_snapshots((snapshot,))
        self.total_force.settle(self.state, snapshot.time)
        self.force_sum.add_up(self.total_force, snapshot.time)
        parts = 2 if self.state.forces_have_low else 1
        found = np.empty(
            (parts, self.particle_count, self.dimensions), np.float32 if self.state.position.dtype == ti.f32 else np.float64
        )
        self._look(snapshot.time, found)
        for field, values in zip(self._written, before, strict=True):
            field.from_numpy(values)
        self.state.frame = frame
        result[:, : self.dimensions] = found.astype(np.float64).sum(axis=0)
        return result

    @ti.kernel
    def _look(self, time: float, result: ti.types.ndarray(ndim=3)):
        for i in range(self.particle_count):
            found = zero_vector(self.state)  # a copy: the sum below must not change the field
            found = self.state.acceleration[i]
            if ti.static(self.total_force.depends_on_velocity):
                found += self.total_force.local_acceleration(self.state, 0, i, time, True)
            for k in ti.static(range(self.dimensions)):
                result[0, i, k] = high_part(found[k])
                if ti.static(self.state.forces_have_low):
                    result[1, i, k] = found[k].low
