"""Linear drag against a medium at rest."""

import taichi as ti

from mpp_taichi.arithmetic.force_numbers import parameter
from mpp_taichi.component import Particles, component, param
from mpp_taichi.forces._base import ExternalForce, felt, felt_vector
from mpp_taichi.types import Template


@component
class LinearDrag(ExternalForce):
    """Linear (Stokes) drag, F = −c v. The drag takes energy out: a free particle slows down as exp(−c t / m)."""

    coefficient: float = param(minimum=0.0, strength=True, slider=True, unit="mass time⁻¹", help="drag coefficient c")
    on: Particles = param(None, optional=True, help="the particle or group that feels the drag; absent: every particle")
    needs = frozenset({"mass"})
    conserves_energy = False
    depends_on_velocity = True
    is_linear_drag = True
    takes_any_numbers = True

    @ti.func
    def accelerate(self, state: Template, i, velocity, time):
        """−c v / m."""
        return felt_vector(state, i, self.on, -(parameter(state, self.coefficient) / state.mass[i]) * velocity)

    @ti.func
    def damping_rate(self, state: Template, i, time):
        """c / m."""
        return felt(state, i, self.on, ti.cast(self.coefficient, float) / state.mass[i])

    @ti.func
    def potential(self, state: Template, i, time):
        """None: drag stores nothing."""
        return ti.cast(0.0, state.wide)
