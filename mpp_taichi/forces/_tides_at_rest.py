"""The part of tides between bodies that has a potential: the pull of bulges that follow at once, V = −½ k G m² R⁵/r⁶."""

from typing import Any

import taichi as ti

from mpp_taichi.arithmetic.force_numbers import parameter, wide_number
from mpp_taichi.arithmetic.inverse_distance import inverse_root
from mpp_taichi.arithmetic.particle_update import separation, wide_position
from mpp_taichi.forces._base import ExternalForce
from mpp_taichi.types import Template


class TidesAtRest(ExternalForce):
    """The sum of this part, for the bodies of a force `mutual_tides`."""

    needs = frozenset({"mass"})

    def __init__(self, whole: Any) -> None:
        """Take the force whose part this is."""
        self.whole = whole

    @ti.func
    def accelerate(self, state: Template, i, velocity, time):
        """3 k G m² R⁵ d/r⁸ for a mass of i, from each body with which it shares a tide."""
        result = ti.Vector.zero(float, state.dimensions)
        first = i // state.particle_count * state.particle_count
        for j in range(first, first + state.particle_count):
            weight = self.whole.weight(state, i, j)
            if weight > 0.0:
                d = separation(state, i, j)
                result += self.whole.pull(state, d, weight) * d
        return result / state.mass[i]

    @ti.func
    def potential(self, state: Template, i, time):
        """Half of the energy of each pair that shares a tide."""
        result = ti.cast(0.0, state.wide)
        first = i // state.particle_count * state.particle_count
        for j in range(first, first + state.particle_count):
            weight = wide_number(state, self.whole.weight(state, i, j))
            if weight > 0.0:
                d = wide_position(state, j) - wide_position(state, i)
                inverse = inverse_root(d.dot(d))
                ratio = wide_number(state, parameter(state, self.whole.radius)) * inverse
                yields = wide_number(state, parameter(state, self.whole.strength)) * wide_number(
                    state, parameter(state, self.whole.love_number)
                )
                result -= 0.25 * yields * weight * ratio * ratio * ratio * ratio * ratio * inverse
        return result
