"""Own state: many steps in one launch of a method that keeps the motion in coordinates of its own."""

import taichi as ti

from mpp_taichi.device.heavy_loops import is_heavy
from mpp_taichi.step.launcher import Launcher


@ti.data_oriented
class OwnState(Launcher):
    """The plans serial and replicas of such methods: one thread for each copy of the system."""

    moves_between_steps = True

    def launch(self, time: float, dt: float, first: int, last: int) -> None:
        """All steps, and the positions and velocities at their end."""
        with self.compiled():
            self._launch(dt, last - first, 0.0)

    def look_ahead(self, dt: float, share: float) -> None:
        """Show the particles a part of a step later; the state of the method stays where it is."""
        self._launch(dt, 0, share)

    @ti.kernel
    def _launch(self, dt: float, steps: ti.i32, beyond: float):
        for q in range(self.state.replica_count * self.grain):
            if is_heavy(q, self.grain):
                replica = q // self.grain
                self.total_force.at_replica(replica)
                first = replica * self.state.particle_count
                self.integrator.launch(self.state, self.total_force, first, dt, steps, beyond)
