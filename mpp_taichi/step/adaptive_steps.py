"""Adaptive steps: one thread for each copy of a system takes steps of the method's own choice up to the time of a sample."""

import numpy as np
import taichi as ti

from mpp_taichi.device.heavy_loops import is_heavy
from mpp_taichi.errors import CapacityError
from mpp_taichi.step.launcher import Launcher

MOST_STEPS = 2**31 - 1
"""Steps of the method that its counter counts; a launch that needs more would take hours, and cannot be interrupted."""

ELSEWHERE = 256
"""Steps of the method in one launch on other devices than the CPU, some of which end a launch of seconds."""

TRIAL_STEPS = 1000
"""Steps of the known length that are tried where a launch seems to need too many."""

LENGTHENED = 2.0
"""Ratio of the lengths after and before a trial, from which on steps are still becoming longer."""


@ti.data_oriented
class AdaptiveSteps(Launcher):
    """The plans serial and replicas of adaptive methods; `dt` is the time between two samples."""

    _control: tuple[float, float] | None = None  # the values in the state's control field

    def set_up(self) -> None:
        """Let the method follow the deviation that a quantity asks for."""
        if self.parts.tangent_meter is not None:
            from mpp_taichi.state.tangent_state import TangentState  # only where a run follows a deviation

            dual_force = self.total_force.with_pairs_in_turn()
            self.integrator.follow_deviation(self.parts.tangent_meter, TangentState(self.state), dual_force)

    def loop_iterations_per_step(self) -> int:
        """Loop iterations of one thread in one step of the method's own, an upper bound."""
        return int(self.integrator.iterations_of_step(self.state.particle_count, self.loop_iterations_per_evaluation()))

    @property
    def steps_per_launch(self) -> int:
        """Most steps of the method that a launch may hold."""
        if self.parts.on_cpu:
            return MOST_STEPS
        limit = self.parts.loop_limit
        return ELSEWHERE if limit is None else max(1, min(ELSEWHERE, limit // self.loop_iterations_per_step()))

    def begin(self, time: float, dt: float) -> None:
        """Take the state as the start of the first step, with the accuracy that the method's parameter asks for now."""
        control = self.integrator.control()
        if control != self._control:
            self.integrator.set_control(self.state)
            self._control = control
        with self.parts.quickly():
            self._begin_steps(time, dt)
        self._length = self._shortest(self.integrator.first_lengths(self.state))

    def check_span(self, span: float) -> None:
        """Refuse a time that is too long for one launch.

        Raises:
            CapacityError: the method would take more than `MOST_STEPS` steps of the length that is known of its steps.
        """
        if span > MOST_STEPS * self._length:
            raise CapacityError(
                f"a time of {span:.3g} between samples is about {span / self._length:.2g} steps of "
                f"{self._length:.3g}, as the method takes them, allowed: {MOST_STEPS:,}; take a shorter dt"
            )

    def launch(self, time: float, dt: float, first: int, last: int) -> None:
        """Steps until one ends at time + last · dt or later, and the state shown at that time."""
        span = (last - first) * dt
        with self.compiled():
            # The first step may be short by chance: it is known after some steps whether all are. To stop changes no bit.
            while span > MOST_STEPS * self._length:
                known = self._length
                self._advance_to(time + first * dt + TRIAL_STEPS * known)
                self._length = max(known, self._shortest(self.integrator.lengths(self.state)))
                if self._length < LENGTHENED * known:
                    self.check_span(span)
                    break
            self._advance_to(time + last * dt)

    def _advance_to(self, end: float) -> None:
        """Steps until one ends at `end` or later, in as many launches as the device needs."""
        most = self.steps_per_launch
        self._advance(end, most)
        while most < MOST_STEPS and self.integrator.are_short_of(self.state, end):
            self._advance(end, most)

    @staticmethod
    def _shortest(lengths: np.ndarray) -> float:
        """The shortest of the steps that some replicas have taken [time]; infinite where none has."""
        return float(np.min(lengths, where=lengths > 0.0, initial=np.inf))

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
                    self.total_force.at_replica(replica)
                    first = replica * self.state.particle_count
                    self.integrator.begin(self.state, self.total_force, first, time, dt, "serial")

    @ti.kernel
    def _advance(self, end: ti.f64, most: ti.i32):
        if ti.static(self.state.replica_count == 1):
            ti.loop_config(serialize=True)
            for _ in range(1):
                self.integrator.advance_to(self.state, self.total_force, 0, end, most, "serial")
                if not self.integrator.is_short_of(self.state, 0, end):
                    self.integrator.show(self.state, self.total_force, 0, end)
        else:
            for q in range(self.state.replica_count * self.grain):
                if is_heavy(q, self.grain):
                    replica = q // self.grain
                    self.total_force.at_replica(replica)
                    first = replica * self.state.particle_count
                    self.integrator.advance_to(self.state, self.total_force, first, end, most, "serial")
                    if not self.integrator.is_short_of(self.state, replica, end):
                        self.integrator.show(self.state, self.total_force, first, end)
