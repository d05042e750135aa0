"""Implicit Euler method."""

import numpy as np
import taichi as ti

from mpp_taichi.component import component, param
from mpp_taichi.integrators._implicit import Implicit, oscillator
from mpp_taichi.types import Template


@component
class ImplicitEuler(Implicit):
    """v₁ = v + h a(x₁, v₁), x₁ = x + h v₁: first order, stable for any step, and strongly damping.

    An oscillation loses the part 1 − 1/(1 + ω²h²) of its energy in each step. For statics, and to get out of hopeless states.
    """

    dt: float = param(above=0.0, unit="time", help="time step")
    solver: str = param("auto", choices=("auto", "conjugate_gradients", "direct"), help="solver of Newton's linear systems")
    tolerance: float = param(
        None, optional=True, above=0.0, maximum=0.01, help="relative error of a step's displacement; absent: by precision"
    )
    order = 1
    never_gains_energy = True

    def amplification(self, frequency: float, damping: float = 0.0) -> np.ndarray:
        """(1 − M)⁻¹ with the oscillator's matrix M."""
        return np.linalg.inv(np.eye(2) - oscillator(frequency, damping))

    @ti.func
    def begin(self, state: Template, i, dt, b):
        """Set the bases to the end of a free flight."""
        state.base_velocity[i] = state.velocity[i]
        state.base_shift[i] = dt * state.velocity[i]

    @ti.func
    def finish(self, state: Template, i, dt, b, g):
        """The stage is the end of the step."""
        state.position[i] = state.piece_start[i] + (state.base_shift[i] + state.shift[i])
        state.velocity[i] = state.base_velocity[i] + (g / b) * state.shift[i]
