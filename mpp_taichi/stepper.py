"""Stepper: the short kernels around the one step, one for each execution plan (see plans.py)."""

from typing import Any

import taichi as ti

from mpp_taichi.integrators._base import Integrator
from mpp_taichi.state import State
from mpp_taichi.total_force import TotalForce

# A parallel CPU loop of up to this many iterations runs on one thread, so few heavy iterations are spread out this far.
CPU_GRAIN = 512


@ti.data_oriented
class Stepper:
    """The kernels of one simulation: its state, forces and integrator under one plan."""

    def __init__(self, state: State, total_force: TotalForce, integrator: Integrator, *, plan: str, on_cpu: bool):
        """Bind the parts; nothing is compiled before the first launch."""
        self.state = state
        self.total_force = total_force
        self.integrator = integrator
        self.plan = plan
        self.parallel_shape = "lanes" if on_cpu else "gather"
        self.grain = CPU_GRAIN if on_cpu else 1
        self._bad: Any = ti.field(ti.i32, shape=())

    def prepare(self, time: float) -> None:
        """Run the integrator's `prepare`, after the state was set from outside."""
        if self.plan == "parallel":
            self._prepare_parallel(time)
        else:
            self._prepare_replicas(time)

    def advance(self, time: float, dt: float, steps: int) -> None:
        """Advance by `steps` steps of `dt` from `time`."""
        if self.plan == "serial":
            self._advance_serial(time, dt, steps)
        elif self.plan == "replicas":
            self._advance_replicas(time, dt, steps)
        else:
            for s in range(steps):
                self._advance_parallel(time + s * dt, dt)

    def loop_iterations_per_step(self) -> int:
        """Loop iterations of one thread in one step of a serial or replica kernel, an upper bound."""
        n = self.state.particle_count
        springs = self.state.spring_neighbor.shape[0] if hasattr(self.state, "spring_neighbor") else 0
        per_evaluation = (n * n if self.total_force.has_pairs else 0) + springs + 8 * n
        return 1 + max(1, self.integrator.evaluations) * per_evaluation

    @ti.kernel
    def _advance_serial(self, time: float, dt: float, steps: ti.i32):
        ti.loop_config(serialize=True)
        for s in range(steps):
            self.integrator.step(self.state, self.total_force, 0, time + s * dt, dt, "serial")

    @ti.kernel
    def _advance_parallel(self, time: float, dt: float):
        self.integrator.step(self.state, self.total_force, 0, time, dt, self.parallel_shape)

    @ti.kernel
    def _advance_replicas(self, time: float, dt: float, steps: ti.i32):
        for q in range(self.state.replica_count * self.grain):
            if q % self.grain == 0:
                first = q // self.grain * self.state.particle_count
                for s in range(steps):
                    self.integrator.step(self.state, self.total_force, first, time + s * dt, dt, "serial")

    @ti.kernel
    def _prepare_parallel(self, time: float):
        self.integrator.prepare(self.state, self.total_force, 0, time, self.parallel_shape)

    @ti.kernel
    def _prepare_replicas(self, time: float):
        for q in range(self.state.replica_count * self.grain):
            if q % self.grain == 0:
                first = q // self.grain * self.state.particle_count
                self.integrator.prepare(self.state, self.total_force, first, time, "serial")

    def first_bad_particle(self) -> int:
        """Index of the first particle whose position or velocity is not finite, or −1."""
        self._bad[None] = self.state.total_count
        self._find_bad()
        found = int(self._bad[None])
        return found if found < self.state.total_count else -1

    @ti.kernel
    def _find_bad(self):
        for i in range(self.state.total_count):
            bad = False
            for k in ti.static(range(self.state.dimensions)):
                x = self.state.position[i][k]
                v = self.state.velocity[i][k]
                # Comparisons with itself are folded away by the compiler; these are not.
                if ti.math.isnan(x) or ti.math.isinf(x) or ti.math.isnan(v) or ti.math.isinf(v):
                    bad = True
            if bad:
                ti.atomic_min(self._bad[None], i)
