"""Replicas: one thread for each independent copy of a system takes many steps in one launch."""

import taichi as ti

from mpp_taichi.device.heavy_loops import is_heavy
from mpp_taichi.step.launcher import Launcher


@ti.data_oriented
class Replicas(Launcher):
    """The plan of ensembles of a small system."""

    def launch(self, time: float, dt: float, first: int, last: int) -> None:
        """One kernel for all replicas and steps."""
        with self.compiled():
            self._advance(time, dt, first, last)

    @ti.kernel
    def _advance(self, time: float, dt: float, begin: ti.i32, end: ti.i32):
        for q in range(self.state.replica_count * self.grain):
            if is_heavy(q, self.grain):
                replica = q // self.grain
                first = replica * self.state.particle_count
                for s in range(begin, end):
                    self.integrator.step(self.state, self.total_force, first, time + s * dt, dt, "serial")
