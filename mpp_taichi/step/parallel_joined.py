"""Parallel, joined: as fused, and the last stage of a step shares its loop with the opening stage of the next step."""

import taichi as ti

from mpp_taichi.step.launcher import Launcher


@ti.data_oriented
class ParallelJoined(Launcher):
    """The plan of large systems for methods whose steps begin and end with a drift; it saves one loop of each step.

    The bits are the same as for steps that are launched one after the other.
    """

    def launch(self, time: float, dt: float, first: int, last: int) -> None:
        """The opening stage of the first step, then one kernel for each step; all but the last open the next step."""
        self._open(time + first * dt, dt)
        for s in range(first, last):
            self._step_on(time + s * dt, dt, int(s + 1 < last))

    def launches_per_step(self) -> int | None:
        """Parallel loops of all stages and sums; the opening stage is none of its own."""
        return self.integrator.parallel_loops(self.total_force, self.force_sum.parallel_loops())

    @ti.kernel
    def _open(self, time: float, dt: float):
        self.integrator.stage(self.state, self.total_force, 0, time, dt, 0)

    @ti.kernel
    def _step_on(self, time: float, dt: float, opens: ti.i32):
        self.integrator.step_on(self.state, self.total_force, 0, time, dt, "parallel", True, opens)
