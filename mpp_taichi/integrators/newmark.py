"""Newmark's method of constant average acceleration."""

import numpy as np
import taichi as ti

from mpp_taichi.component import component, param
from mpp_taichi.integrators._implicit import Implicit, trapezoid
from mpp_taichi.types import Template


@component
class Newmark(Implicit):
    """Newmark's method with β = ¼, γ = ½, the trapezoidal rule: second order, time-reversible, no damping.

    x₁ = x + h v + h²/4 (a + a₁), v₁ = v + h/2 (a + a₁). Its energy error stays bounded: a change of variables makes it the
    implicit midpoint rule. Source: Newmark, J. Eng. Mech. Div. ASCE 85 (1959) 67; Hairer, Lubich & Wanner, §VI.8.
    """

    dt: float = param(above=0.0, unit="time", help="time step")
    solver: str = param("auto", choices=("auto", "conjugate_gradients", "direct"), help="solver of Newton's linear systems")
    tolerance: float = param(
        None, optional=True, above=0.0, maximum=0.01, help="relative error of a step's displacement; absent: by precision"
    )
    order = 2
    symplectic = True  # it is conjugate to a symplectic method, which keeps the energy as well
    time_reversible = True
    keeps_force = True
    beta = 0.25
    gamma = 0.5
    extra_vectors = ("kept_acceleration",)

    def amplification(self, frequency: float, damping: float = 0.0) -> np.ndarray:
        """(1 − M/2)⁻¹ (1 + M/2) with the oscillator's matrix M."""
        return trapezoid(frequency, damping)

    @ti.func
    def start(self, state: Template, total_force: Template, first, i, time):
        """Keep the acceleration that the first step begins with."""
        acceleration = state.acceleration[i]
        if ti.static(total_force.depends_on_velocity):
            acceleration += total_force.local_acceleration(state, first, i, time, True)
        state.kept_acceleration[i] = acceleration

    @ti.func
    def begin(self, state: Template, i, dt, b):
        """Set the bases from the start of the step and its acceleration."""
        kept = state.kept_acceleration[i]
        state.base_velocity[i] = state.velocity[i] + 0.5 * dt * kept
        state.base_shift[i] = dt * state.velocity[i] + b * kept

    @ti.func
    def finish(self, state: Template, i, dt, b, g):
        """Set the end of the step; the acceleration there is P/b."""
        state.position[i] = state.piece_start[i] + (state.base_shift[i] + state.shift[i])
        state.velocity[i] = state.base_velocity[i] + (g / b) * state.shift[i]
        state.kept_acceleration[i] = state.shift[i] / b
