"""Parallel, staged: each stage of a step, and each sum of forces, is a launch of its own."""

import taichi as ti

from mpp_taichi.device.fast_taichi.serial_loops import SerialLoops
from mpp_taichi.step.launcher import Launcher
from mpp_taichi.types import Template


@ti.data_oriented
class ParallelStaged(Launcher):
    """The plan of large systems whose sums of forces do not fit into the kernel of a step, or whose stages are in a table.

    Sums over pairs on a CPU are compiled in a mode of their own, and a tree is many kernels.
    """

    def set_up(self) -> None:
        """Choose the integrator's way through its stages that these forces need."""
        self.joins = self.integrator.joins_steps(self.total_force)
        self.looks_up = self.integrator.looks_stages_up(self.total_force)
        self.sums = self.integrator.wants_sum(self.total_force)

    def launch(self, time: float, dt: float, first: int, last: int) -> None:
        """The stages and sums of each step; where steps are joined, the last stage of a step opens the next step."""
        for s in range(first, last):
            self._launch_step(time + s * dt, dt, begins=s == first or not self.joins, opens=s + 1 < last)

    def _launch_step(self, time: float, dt: float, *, begins: bool, opens: bool) -> None:
        if begins:
            with self.loops:
                self._stage(time, dt, 0)
        for k, node in enumerate(self.integrator.nodes):
            if self.sums:
                self.force_sum.add_up(self.total_force, time + node * dt)
            with self.loops:
                if self.looks_up:
                    self._stage_after_force(time, dt, k + 1)
                elif self.joins and k == self.integrator.evaluations - 1:
                    self._stage_and_opening(time, dt, int(opens))
                else:
                    self._stage(time, dt, k + 1)

    def launches_per_step(self) -> int | None:
        """Parallel loops of all stages and sums; stages of few particles are run only by the calling thread."""
        loops = self.force_sum.parallel_loops()
        if loops is not None and isinstance(self.loops, SerialLoops):
            return self.integrator.evaluations * loops if self.sums else 0
        return self.integrator.parallel_loops(self.total_force, loops)

    @ti.kernel
    def _stage(self, time: float, dt: float, k: Template):
        self.integrator.stage(self.state, self.total_force, 0, time, dt, k)

    @ti.kernel
    def _stage_and_opening(self, time: float, dt: float, opens: ti.i32):
        self.integrator.stage_and_opening(self.state, self.total_force, 0, time, dt, opens)

    @ti.kernel
    def _stage_after_force(self, time: float, dt: float, k: ti.i32):
        self.integrator.stage_after_force(self.state, self.total_force, 0, time, dt, k)
