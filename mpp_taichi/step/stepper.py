"""Stepper: the short kernels around the one step, one for each execution plan (see plans.py)."""

from contextlib import AbstractContextManager, nullcontext
from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.arithmetic.low_parts import step_parts
from mpp_taichi.contacts._base import ContactSolver
from mpp_taichi.device.fast_taichi.explicit_vectors import explicit_vectors
from mpp_taichi.device.fast_taichi.quick_compilation import quick_compilation
from mpp_taichi.device.fast_taichi.serial_loops import FEW, SerialLoops
from mpp_taichi.forces._total_force import TotalForce
from mpp_taichi.integrators._base import Integrator
from mpp_taichi.solvers.report import SolverReport
from mpp_taichi.state.state import State
from mpp_taichi.types import Template

# A parallel CPU loop of up to this many iterations runs on one thread, so few heavy iterations are spread out this far.
CPU_GRAIN = 512


@ti.data_oriented
class Stepper:
    """The kernels of one simulation: its state, forces and integrator under one plan."""

    def __init__(
        self,
        state: State,
        total_force: TotalForce,
        integrator: Integrator,
        *,
        plan: str,
        on_cpu: bool,
        contacts: ContactSolver | None = None,
    ):
        """Bind the parts; nothing is compiled before the first launch."""
        self.contacts = contacts
        self.state = state
        self.total_force = total_force
        self.integrator = integrator
        self.plan = plan
        # The pair sum of the CPU is compiled in a mode of its own, and a tree is many kernels: none of them fits into the step.
        self.launches_stages = plan == "parallel" and total_force.has_pairs and (on_cpu or total_force.by_tree)
        self.pairs_alone = self.launches_stages and total_force.is_symmetric_alone(state)
        self.in_vectors = plan != "parallel" and on_cpu and integrator.in_vectors(state, total_force)
        few_on_cpu = on_cpu and state.particle_count <= FEW
        self.few = few_on_cpu and self.launches_stages and not total_force.bonds
        self.stage_loops = SerialLoops() if self.few else nullcontext()
        self.contact_loops = SerialLoops() if few_on_cpu and contacts is not None else nullcontext()
        self.grain = CPU_GRAIN if on_cpu else 1
        self._bad: Any = ti.field(ti.i32, shape=())
        self._parts_of: float | None = None  # the dt whose parts the state has
        self._control: tuple[float, float] | None = None

    def prepare(self, time: float) -> None:
        """Compute the force that the first step expects to find, after the state was set from outside."""
        self.integrator.adopt(self.state)
        if self.integrator.implicit:
            self.integrator.fill(self.state)
            for field in (self.state.history_dt, self.state.unsolved):
                field.fill(0)
        if self.integrator.keeps_force:
            force = self.integrator.starting_force(self.total_force)
            self.integrator.prepare(self.state, lambda: self.sum_forces(force, time))
            if self.integrator.implicit:
                self._start_implicit(force, time)
        self.integrator.arrange(self.state)
        if self.integrator.adaptive:
            control = self.integrator.control()
            if control != self._control:
                self.integrator.set_control(self.state)
                self._control = control
            with quick_compilation() if self.integrator.quickly_compiled else nullcontext():
                self._begin_adaptive(time, self.integrator.dt)
        if self.contacts is not None:
            self.contacts.prepare(time)

    def sum_forces(self, force: TotalForce, time: float) -> None:
        """Accelerations by the forces that do not depend on velocity, as the plan sums them."""
        if self.plan == "parallel":
            self.launch_force(force, time)
        else:
            with self._vectors():
                self._prepare_replicas(force, time)

    def advance(self, time: float, dt: float, steps: int, meter: Any = None, *, first: int = 0) -> None:
        """Advance by `steps` steps of `dt`, the `first` of them so many after `time`; a `meter` of powers looks on after each.

        Step s begins at time + s dt whatever launch it is in, so that no bit of a force that depends on time does either.
        """
        if self.state.carries_low and dt != self._parts_of:
            self.state.step_parts.from_numpy(self._parts(dt))
            self._parts_of = dt
        with quick_compilation() if self.integrator.quickly_compiled else nullcontext():
            self._advance(time, dt, first, first + steps, meter)

    def _advance(self, time: float, dt: float, first: int, last: int, meter: Any) -> None:
        """Steps first … last − 1."""
        if meter and meter.in_kernel and not self.integrator.adaptive and not self.integrator.own_state:
            self._advance_metered(time, dt, first, last, meter)
        elif meter:
            for s in range(first, last):
                self._advance(time, dt, s, s + 1, None)
                meter.keep(s - first, time + (s + 1) * dt)
        elif self.contacts is not None and self.contacts.flies:
            self.contacts.advance(time + first * dt, (last - first) * dt)
        elif self.contacts is not None and self.contacts.leads:
            self.contacts.lead(time + first * dt, dt, last - first)
        elif self.contacts is not None:
            for s in range(first, last):
                self._step_with_contacts(self.contacts, time + s * dt, dt)
            with self.contact_loops:
                self.contacts.write_back()
        elif self.integrator.adaptive:
            with self._vectors():
                self._advance_adaptive(time + last * dt)
        elif self.integrator.own_state:
            self._launch_own(dt, last - first, 0.0)
        elif self.plan == "serial":
            with self._vectors():
                self._advance_serial(time, dt, first, last)
        elif self.plan == "replicas":
            with self._vectors():
                self._advance_replicas(time, dt, first, last)
        elif self.integrator.implicit:
            for s in range(first, last):
                self.integrator.launch_step(self.state, self.total_force, self.launch_force, time + s * dt, dt)
        elif self.launches_stages or self.integrator.looks_stages_up(self.total_force):
            joins = self.integrator.joins_steps(self.total_force)
            for s in range(first, last):
                self._launch_stages(time + s * dt, dt, begins=s == first or not joins, joins=joins, opens=s + 1 < last)
        elif self.integrator.joins_steps(self.total_force):
            self._open(time + first * dt, dt)
            for s in range(first, last):
                self._step_on(time + s * dt, dt, int(s + 1 < last))
        else:
            for s in range(first, last):
                self._advance_parallel(time + s * dt, dt)

    def _vectors(self) -> AbstractContextManager:
        """How a kernel is compiled in which one thread sums the forces of a system."""
        return explicit_vectors() if self.in_vectors else nullcontext()

    def _parts(self, dt: float) -> np.ndarray:
        return np.tile(step_parts(self.integrator.step_numbers(dt)), (self.state.replica_count, 1))

    def launches_per_step(self) -> int | None:
        """Parallel loops started in one step; a serial or replica launch holds many steps and counts as none.

        None where contacts are resolved, under the parallel plan of an implicit method, and with a tree: as many as it takes.
        """
        if self.contacts is not None or self.total_force.by_tree:
            return None
        if self.plan != "parallel":
            return 0
        if self.integrator.implicit:
            return None
        force = 0 if self.pairs_alone or self.few else 1
        if self.total_force.has_pairs:
            force += self.total_force.pair_loops(self.state) + (self.state.has_fixed_axes and not self.few)
        if self.few:
            return (self.integrator.evaluations if self.integrator.wants_sum(self.total_force) else 0) * force
        sums = self.integrator.evaluations if self.integrator.wants_sum(self.total_force) else 0
        opening = 1 if self.integrator.joins_steps(self.total_force) else 0
        return sums * force + sum(
            self.integrator.loops(k, self.total_force) for k in range(opening, self.integrator.evaluations + 1)
        )

    def loop_iterations_per_step(self) -> int:
        """Loop iterations of one thread in one step of a serial or replica kernel, an upper bound."""
        n = self.state.particle_count
        springs = self.state.spring_neighbor.shape[0] if hasattr(self.state, "spring_neighbor") else 0
        per_evaluation = (n * n if self.total_force.has_pairs else 0) + springs + 8 * n
        return 1 + max(1, self.integrator.evaluations) * per_evaluation

    def _step_with_contacts(self, contacts: ContactSolver, time: float, dt: float) -> None:
        """One step in which contacts are resolved on the way of each drift."""
        for k, (node, kick, drift) in enumerate(self.integrator.entries):
            if kick != 0.0 and self.total_force.forces:
                if k > 0 and self.launches_stages:
                    self.launch_force(self.total_force, time + node * dt)
                with self.contact_loops, self._vectors():
                    self._kick(time, dt, k, "launched" if self.launches_stages else self.plan)
            if drift != 0.0:
                with self.contact_loops:
                    contacts.drift(self.state, time + node * dt, drift * dt)

    @ti.kernel
    def _kick(self, time: float, dt: float, k: Template, shape: Template):
        if ti.static(shape == "serial"):
            ti.loop_config(serialize=True)
            for _ in range(1):
                self.integrator.kick_stage(self.state, self.total_force, 0, time, dt, k, shape)
        else:
            self.integrator.kick_stage(self.state, self.total_force, 0, time, dt, k, shape)

    @ti.kernel
    def _advance_serial(self, time: float, dt: float, begin: ti.i32, end: ti.i32):
        ti.loop_config(serialize=True)
        for s in range(begin, end):
            self.integrator.step(self.state, self.total_force, 0, time + s * dt, dt, "serial")

    @ti.kernel
    def _advance_metered(self, time: float, dt: float, begin: ti.i32, end: ti.i32, meter: ti.template()):
        ti.loop_config(serialize=True)
        for s in range(begin, end):
            self.integrator.step(self.state, self.total_force, 0, time + s * dt, dt, "serial")
            meter.store(s - begin, 0, time + (s + 1) * dt)

    @ti.kernel
    def _advance_parallel(self, time: float, dt: float):
        self.integrator.step(self.state, self.total_force, 0, time, dt, "parallel")

    @ti.kernel
    def _open(self, time: float, dt: float):
        self.integrator.stage(self.state, self.total_force, 0, time, dt, 0)

    @ti.kernel
    def _step_on(self, time: float, dt: float, opens: ti.i32):
        self.integrator.step_on(self.state, self.total_force, 0, time, dt, "parallel", True, opens)

    @ti.kernel
    def _advance_replicas(self, time: float, dt: float, begin: ti.i32, end: ti.i32):
        for q in range(self.state.replica_count * self.grain):
            if q % self.grain == 0:
                first = q // self.grain * self.state.particle_count
                for s in range(begin, end):
                    self.integrator.step(self.state, self.total_force, first, time + s * dt, dt, "serial")

    @ti.kernel
    def _begin_adaptive(self, time: ti.f64, dt: ti.f64):
        if ti.static(self.plan == "serial"):
            ti.loop_config(serialize=True)  # no other thread is woken
            for _ in range(1):
                self.integrator.begin(self.state, self.total_force, 0, time, dt, "serial")
        else:
            for q in range(self.state.replica_count * self.grain):
                if q % self.grain == 0:
                    first = q // self.grain * self.state.particle_count
                    self.integrator.begin(self.state, self.total_force, first, time, dt, "serial")

    @ti.kernel
    def _advance_adaptive(self, end: ti.f64):
        if ti.static(self.plan == "serial"):
            ti.loop_config(serialize=True)
            for _ in range(1):
                self.integrator.advance_to(self.state, self.total_force, 0, end, "serial")
                self.integrator.show(self.state, self.total_force, 0, end)
        else:
            for q in range(self.state.replica_count * self.grain):
                if q % self.grain == 0:
                    first = q // self.grain * self.state.particle_count
                    self.integrator.advance_to(self.state, self.total_force, first, end, "serial")
                    self.integrator.show(self.state, self.total_force, first, end)

    @ti.kernel
    def _launch_own(self, dt: float, steps: ti.i32, beyond: float):
        for q in range(self.state.replica_count * self.grain):
            if q % self.grain == 0:
                first = q // self.grain * self.state.particle_count
                self.integrator.launch(self.state, self.total_force, first, dt, steps, beyond)

    def _launch_stages(self, time: float, dt: float, *, begins: bool, joins: bool, opens: bool) -> None:
        """The step's own stages and forces, each a launch; where steps are joined the last one `opens` the next step."""
        if begins:
            with self.stage_loops:
                self._stage(time, dt, 0)
        for k, node in enumerate(self.integrator.nodes):
            if self.integrator.wants_sum(self.total_force):
                self.launch_force(self.total_force, time + node * dt)
            with self.stage_loops:
                if self.integrator.looks_stages_up(self.total_force):
                    self._stage_after_force(time, dt, k + 1)
                elif joins and k == self.integrator.evaluations - 1:
                    self._stage_and_opening(time, dt, int(opens))
                else:
                    self._stage(time, dt, k + 1)

    def launch_force(self, total_force: TotalForce, time: float) -> None:
        """Accelerations by the forces that do not depend on velocity, all particles at once."""
        if self.launches_stages and total_force.has_pairs:
            if self.pairs_alone and total_force is self.total_force:
                total_force.pair_sum.set_accelerations(self.state)
            else:
                with self.stage_loops:
                    self._begin_sum(total_force, time)
                total_force.pair_sum.add_accelerations(self.state)
            if self.state.has_fixed_axes:
                with self.stage_loops:
                    self._end_sum(total_force)
        else:
            self._accumulate_parallel(total_force, time)

    @ti.kernel
    def _stage(self, time: float, dt: float, k: Template):
        self.integrator.stage(self.state, self.total_force, 0, time, dt, k)

    @ti.kernel
    def _stage_and_opening(self, time: float, dt: float, opens: ti.i32):
        self.integrator.stage_and_opening(self.state, self.total_force, 0, time, dt, opens)

    @ti.kernel
    def _stage_after_force(self, time: float, dt: float, k: ti.i32):
        self.integrator.stage_after_force(self.state, self.total_force, 0, time, dt, k)

    @ti.kernel
    def _begin_sum(self, total_force: Template, time: float):
        total_force.begin_sum(self.state, 0, time)

    @ti.kernel
    def _end_sum(self, total_force: Template):
        total_force.end_sum(self.state, 0)

    @ti.kernel
    def _accumulate_parallel(self, total_force: Template, time: float):
        total_force.accumulate(self.state, 0, time, "parallel")

    @ti.kernel
    def _prepare_replicas(self, total_force: Template, time: float):
        for q in range(self.state.replica_count * self.grain):
            if q % self.grain == 0:
                first = q // self.grain * self.state.particle_count
                total_force.accumulate(self.state, first, time, "serial")

    @ti.kernel
    def _start_implicit(self, total_force: Template, time: float):
        for i in range(self.state.total_count):
            first = i // self.state.particle_count * self.state.particle_count
            self.integrator.start(self.state, total_force, first, i, time)

    def solver_report(self) -> SolverReport:
        """What the solver of an implicit step did since the last time it was asked."""
        return self.integrator.newton.collect(self.state)

    def look_ahead(self, dt: float, share: float) -> None:
        """Show the state of a method that has its own as it is a part of a step later; it stays where it is."""
        self._launch_own(dt, 0, share)

    def lost_particle(self) -> int:
        """Index of a particle whose orbit a method of orbits has not found, or −1."""
        return self.integrator.unsolved_particle(self.state) if self.integrator.own_state else -1

    def stalled_particle(self) -> int:
        """Index of the most accelerated particle of a replica whose adaptive step has become too short, or −1."""
        stalled = self.integrator.stalled_replicas(self.state)
        if not len(stalled):
            return -1
        first = int(stalled[0]) * self.state.particle_count
        found = self.integrator.accelerations(self.state)[first : first + self.state.particle_count]
        size = np.linalg.norm(found, axis=1)
        return first + int(np.argmax(np.nan_to_num(size, nan=np.inf)))

    def adaptive_time(self) -> float:
        """End of the last step of an adaptive method, of the replica that is least far."""
        return float(self.integrator.times(self.state).min())

    def least_solved_particle(self) -> int:
        """Index of the particle whose last update was the largest, over all replicas."""
        update = self.state.update.to_numpy()
        return int(np.argmax(np.nan_to_num(np.abs(update).max(axis=1), nan=np.inf)))

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
