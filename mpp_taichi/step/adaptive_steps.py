"""Adaptive steps: one thread for each copy of a system takes steps of the method's own choice up to the time of a sample."""

import numpy as np
import taichi as ti

from mpp_taichi.device.heavy_loops import is_heavy
from mpp_taichi.errors import CapacityError
from mpp_taichi.step.launcher import Launcher

MOST_STEPS = 2**31 - 1
"""Steps of the method that its counter counts; a launch that needs more would take hours, and cannot be interrupted."""


@ti.data_oriented
class AdaptiveSteps(Launcher):
    """The plans serial and replicas of adaptive methods; `dt` is the time between two samples."""

    _control: tuple[float, float] | None = None  # the values in the state's control field

    def begin(self, time: float, dt: float) -> None:
        """Take the state as the start of the first step, with the accuracy that the method's parameter asks for now."""
        control = self.integrator.control()
        if control != self._control:
            self.integrator.set_control(self.state)
            self._control = control
        with self.parts.quickly():
            self._begin_steps(time, dt)
        lengths = self.integrator.first_lengths(self.state)
        self._first_length = float(np.min(lengths, where=lengths > 0.0, initial=np.inf))

    def check_span(self, span: float) -> None:
        """Refuse a time that is too long for one launch.

        Raises:
            CapacityError: the method would take more than `MOST_STEPS` steps of the length with which it begins.
        """
        if span > MOST_STEPS * self._first_length:
            raise CapacityError(
                f"a time of {span:.3g} between samples is about {span / self._first_length:.2g} steps of "
                f"{self._first_length:.3g}, with which the method begins, allowed: {MOST_STEPS:,}; take a shorter dt"
            )

    def launch(self, time: float, dt: float, first: int, last: int) -> None:
        """Steps until one ends at time + last · dt or later, and the state shown at that time."""
        self.check_span((last - first) * dt)
        with self.compiled():
            self._advance(time + last * dt)

    @ti.kernel
    def _begin_steps(self, time: ti.f64, dt: ti.f64):
        if ti.static(self.state.replica_count == 1):
            ti.loop_config(serialize=True)  # no other thread is woken
            for _ in range(1):
                self.integrator.begin(self.state, self.total_force, 0, time, dt, "serial")
        else:
            for q in range(self.state.replica_count * self.grain):
                if is_heavy(q, self.grain):
                    replica = q // self.grain
                    first = replica * self.state.particle_count
                    self.integrator.begin(self.state, self.total_force, first, time, dt, "serial")

    @ti.kernel
    def _advance(self, end: ti.f64):
        if ti.static(self.state.replica_count == 1):
            ti.loop_config(serialize=True)
            for _ in range(1):
                self.integrator.advance_to(self.state, self.total_force, 0, end, "serial")
                self.integrator.show(self.state, self.total_force, 0, end)
        else:
            for q in range(self.state.replica_count * self.grain):
                if is_heavy(q, self.grain):
                    replica = q // self.grain
                    first = replica * self.state.particle_count
                    self.integrator.advance_to(self.state, self.total_force, first, end, "serial")
                    self.integrator.show(self.state, self.total_force, first, end)
