"""Energy–momentum method: the midpoint rule with springs that do exactly the work of their potential."""

from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.component import component, param
from mpp_taichi.forces._base import BondForce
from mpp_taichi.forces._step_bond import StepBond
from mpp_taichi.forces._total_force import TotalForce
from mpp_taichi.integrators._implicit import Implicit, trapezoid
from mpp_taichi.types import Template


@component
class EnergyMomentum(Implicit):
    """v₁ = v + h a, x₁ = x + h (v + v₁)/2, springs averaged so that energy and momenta are kept: second order, time-reversible.

    With springs of any stiffness and uniform fields, every step keeps the energy and the linear and angular momentum to the
    tolerance of the solver; damping only takes energy. The midpoint rule may heat up springs that a step does not resolve; this
    method cannot. Forces between all pairs act as in the midpoint rule: their energy is kept to second order.
    Source: Simo & Tarnow, Z. angew. Math. Phys. 43 (1992) 757; Gonzalez, J. Nonlinear Sci. 6 (1996) 449.
    """

    dt: float = param(above=0.0, unit="time", help="time step")
    solver: str = param("auto", choices=("auto", "conjugate_gradients", "direct"), help="solver of Newton's linear systems")
    tolerance: float = param(
        None, optional=True, above=0.0, maximum=0.01, help="relative error of a step's displacement; absent: by precision"
    )
    order = 2
    symplectic = True  # it is not symplectic, but it keeps the energy even better
    time_reversible = True
    beta = 0.25
    gamma = 0.5
    node = 0.5

    def implicit_part(self, total_force: Any) -> Any:
        """All forces, with the bonds averaged over the step."""
        forces = tuple(StepBond(force) if isinstance(force, BondForce) else force for force in total_force.forces)
        return TotalForce(forces, total_force.particle_count, total_force.dimensions)

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
