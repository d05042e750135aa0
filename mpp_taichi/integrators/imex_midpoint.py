"""Springs by the implicit midpoint rule, soft forces by kicks."""

from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.arithmetic.particle_update import kicked
from mpp_taichi.component import component, param
from mpp_taichi.forces._base import BondForce
from mpp_taichi.forces._total_force import TotalForce
from mpp_taichi.integrators._implicit import Implicit, trapezoid
from mpp_taichi.types import Template


@component
class ImexMidpoint(Implicit):
    """Half a kick by the soft forces, an implicit midpoint step with only springs and friction, half a kick: second order.

    Symplectic and time-reversible; any stiffness is stable. The soft forces are the pair forces and the external
    forces: they are evaluated once a step, where fully implicit methods evaluate them in every iteration. The step must resolve
    the soft forces.
    Source: Zhang & Skeel, Appl. Numer. Math. 25 (1997) 297; Stern & Grinspun, Multiscale Model. Simul. 7 (2009) 1779.
    """

    dt: float = param(above=0.0, unit="time", help="time step")
    solver: str = param("auto", choices=("auto", "conjugate_gradients", "direct"), help="solver of Newton's linear systems")
    tolerance: float = param(
        None, optional=True, above=0.0, maximum=0.01, help="relative error of a step's displacement; absent: by precision"
    )
    order = 2
    symplectic = True
    time_reversible = True
    keeps_force = True
    beta = 0.25
    gamma = 0.5
    node = 0.5
    extra_vectors = ("soft_acceleration",)

    def amplification(self, frequency: float, damping: float = 0.0) -> np.ndarray:
        """The amplification of the implicit midpoint rule, since the oscillator is a spring."""
        return trapezoid(frequency, damping)

    def implicit_part(self, total_force: Any) -> Any:
        """Springs and friction."""
        stiff = tuple(f for f in total_force.forces if isinstance(f, BondForce) or f.depends_on_velocity)
        soft = tuple(f for f in total_force.forces if f not in stiff)
        self.soft = TotalForce(soft, total_force.particle_count, total_force.dimensions)
        self.has_soft_forces = len(soft) > 0
        return TotalForce(stiff, total_force.particle_count, total_force.dimensions)

    def starting_force(self, total_force: Any) -> Any:
        """The soft forces."""
        return self.soft

    @ti.func
    def start(self, state: Template, total_force: Template, first, i, time):
        """Keep the soft accelerations for the first half kick."""
        state.soft_acceleration[i] = state.acceleration[i]

    @ti.func
    def begin(self, state: Template, i, dt, b):
        """Half a kick, then set the bases to the middle of a free flight."""
        velocity = state.velocity[i]
        if ti.static(self.has_soft_forces):
            velocity += 0.5 * dt * state.soft_acceleration[i]
        state.base_velocity[i] = velocity
        state.base_shift[i] = 0.5 * dt * velocity

    @ti.func
    def finish(self, state: Template, i, dt, b, g):
        """Set the end of the step: from the middle as far again."""
        state.position[i] = state.piece_start[i] + 2.0 * (state.base_shift[i] + state.shift[i])
        state.velocity[i] = state.base_velocity[i] + 2.0 * (g / b) * state.shift[i]

    @ti.func
    def kick(self, state: Template, i, dt):
        """The second half kick, by the soft forces with which the next step begins."""
        state.velocity[i] = kicked(state.velocity[i], state.acceleration[i], 0.5 * dt)
        state.soft_acceleration[i] = state.acceleration[i]
