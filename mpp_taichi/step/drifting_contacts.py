"""Drifting contacts: the kicks of a splitting, and a contact solver that moves the spheres in each drift between them."""

import taichi as ti

from mpp_taichi.step.launcher import Launcher
from mpp_taichi.types import Template


@ti.data_oriented
class DriftingContacts(Launcher):
    """Steps of a splitting in which contacts are resolved on the way of each drift."""

    def launch(self, time: float, dt: float, first: int, last: int) -> None:
        """Each kick and each drift is a launch, or more."""
        for s in range(first, last):
            self._launch_step(time + s * dt, dt)
        with self.loops:
            self.contacts.write_back()

    def _launch_step(self, time: float, dt: float) -> None:
        for k, (node, kick, drift) in enumerate(self.integrator.entries):
            if kick != 0.0 and self.total_force.forces:
                if k > 0 and self.shape == "launched":
                    self.force_sum.add_up(self.total_force, time + node * dt)
                with self.loops, self.compiled():
                    self._kick(time, dt, k, self.shape)
            if drift != 0.0:
                self._drift(time + node * dt, drift * dt)

    def _drift(self, time: float, length: float) -> None:
        """A drift with its contacts; a method with a bath of heat has two halves of it, and its bath between them."""
        if not self.integrator.draws_random:
            with self.loops:
                self.contacts.drift(self.state, time, length)
            return
        with self.loops:
            self.contacts.drift(self.state, time, length / 2)
            self._meet_bath()
            self.contacts.drift(self.state, time + length / 2, length / 2)

    def launches_per_step(self) -> int | None:
        """Not known: it depends on the contacts."""
        return None

    @ti.kernel
    def _kick(self, time: float, dt: float, k: Template, shape: Template):
        if ti.static(shape == "serial"):
            ti.loop_config(serialize=True)
            for _ in range(1):
                self.integrator.kick_stage(self.state, self.total_force, 0, time, dt, k, shape)
        else:
            self.integrator.kick_stage(self.state, self.total_force, 0, time, dt, k, shape)

    @ti.kernel
    def _meet_bath(self):
        for i in range(self.total_force.particle_count):
            self.integrator.meet_bath(self.state, i, i)
