"""Hermite schemes: predict, evaluate forces with their derivatives, correct; one text for both orders."""

import math
from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.integrators._base import Integrator, SumForces
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.types import Template


@ti.pyfunc
def integral4(h, f0, f1, g0, g1):
    """∫ f over a step, f and its derivative g given at both ends; error of order h⁵."""
    return 0.5 * h * (f0 + f1) + h * h / 12.0 * (g0 - g1)


@ti.pyfunc
def integral6(h, f0, f1, g0, g1, k0, k1):
    """∫ f over a step, f and its derivatives g and k given at both ends; error of order h⁷."""
    return 0.5 * h * (f0 + f1) + (h * h / 10.0 * (g0 - g1) + h * h * h / 120.0 * (k0 + k1))


@ti.pyfunc
def last_derivative(h, f0, f1, g0, g1, k0, k1):
    """Third derivative, at the end, of the polynomial of fifth degree through these."""
    return (60.0 * (f1 - f0) - h * (36.0 * g1 + 24.0 * g0) + h * h * (9.0 * k1 - 3.0 * k0)) / (h * h * h)


class Hermite(Integrator):
    """P(EC)ⁿ with Hermite's interpolation between both ends of a step, h = dt:

        fourth order   v₁ = v₀ + h/2 (a₀ + a₁) + h²/12 (j₀ − j₁),   x₁ = x₀ + h/2 (v₀ + v₁) + h²/12 (a₀ − a₁)
        sixth order    v₁ = v₀ + h/2 (a₀ + a₁) + h²/10 (j₀ − j₁) + h³/120 (s₀ + s₁),
                       x₁ = x₀ + h/2 (v₀ + v₁) + h²/10 (a₀ − a₁) + h³/120 (j₀ + j₁)

    The first a₁, j₁, s₁ are evaluated where Taylor's series predicts the particles. The series ends with the jerk, or in sixth
    order with the crackle of the polynomial of the step before. The last evaluation of a step serves the next step, so that a
    step costs as many evaluations as there are `corrections`. The snap of a particle depends on its own acceleration: the snap
    is computed with the acceleration that was known before the sum, either predicted or of the evaluation before. With many
    corrections the scheme is implicit and symmetric in time; two corrections come near to that, and the energy error of a
    regular motion hardly drifts.
    """

    takes_velocity = False
    typical_evaluations = 6

    @property
    def nodes(self) -> tuple:
        """Every evaluation is at the end of the step."""
        return (1.0,) * self.corrections

    @property
    def found(self) -> tuple[str, ...]:
        """Names of the fields that are summed: acceleration, jerk, snap."""
        return ("acceleration", "jerk", "snap")[: self.derivatives + 1]

    @property
    def memory(self) -> tuple[str, ...]:
        """The last evaluation, which lies at the positions before the last correction, and the crackle."""
        return (*self.found, "crackle") if self.derivatives > 1 else self.found

    def scratch_count(self, velocity_dependent: bool) -> int:
        """None: its fields are work fields with names."""
        return 0

    def work_fields(self, total_force: Any, start: Snapshot, *, plan: str, on_cpu: bool) -> dict[str, tuple[str, int]]:
        """Derivatives that are summed, and the state and derivatives at the start of the step."""
        names = ["start_position", "start_velocity", *(f"start_{name}" for name in self.found), *self.found[1:]]
        if self.derivatives > 1:
            names += ["crackle", "estimate"]
        return {name: ("vector", start.particle_count) for name in names}

    def prepare(self, state: Any, total_force: Any, time: float, sum_forces: SumForces) -> None:
        """Sum the forces at the start of the first step, twice for the snap, which needs the accelerations of the first sum.

        The crackle, which comes from the step before, is set to zero.
        """
        sum_forces(total_force, time)
        if self.derivatives > 1:
            state.estimate.copy_from(state.acceleration)
            state.crackle.fill(0.0)
            sum_forces(total_force, time)

    def wants_sum(self, total_force: Any) -> bool:
        """Always, as every stage needs the derivatives."""
        return True

    def loops(self, k: int, total_force: Any) -> int:
        """Every stage is one loop."""
        return 1

    def amplification(self, frequency: float, damping: float = 0.0) -> np.ndarray:
        """Matrix of the longer state x, dt v, dt² a, dt³ j and in sixth order dt⁴ s, dt⁵ c, the derivatives as last evaluated.

        ValueError with damping, which the method does not take.
        """
        if damping != 0.0:
            raise ValueError(f"{type(self).__name__} takes no forces that depend on velocity")
        w = frequency**2
        size = 6 if self.derivatives > 1 else 4
        start = np.eye(size)  # row k: the k-th derivative
        x, v, estimate = (sum(start[k] / math.factorial(k - m) for k in range(m, size)) for m in range(3))
        s, c = start[0], start[0]
        for _ in range(self.corrections):
            a, j = -w * x, -w * v
            if self.derivatives > 1:
                s, estimate = -w * estimate, a
                v = start[1] + integral6(1.0, start[2], a, start[3], j, start[4], s)
                x = start[0] + integral6(1.0, start[1], v, start[2], a, start[3], j)
                c = last_derivative(1.0, start[2], a, start[3], j, start[4], s)
            else:
                v = start[1] + integral4(1.0, start[2], a, start[3], j)
                x = start[0] + integral4(1.0, start[1], v, start[2], a)
        return np.array([x, v, a, j, s, c][:size])

    @ti.func
    def stage(self, state: Template, total_force: Template, first, time: Template, dt: Template, k: Template):
        """Prediction of the end of the step, then a correction after each evaluation there."""
        if ti.static(k == 0):
            self.predict(state, total_force, first, dt)
        else:
            self.correct(state, total_force, first, dt)

    @ti.func
    def stage_after_force(self, state: Template, total_force: Template, first, time: Template, dt: Template, k):
        """A correction; all corrections are the same."""
        self.correct(state, total_force, first, dt)

    @ti.func
    def predict(self, state: Template, total_force: Template, first, h: Template):
        """Predict the end of the step by Taylor's series, the smallest terms added first."""
        for i in range(first, first + total_force.particle_count):
            x, v, a, j = state.position[i], state.velocity[i], state.acceleration[i], state.jerk[i]
            state.start_position[i] = x
            state.start_velocity[i] = v
            state.start_acceleration[i] = a
            state.start_jerk[i] = j
            if ti.static(self.derivatives > 1):
                s, c = state.snap[i], state.crackle[i]
                state.start_snap[i] = s
                state.estimate[i] = a + h * (j + h / 2.0 * (s + h / 3.0 * c))
                state.velocity[i] = v + h * (a + h / 2.0 * (j + h / 3.0 * (s + h / 4.0 * c)))
                state.position[i] = x + h * (v + h / 2.0 * (a + h / 3.0 * (j + h / 4.0 * (s + h / 5.0 * c))))
            else:
                state.velocity[i] = v + h * (a + h / 2.0 * j)
                state.position[i] = x + h * (v + h / 2.0 * (a + h / 3.0 * j))

    @ti.func
    def correct(self, state: Template, total_force: Template, first, h: Template):
        """Set the end of the step to the end of the polynomial through the derivatives at both ends."""
        for i in range(first, first + total_force.particle_count):
            v0, a0, j0 = state.start_velocity[i], state.start_acceleration[i], state.start_jerk[i]
            a1, j1 = state.acceleration[i], state.jerk[i]
            if ti.static(self.derivatives > 1):
                s0, s1 = state.start_snap[i], state.snap[i]
                v1 = v0 + integral6(h, a0, a1, j0, j1, s0, s1)
                state.velocity[i] = v1
                state.position[i] = state.start_position[i] + integral6(h, v0, v1, a0, a1, j0, j1)
                state.crackle[i] = last_derivative(h, a0, a1, j0, j1, s0, s1)
                state.estimate[i] = a1
            else:
                v1 = v0 + integral4(h, a0, a1, j0, j1)
                state.velocity[i] = v1
                state.position[i] = state.start_position[i] + integral4(h, v0, v1, a0, a1)
