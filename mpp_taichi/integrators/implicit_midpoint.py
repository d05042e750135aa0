"""Implicit midpoint rule."""

import numpy as np
import taichi as ti

from mpp_taichi.component import component, param
from mpp_taichi.integrators._implicit import Implicit, trapezoid
from mpp_taichi.types import Template


@component
class ImplicitMidpoint(Implicit):
    """v₁ = v + h a(x̄, v̄), x₁ = x + h v̄ with the means x̄, v̄ of start and end: second order, symplectic, time-reversible.

    Keeps the energy of linear springs exactly and their oscillations for ever, with frequency (2/h) arctan(ωh/2):
    oscillations that a step cannot resolve become slow oscillations, and stay. Keeps linear and angular momentum, to the
    solver's tolerance.
    Source: Hairer, Lubich & Wanner, Geometric Numerical Integration, §II.1.
    """

    dt: float = param(above=0.0, unit="time", help="time step")
    solver: str = param("auto", choices=("auto", "conjugate_gradients", "direct"), help="solver of Newton's linear systems")
    tolerance: float = param(
        None, optional=True, above=0.0, maximum=0.01, help="relative error of a step's displacement; absent: by precision"
    )
    order = 2
    symplectic = True
    time_reversible = True
    promising_for = ("stiffness",)
    beta = 0.25
    gamma = 0.5
    node = 0.5

    def amplification(self, frequency: float, damping: float = 0.0) -> np.ndarray:
        """(1 − M/2)⁻¹ (1 + M/2) with the oscillator's matrix M."""
        return trapezoid(frequency, damping)

    @ti.func
    def begin(self, state: Template, i, dt, b):
        """Set the bases to the middle of a free flight."""
        state.base_velocity[i] = state.velocity[i]
        state.base_shift[i] = 0.5 * dt * state.velocity[i]

    @ti.func
    def finish(self, state: Template, i, dt, b, g):
        """Set the end of the step: from the middle as far again."""
        state.position[i] = state.piece_start[i] + 2.0 * (state.base_shift[i] + state.shift[i])
        state.velocity[i] = state.base_velocity[i] + 2.0 * (g / b) * state.shift[i]
