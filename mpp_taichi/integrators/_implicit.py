"""Implicit methods: one equation for the end or the middle of the step, solved by Newton's method."""

from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.arithmetic.ordering import bandwidth, narrow_order
from mpp_taichi.device import bulk_copy
from mpp_taichi.device.fast_taichi.serial_loops import is_short
from mpp_taichi.integrators._base import Integrator, SumForces
from mpp_taichi.integrators._launchers import Launchers
from mpp_taichi.integrators._trouble import Trouble, not_finite
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.solvers._sums import dot, read_total, reduce_terms, sum_fields
from mpp_taichi.solvers.banded import Banded
from mpp_taichi.solvers.conjugate_gradients import ConjugateGradients
from mpp_taichi.solvers.newton import Newton
from mpp_taichi.solvers.newton_matrix import NewtonMatrix
from mpp_taichi.solvers.report import SolverReport
from mpp_taichi.types import Template

# Half-bandwidth w, in particles, up to which a banded factorization in one thread is faster than conjugate gradients on a CPU:
# it costs some 27 (w + 1)² ns a particle; an iteration costs 40 ns, and stiff networks need fifty iterations and more.
WIDEST_BAND = 8
MOST_PIECES = 1024  # into which a step is cut at most
GUARD_ROOM = {ti.f32: 1e-5, ti.f64: 1e-12}  # relative rounding error of the energy


