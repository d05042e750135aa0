"""Replicas: one thread for each few independent copies of a system takes many steps in one launch."""

import taichi as ti

from mpp_taichi.device.heavy_loops import is_heavy
from mpp_taichi.step.launcher import Launcher

INTERLEAVED = 4
"""Copies of a thread on a CPU, which take each step in turn: while one waits for a root, the processor computes another. On a
core of a Xeon three bodies take 21 ns a step in place of 37 ns. On a GPU a thread has one copy: other threads fill the wait."""


@ti.data_oriented
class Replicas(Launcher):
    """The plan of ensembles of a small system."""

    def set_up(self) -> None:
        """Choose how many copies a thread has."""
        self.together = INTERLEAVED if self.grain > 1 else 1
        self.blocks = -(-self.state.replica_count // self.together)

    def launch(self, time: float, dt: float, first: int, last: int) -> None:
        """One kernel for all replicas and steps."""
        with self.compiled():
            self._advance(time, dt, first, last)

    @ti.kernel
    def _advance(self, time: float, dt: float, begin: ti.i32, end: ti.i32):
        for q in range(self.blocks * self.grain):
            if is_heavy(q, self.grain):
                block = q // self.grain
                beyond = ti.min((block + 1) * self.together, self.state.replica_count)
                for s in range(begin, end):
                    for replica in range(block * self.together, beyond):
                        self.total_force.at_replica(replica)
                        first = replica * self.state.particle_count
                        self.integrator.step(self.state, self.total_force, first, time + s * dt, dt, "serial")
