"""Parallel, implicit: the host leads Newton's iteration of each step, and every sweep over the particles is a launch."""

from mpp_taichi.step.launcher import Launcher


class ParallelImplicit(Launcher):
    """The plan of large systems for implicit methods; the integrator launches its own kernels."""

    def launch(self, time: float, dt: float, first: int, last: int) -> None:
        """Each step takes as many launches as its equations need."""
        with self.compiled():
            for s in range(first, last):
                self.integrator.launch_step(self.state, self.total_force, self.force_sum.add_up, time + s * dt, dt)

    def launches_per_step(self) -> int | None:
        """Not known beforehand."""
        return None