@ti.data_oriented
class Implicit(Integrator):
    """A step that solves an equation for the displacement P of its stage,

        x = x* + P,  v = v* + (g/b) P,  P = b a(x, v, t + node·dt),  b = beta·dt², g = gamma·dt.

    A method declares beta, gamma and node. It sets the bases x*, v* from the start of the step (`begin`), and the end of the
    step from P (`finish`). Positions are kept as a start and a shift from the start, so that a step rounds them once. All of
    these methods are stable for springs of any stiffness. They differ in their treatment of oscillations that a step cannot
    resolve: see `amplification`.

    A step whose equations Newton's method does not solve is repeated in two pieces, in four, and so on. A step that gains
    energy, of a method that never should (`never_gains_energy`), is repeated in the same way: it gains energy where a spring is
    pushed through zero length. Cut steps are counted. A step that MOST_PIECES pieces do not solve ends the run.
    """

    launchers = Launchers(parallel="parallel_implicit", quickly=True)
    stable_for_any_stiffness = True
    keeps_force = False  # a step uses, at its start, an acceleration that the step before ended with; `start` takes the first
    beta = 1.0
    gamma = 1.0
    node = 1.0
    never_gains_energy = False  # where forces only conserve or dissipate, and the potential is convex between start and end
    has_soft_forces = False  # whether some forces act in kicks, outside the equation
    extra_vectors: tuple = ()  # names of vector fields of the method's own
    solver = "auto"
    tolerance: Any = None
    _collected = SolverReport()  # the last report

    def scratch_count(self, velocity_dependent: bool) -> int:
        """None: all fields are work fields."""
        return 0

    def loops(self, k: int, total_force: Any) -> int:
        """Not known beforehand; 0 stands for that."""
        return 0

    def implicit_part(self, total_force: Any) -> Any:
        """The forces of the equation: all forces, unless a method leaves some to kicks."""
        return total_force

    def work_fields(self, total_force: Any, start: Snapshot, *, plan: str, on_cpu: bool) -> dict[str, tuple[str, int]]:
        """Choose the linear solver, and list the fields of the method, of Newton's method and of the linear solver."""
        part = self.implicit_part(total_force)
        matrix = NewtonMatrix(part, total_force.dimensions, 2 * len(start.springs))
        linear = self._linear_solver(matrix, start, on_cpu)
        self.newton = Newton(matrix, linear, self.tolerance, reversible=self.time_reversible)
        own = ("position", "velocity", *self.extra_vectors)
        vectors = {name: ("vector", start.particle_count) for name in (*self.extra_vectors, *(f"start_{name}" for name in own))}
        sums = sum_fields(start.particle_count) if plan == "parallel" else {}
        watched = total_force.gains_no_energy and bool(total_force.bonds) and not total_force.has_pairs
        self.guards_energy = self.never_gains_energy and watched
        self.memory = (*self.extra_vectors, "history_dt")
        self.guard_room = GUARD_ROOM[ti.lang.impl.current_cfg().default_fp]
        return {**self.newton.fields(), **vectors, **sums, "history_dt": ("scalar", 1)}

    def _linear_solver(self, matrix: NewtonMatrix, start: Snapshot, on_cpu: bool) -> Any:
        if self.solver == "conjugate_gradients" or (self.solver == "auto" and not on_cpu):
            return ConjugateGradients(matrix)
        order = narrow_order(start.particle_count, start.springs.between)
        if self.solver == "auto" and bandwidth(order, start.springs.between) > WIDEST_BAND:
            return ConjugateGradients(matrix)
        return Banded(matrix, order, start.springs.between)

    @property
    def evaluations_per_step(self) -> int | None:
        """Not known beforehand: as many as the equations of the step need."""
        return None

    def starting_force(self, total_force: Any) -> Any:
        """The forces whose accelerations `start` keeps."""
        return total_force

    def arrange(self, state: Any) -> None:
        """Give the work fields their first values: there is no earlier step, and no replica stands still."""
        state.extras = tuple(getattr(state, name) for name in self.extra_vectors)
        state.starts = tuple(getattr(state, f"start_{name}") for name in self.extra_vectors)
        if isinstance(self.newton.linear, Banded):
            bulk_copy.write([state.place], [np.tile(self.newton.linear.order, state.replica_count).astype(np.int32)])
        bulk_copy.clear((state.history_dt, state.unsolved))

    def prepare(self, state: Any, total_force: Any, time: float, sum_forces: SumForces) -> None:
        """The acceleration that the first step begins with."""
        if self.keeps_force:
            force = self.starting_force(total_force)
            sum_forces(force, time)
            self._start(state, force, time)

    def collect(self, state: Any) -> SolverReport | None:
        """The counts of Newton's method since the last call."""
        self._collected = self.newton.collect(state)
        return self._collected

    standing_reason = "the equations of a step were not solved"

    def standing_replicas(self, state: Any) -> np.ndarray:
        """The replicas that have stood still since one of their steps was not solved."""
        return np.flatnonzero(state.unsolved.to_numpy())

    def trouble(self, state: Any, bad: int) -> Trouble | None:
        """A step that the last `collect` counted as unsolved, of the particle whose last update was the largest."""
        if not self._collected.unsolved:
            return not_finite(bad)
        update = np.nan_to_num(np.abs(state.update.to_numpy()).max(axis=1), nan=np.inf)
        return Trouble("unsolved", int(np.argmax(update)), steps=self._collected.fewest_steps)

    def clear_trouble(self, state: Any) -> None:
        """No replica stands still any more."""
        bulk_copy.clear((state.unsolved,))

    def facts(self, state: Any) -> dict[str, Any]:
        """The linear solver that was chosen."""
        return {"linear_solver": type(self.newton.linear).__name__}

    @ti.func
    def start(self, state: Template, total_force: Template, first, i, time):
        """Keep the acceleration that the first step begins with, from the sum of `starting_force`."""

    @ti.func
    def coefficients(self, state: Template, first, dt):
        """(b, g), in a kernel."""
        return self.beta * dt * dt, self.gamma * dt

    @ti.func
    def begin(self, state: Template, i, dt, b):
        """Set base_shift and base_velocity."""

    @ti.func
    def finish(self, state: Template, i, dt, b, g):
        """Set position and velocity from the bases and P = shift."""

    @ti.func
    def kick(self, state: Template, i, dt):
        """Kick particle i after the step by the soft forces, whose accelerations are known then."""

    # One thread

    @ti.func
    def step(self, state: Template, total_force: Template, first, time: Template, dt: Template, shape: Template):
        """Advance from `time` to `time + dt`, in pieces where necessary; a replica whose step is not solved stands still."""
        replica = first // total_force.particle_count
        if state.unsolved[replica] == 0:
            end = first + total_force.particle_count
            for i in range(first, end):
                self.remember(state, i)
            history = state.history_dt[replica]
            pieces = 1
            solved = 0
            while solved == 0 and state.unsolved[replica] == 0:
                h = dt / pieces
                done = 0
                solved = 1
                while solved == 1 and done < pieces:
                    solved = self.attempt(state, total_force, first, time + done * h, h, pieces >= MOST_PIECES)
                    done += 1
                if solved == 0:
                    for i in range(first, end):
                        self.go_back(state, i)
                    state.history_dt[replica] = history
                    if pieces >= MOST_PIECES:
                        state.unsolved[replica] = 1
                    pieces *= 2
            if solved == 1:
                state.solved_steps[replica] = state.solved_steps[replica] + 1
                if pieces > 1:
                    state.cut_steps[replica] = state.cut_steps[replica] + 1

    @ti.func
    def attempt(self, state: Template, total_force: Template, first, time, dt, last_chance):
        """One step or a piece of it; 1 if its equations were solved, and it gained no energy where no force can give any.

        The smallest pieces (`last_chance`) may gain energy. Where a spring is pushed through zero length, the gain goes to 0
        with the length of the pieces.
        """
        end = first + total_force.particle_count
        b, g = self.coefficients(state, first, dt)
        before = self.guarded_energy(state, total_force, first, time)
        for i in range(first, end):
            state.piece_start[i] = state.position[i]
            self.begin(state, i, dt, b)
            state.shift[i] = ti.Vector.zero(float, state.dimensions)
        solved = self.newton.solve_serial(state, first, time + self.node * dt, dt, b, g)
        for i in range(first, end):
            self.finish(state, i, dt, b, g)
        state.history_dt[first // total_force.particle_count] = dt
        if ti.static(self.has_soft_forces):
            self.soft.accumulate(state, first, time + dt, "serial")
            for i in range(first, end):
                self.kick(state, i, dt)
        if self.guarded_energy(state, total_force, first, time + dt) > before + self.guard_room * ti.abs(before):
            if last_chance:
                r = first // total_force.particle_count
                state.gaining_pieces[r] = state.gaining_pieces[r] + 1
            else:
                solved = 0
        return solved

    @ti.func
    def guarded_energy(self, state: Template, total_force: Template, first, time):
        """Total energy where energy gains are checked, else 0."""
        result = ti.cast(0.0, state.wide)
        if ti.static(self.guards_energy):
            for i in range(first, first + total_force.particle_count):
                result += self.energy_of(state, total_force, first, i, time)
        return result

    # One particle's part

    @ti.func
    def remember(self, state: Template, i):
        """Keep the particle's state at the start of the step."""
        state.start_position[i] = state.position[i]
        state.start_velocity[i] = state.velocity[i]
        for k in ti.static(range(len(self.extra_vectors))):
            state.starts[k][i] = state.extras[k][i]

    @ti.func
    def go_back(self, state: Template, i):
        """Set the particle back to the start of the step."""
        state.position[i] = state.start_position[i]
        state.velocity[i] = state.start_velocity[i]
        for k in ti.static(range(len(self.extra_vectors))):
            state.extras[k][i] = state.starts[k][i]

    @ti.func
    def energy_of(self, state: Template, total_force: Template, first, i, time):
        """Kinetic and potential energy of particle i; each end of a bond has half of its energy."""
        speed_squared = dot(state, state.velocity[i], state.velocity[i])
        kinetic = 0.5 * ti.cast(self.newton.matrix.weight(state, i), state.wide) * speed_squared
        return kinetic + total_force.potential_energy_of(state, first, i, time)

    # All particles at once

    def launch_step(self, state: Any, total_force: Any, launch_force: Any, time: float, dt: float) -> None:
        """`step` for the parallel plan: the host leads, and each sweep over the particles is a launch."""
        if state.unsolved[0]:
            return
        self._remember(state)
        history = state.history_dt[0]
        pieces, solved = 1, False
        while not solved and pieces <= MOST_PIECES:
            h = dt / pieces
            last = pieces >= MOST_PIECES
            solved = all(self._launch_attempt(state, total_force, launch_force, time + k * h, h, last) for k in range(pieces))
            if not solved:
                self._go_back(state)
                state.history_dt[0] = history
                pieces *= 2
        launched = self.newton.launched
        launched.steps += solved
        launched.fewest_steps += solved
        launched.cut_steps += solved and pieces > 1
        if not solved:
            state.unsolved[0] = 1

    def _launch_attempt(self, state: Any, total_force: Any, launch_force: Any, time: float, dt: float, last: bool) -> bool:
        """`attempt` for the parallel plan."""
        b, g = self.host_coefficients(state, dt)
        before = self._measured_energy(state, total_force, time)
        self._begin(state, dt, b)
        solved = self.newton.solve_parallel(state, launch_force, time + self.node * dt, dt, b, g)
        self._finish(state, dt, b, g)
        if self.has_soft_forces:
            launch_force(self.soft, time + dt)
            self._kick(state, dt)
        gains = self._measured_energy(state, total_force, time + dt) > before + self.guard_room * abs(before)
        self.newton.launched.gaining_pieces += gains and last
        return solved and (last or not gains)

    def host_coefficients(self, state: Any, dt: float) -> tuple[float, float]:
        """(b, g), on the host."""
        return self.beta * dt * dt, self.gamma * dt

    def _measured_energy(self, state: Any, total_force: Any, time: float) -> float:
        if not self.guards_energy:
            return 0.0
        self._measure_energy(state, total_force, time)
        return read_total(state)[0]

    @ti.kernel
    def _start(self, state: Template, total_force: Template, time: float):
        ti.loop_config(serialize=ti.static(is_short(state.total_count)))  # no other thread is woken
        for i in range(state.total_count):
            replica = i // state.particle_count
            total_force.at_replica(replica)
            self.start(state, total_force, replica * state.particle_count, i, time)

    @ti.kernel
    def _remember(self, state: Template):
        for i in range(state.particle_count):
            self.remember(state, i)

    @ti.kernel
    def _go_back(self, state: Template):
        for i in range(state.particle_count):
            self.go_back(state, i)

    @ti.kernel
    def _begin(self, state: Template, dt: float, b: float):
        for i in range(state.particle_count):
            state.piece_start[i] = state.position[i]
            self.begin(state, i, dt, b)
            state.shift[i] = ti.Vector.zero(float, state.dimensions)

    @ti.kernel
    def _finish(self, state: Template, dt: float, b: float, g: float):
        for i in range(state.particle_count):
            self.finish(state, i, dt, b, g)
        for one in range(1):
            state.history_dt[one] = dt

    @ti.kernel
    def _kick(self, state: Template, dt: float):
        for i in range(state.particle_count):
            self.kick(state, i, dt)

    @ti.kernel
    def _measure_energy(self, state: Template, total_force: Template, time: float):
        for i in range(state.particle_count):
            energy = self.energy_of(state, total_force, 0, i, time)
            state.terms[i] = ti.Vector([energy, ti.cast(0.0, state.wide)])
        reduce_terms(state)


def oscillator(frequency: float, damping: float) -> np.ndarray:
    """Matrix M of x' = v, v' = −ω² x − γ v in steps of 1."""
    return np.array([[0.0, 1.0], [-(frequency**2), -damping]])


def trapezoid(frequency: float, damping: float) -> np.ndarray:
    """(1 − M/2)⁻¹ (1 + M/2) with the oscillator's matrix M."""
    half = 0.5 * oscillator(frequency, damping)
    return np.linalg.solve(np.eye(2) - half, np.eye(2) + half)
