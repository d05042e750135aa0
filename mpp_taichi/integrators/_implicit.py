"""Implicit methods: one equation for the end, or a middle, of the step, solved by Newton's method."""

from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.integrators._base import Integrator
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.solvers._sums import sum_fields
from mpp_taichi.solvers.banded import Banded
from mpp_taichi.solvers.conjugate_gradients import ConjugateGradients
from mpp_taichi.solvers.newton import Newton
from mpp_taichi.solvers.newton_matrix import NewtonMatrix
from mpp_taichi.solvers.ordering import bandwidth, narrow_order
from mpp_taichi.types import Template

# Half-bandwidth, in particles, up to which factors in one thread beat conjugate gradients, on a CPU.
WIDEST_BAND = 20


@ti.data_oriented
class Implicit(Integrator):
    """A step that asks for the displacement P of its stage,

        x = x* + P,  v = v* + (g/b) P,  P = b a(x, v, t + node·dt),  b = beta·dt², g = gamma·dt.

    A method says beta, gamma and node, sets the bases x*, v* from the start of the step (`begin`) and the end of the step from
    P (`finish`). All of them are stable for springs of any stiffness; what they make of oscillations that a step cannot resolve
    is their difference: see `amplification`.
    """

    implicit = True
    beta = 1.0
    gamma = 1.0
    node = 1.0
    has_soft_forces = False  # forces left to kicks
    extra_vectors: tuple = ()  # fields of its own
    solver = "auto"
    tolerance: Any = None

    def scratch_count(self, velocity_dependent: bool) -> int:
        """None: its fields are work fields."""
        return 0

    def loops(self, k: int, velocity_dependent: bool) -> int:
        """Unknown beforehand: it iterates."""
        return 0

    def implicit_part(self, total_force: Any) -> Any:
        """The forces of the equation that is solved: all of them."""
        return total_force

    def starting_force(self, total_force: Any) -> Any:
        """The forces that `start` wants to know."""
        return total_force

    def work_fields(self, total_force: Any, start: Snapshot, *, plan: str, on_cpu: bool) -> dict[str, tuple[str, int]]:
        """Choose the linear solver; say which fields it all needs."""
        part = self.implicit_part(total_force)
        matrix = NewtonMatrix(part, total_force.dimensions, 2 * len(start.springs))
        self.newton = Newton(matrix, self._linear_solver(matrix, start, on_cpu), self.tolerance)
        vectors = {name: ("vector", start.particle_count) for name in self.extra_vectors}
        sums = sum_fields(start.particle_count) if plan == "parallel" else {}
        return {**self.newton.fields(), **vectors, **sums, "history_dt": ("scalar", 1)}

    def _linear_solver(self, matrix: NewtonMatrix, start: Snapshot, on_cpu: bool) -> Any:
        if self.solver == "conjugate_gradients" or (self.solver == "auto" and not on_cpu):
            return ConjugateGradients(matrix)
        order = narrow_order(start.particle_count, start.springs.between)
        if self.solver == "auto" and bandwidth(order, start.springs.between) > WIDEST_BAND:
            return ConjugateGradients(matrix)
        return Banded(matrix, order, start.springs.between)

    def fill(self, state: Any) -> None:
        """Give the state's work fields what they begin with."""
        if isinstance(self.newton.linear, Banded):
            state.place.from_numpy(np.tile(self.newton.linear.order, state.replica_count))

    @ti.func
    def start(self, state: Template, total_force: Template, first, i, time):
        """Set what the first step wants to find, from the accelerations of `starting_force`."""

    @ti.func
    def coefficients(self, state: Template, first, dt):
        """(b, g)."""
        return self.beta * dt * dt, self.gamma * dt

    @ti.func
    def begin(self, state: Template, i, dt, b):
        """Set base_position and base_velocity."""

    @ti.func
    def finish(self, state: Template, i, dt, b, g):
        """Set position and velocity from the bases and P = shift."""

    @ti.func
    def kick(self, state: Template, i, dt):
        """After the step, with the accelerations of the soft forces known."""

    @ti.func
    def step(self, state: Template, total_force: Template, first, time: Template, dt: Template, shape: Template):
        """Advance from `time` to `time + dt` in one thread; a replica that could not be solved stands still."""
        if state.unsolved[first // total_force.particle_count] == 0:
            end = first + total_force.particle_count
            b, g = self.coefficients(state, first, dt)
            for i in range(first, end):
                self.begin(state, i, dt, b)
                state.shift[i] = ti.Vector.zero(float, state.dimensions)
            self.newton.solve_serial(state, first, time + self.node * dt, dt, b, g)
            for i in range(first, end):
                self.finish(state, i, dt, b, g)
            state.history_dt[first // total_force.particle_count] = dt
            if ti.static(self.has_soft_forces):
                self.soft.accumulate(state, first, time + dt, "serial")
                for i in range(first, end):
                    self.kick(state, i, dt)

    def launch_step(self, state: Any, launch_force: Any, time: float, dt: float) -> None:
        """The same, all particles at once."""
        if state.unsolved[0]:
            return
        b, g = self.host_coefficients(state, dt)
        self._begin(state, dt, b)
        self.newton.solve_parallel(state, launch_force, time + self.node * dt, dt, b, g)
        self._finish(state, dt, b, g)
        if self.has_soft_forces:
            launch_force(self.soft, time + dt)
            self._kick(state, dt)

    def host_coefficients(self, state: Any, dt: float) -> tuple[float, float]:
        """(b, g), on the host."""
        return self.beta * dt * dt, self.gamma * dt

    @ti.kernel
    def _begin(self, state: Template, dt: float, b: float):
        for i in range(state.particle_count):
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


def oscillator(frequency: float, damping: float) -> np.ndarray:
    """Matrix M of x' = v, v' = −ω² x − γ v in steps of 1."""
    return np.array([[0.0, 1.0], [-(frequency**2), -damping]])


def trapezoid(frequency: float, damping: float) -> np.ndarray:
    """(1 − M/2)⁻¹ (1 + M/2) with the oscillator's matrix M."""
    half = 0.5 * oscillator(frequency, damping)
    return np.linalg.solve(np.eye(2) - half, np.eye(2) + half)
