"""A uniform gravitational field."""

import taichi as ti

from mpp_taichi.arithmetic.force_numbers import parameter, parameter_vector, wide_number
from mpp_taichi.arithmetic.particle_update import wide_position
from mpp_taichi.component import Particles, Vector, component, param
from mpp_taichi.forces._base import ExternalForce, felt, felt_vector
from mpp_taichi.types import Template


@component
class UniformGravity(ExternalForce):
    """Uniform field, a = g; potential energy −m g·x, zero at the origin."""

    acceleration: Vector = param([0.0, 0.0, -9.81], strength=True, slider=True, unit="length time⁻²", help="acceleration g")
    on: Particles = param(None, optional=True, help="the particle or group that feels the field; absent: every particle")
    needs = frozenset({"mass"})
    has_derivatives = True
    is_uniform = True
    takes_any_numbers = True
    proportional_to_mass = True

    @ti.func
    def accelerate(self, state: Template, i, velocity, time):
        """Return g."""
        return felt_vector(state, i, self.on, parameter_vector(state, self.acceleration))

    @ti.func
    def derivatives(self, state: Template, i, time):
        """None: the field is the same everywhere and always."""
        return ti.Vector.zero(float, state.dimensions), ti.Vector.zero(float, state.dimensions)

    @ti.func
    def potential(self, state: Template, i, time):
        """−m g·x."""
        result = ti.cast(0.0, state.wide)
        position = wide_position(state, i)
        for k in ti.static(range(state.dimensions)):
            pull = wide_number(state, parameter(state, self.acceleration[k]))
            result -= wide_number(state, state.mass[i]) * pull * position[k]
        return felt(state, i, self.on, result)
