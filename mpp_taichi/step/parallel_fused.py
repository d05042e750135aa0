"""Parallel, fused: each step is one kernel of several parallel loops, the sums of forces among them."""

import taichi as ti

from mpp_taichi.step.launcher import Launcher


@ti.data_oriented
class ParallelFused(Launcher):
    """The plan of large systems whose sums of forces fit into the kernel of a step."""

    def launch(self, time: float, dt: float, first: int, last: int) -> None:
        """One kernel for each step."""
        for s in range(first, last):
            self._advance(time + s * dt, dt)

    def launches_per_step(self) -> int | None:
        """Parallel loops of all stages and sums."""
        return self.integrator.parallel_loops(self.total_force, self.force_sum.parallel_loops())

    @ti.kernel
    def _advance(self, time: float, dt: float):
        self.integrator.step(self.state, self.total_force, 0, time, dt, "parallel")
