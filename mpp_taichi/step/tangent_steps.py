"""Tangent steps: each step is taken together with its own derivative along one deviation of each copy of the system."""

import taichi as ti

from mpp_taichi.arithmetic.force_numbers import parameter
from mpp_taichi.device.fast_taichi.explicit_vectors import explicit_vectors
from mpp_taichi.device.heavy_loops import is_heavy
from mpp_taichi.state.lane_state import LaneState
from mpp_taichi.state.tangent_state import TangentState
from mpp_taichi.step.force_sum import SerialForceSum
from mpp_taichi.step.lane_choice import may_have_lanes
from mpp_taichi.step.launcher import Launcher


@ti.data_oriented
class TangentSteps(Launcher):
    """The plans serial and replicas where a quantity asks for the tangent of the step: one thread for each copy.

    The text of the step is the same as in a run without a tangent; it is compiled with dual numbers (arithmetic/dual.py).
    """

    def set_up(self) -> None:
        """Build the state of dual numbers, and the force that sums them."""
        self.dual_state, self.dual_force = TangentState(self.state), self.total_force.with_pairs_in_turn()
        self.lanes: LaneState | None = None
        if self.state.replica_count > 1 and may_have_lanes(self):
            self.lanes = LaneState(self.state)
            self.dual_lanes = TangentState(self.lanes)
        self.dual_sum = SerialForceSum(self.dual_state, grain=self.grain, compiled=self.parts.quickly)
        self.meter = self.parts.tangent_meter
        assert self.meter is not None

    def begin(self, time: float, dt: float) -> None:
        """The force that a step expects the step before to have left, with its change."""
        self.integrator.prepare(self.dual_state, self.dual_force, time, self.dual_sum.add_up)

    def launch(self, time: float, dt: float, first: int, last: int) -> None:
        """One kernel for all copies and steps."""
        if self.lanes is not None:
            with explicit_vectors():
                self._advance_lanes(time, dt, first, last, -(-self.used // self.lanes.lane_count))
        elif self.state.replica_count == 1:
            self._advance_one(time, dt, first, last)
        else:
            self._advance_all(time, dt, first, last, self.used)

    def destroy(self) -> None:
        """Free the memory of the lanes."""
        if self.lanes is not None:
            self.lanes.destroy()

    @ti.kernel
    def _advance_lanes(self, time: float, dt: float, begin: ti.i32, end: ti.i32, blocks: ti.i32):
        for q in range(blocks * self.grain):
            if is_heavy(q, self.grain):
                block = q // self.grain
                self.dual_force.at_replica(block * self.lanes.lane_count, self.lanes.lane_count)
                self.lanes.gather(block)
                first = block * self.state.particle_count
                for s in range(begin, end):
                    now, step = parameter(self.dual_lanes, time + s * dt), parameter(self.dual_lanes, dt)
                    self.integrator.step(self.dual_lanes, self.dual_force, first, now, step, "serial")
                    self.meter.measure_lanes(self.lanes, block, dt)
                self.lanes.scatter(block)

    @ti.kernel
    def _advance_one(self, time: float, dt: float, begin: ti.i32, end: ti.i32):
        ti.loop_config(serialize=True)
        for s in range(begin, end):
            now, step = parameter(self.dual_state, time + s * dt), parameter(self.dual_state, dt)
            self.integrator.step(self.dual_state, self.dual_force, 0, now, step, "serial")
            self.meter.measure(0, dt)

    @ti.kernel
    def _advance_all(self, time: float, dt: float, begin: ti.i32, end: ti.i32, used: ti.i32):
        # On a GPU the number is a part of the kernel: another kernel would round in another way.
        count = used if ti.static(self.grain > 1) else self.state.replica_count
        for q in range(count * self.grain):
            if is_heavy(q, self.grain):
                replica = q // self.grain
                self.dual_force.at_replica(replica)
                first = replica * self.state.particle_count
                for s in range(begin, end):
                    now, step = parameter(self.dual_state, time + s * dt), parameter(self.dual_state, dt)
                    self.integrator.step(self.dual_state, self.dual_force, first, now, step, "serial")
                    self.meter.measure(replica, dt)
