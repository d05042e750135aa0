"""Replicas: one thread for each few independent copies of a system takes many steps in one launch."""

import taichi as ti

from mpp_taichi.arithmetic.force_numbers import parameter
from mpp_taichi.device.fast_taichi.explicit_vectors import explicit_vectors
from mpp_taichi.device.heavy_loops import is_heavy
from mpp_taichi.state.lane_state import LaneState
from mpp_taichi.step.lane_choice import may_have_lanes
from mpp_taichi.step.launcher import Launcher

INTERLEAVED = 4
"""Copies of a thread on a CPU that has no lanes, which take each step in turn: while one waits for a root, the processor
computes another. On a GPU a thread has one copy: other threads fill the wait."""


@ti.data_oriented
class Replicas(Launcher):
    """The plan of ensembles of a small system.

    On a CPU a vector register has a number of 8 copies where the method, the forces and the precision take any
    numbers (arithmetic/kernel_number.py). No bit of a copy depends on the copies in the other lanes.
    """

    def set_up(self) -> None:
        """Choose how many copies a thread has, and how."""
        self.together = INTERLEAVED if self.grain > 1 else 1
        self.lanes: LaneState | None = None
        if may_have_lanes(self):
            self.lanes, self.lane_force = LaneState(self.state), self.total_force.with_pairs_in_turn()

    def destroy(self) -> None:
        """Free the memory of the lanes."""
        if self.lanes is not None:
            self.lanes.destroy()

    def launch(self, time: float, dt: float, first: int, last: int) -> None:
        """One kernel for all replicas and steps."""
        if self.lanes is not None:
            with explicit_vectors():
                self._advance_lanes(time, dt, first, last, -(-self.used // self.lanes.lane_count))
            return
        with self.compiled():
            self._advance(time, dt, first, last, self.used)

    @ti.kernel
    def _advance(self, time: float, dt: float, begin: ti.i32, end: ti.i32, used: ti.i32):
        # On a GPU the number is a part of the kernel: another kernel would round in another way.
        blocks = (used + self.together - 1) // self.together if ti.static(self.grain > 1) else self.state.replica_count
        for q in range(blocks * self.grain):
            if is_heavy(q, self.grain):
                block = q // self.grain
                beyond = ti.min((block + 1) * self.together, used if ti.static(self.grain > 1) else self.state.replica_count)
                for s in range(begin, end):
                    for replica in range(block * self.together, beyond):
                        self.total_force.at_replica(replica)
                        first = replica * self.state.particle_count
                        self.integrator.step(self.state, self.total_force, first, time + s * dt, dt, "serial")

    @ti.kernel
    def _advance_lanes(self, time: float, dt: float, begin: ti.i32, end: ti.i32, blocks: ti.i32):
        for q in range(blocks * self.grain):
            if is_heavy(q, self.grain):
                block = q // self.grain
                self.lane_force.at_replica(block * self.lanes.lane_count, self.lanes.lane_count)
                self.lanes.gather(block)
                first = block * self.state.particle_count
                for s in range(begin, end):
                    now, step = parameter(self.lanes, time + s * dt), parameter(self.lanes, dt)
                    self.integrator.step(self.lanes, self.lane_force, first, now, step, "serial")
                self.lanes.scatter(block)
