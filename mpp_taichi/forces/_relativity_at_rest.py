"""The part of general relativity between bodies that does not depend on their velocities, to first order.

c² a_i = Σ_j G m_j (u³ d (½ d·A_j − 4 φ_i − φ_j) + (7/2) u A_j) with φ_i = Σ_k G m_k/r_ik and A_i = Σ_k G m_k d/r_ik³; see
einstein_infeld_hoffmann.py.
"""

from typing import Any

import taichi as ti

from mpp_taichi.arithmetic.force_numbers import parameter
from mpp_taichi.arithmetic.inverse_distance import inverse_root
from mpp_taichi.arithmetic.particle_update import separation
from mpp_taichi.forces._base import ExternalForce
from mpp_taichi.types import Template


class RelativityAtRest(ExternalForce):
    """The sum of this part, for the bodies of a force `einstein_infeld_hoffmann`, which has the energy of both parts."""

    gathers = True
    needs = frozenset({"mass"})

    def __init__(self, whole: Any) -> None:
        """Take the force whose part this is."""
        self.whole = whole

    def work_fields(self) -> dict[str, tuple[str, int]]:
        """φ and A of each body, after which nothing is summed over three bodies."""
        count = self.whole.group[1]
        return {"relativity_potential": ("scalar", count), "relativity_pull": ("vector", count)}

    @ti.func
    def meet(self, state: Template, first, time):
        """Sum φ and A of each body up."""
        begin, start = first + self.whole.group[0], first // state.particle_count * self.whole.group[1]
        for k in range(self.whole.group[1]):
            total, pull = ti.cast(0.0, float), ti.Vector.zero(float, state.dimensions)
            for j in range(begin, begin + self.whole.group[1]):
                if j != begin + k:
                    d = separation(state, begin + k, j)
                    inverse = inverse_root(d.dot(d))
                    part = parameter(state, self.whole.strength) * state.mass[j] * inverse
                    total += part
                    pull += part * inverse * inverse * d
            state.relativity_potential[start + k] = total
            state.relativity_pull[start + k] = pull

    @ti.func
    def accelerate(self, state: Template, i, velocity, time):
        """The acceleration of body i where all bodies are at rest."""
        result = ti.Vector.zero(float, state.dimensions)
        copy = i // state.particle_count
        begin, start = copy * state.particle_count + self.whole.group[0], copy * self.whole.group[1]
        if i >= begin and i < begin + self.whole.group[1]:
            own = state.relativity_potential[start + i - begin]
            for j in range(begin, begin + self.whole.group[1]):
                if j != i:
                    d = separation(state, i, j)
                    inverse = inverse_root(d.dot(d))
                    pull, other = state.relativity_pull[start + j - begin], state.relativity_potential[start + j - begin]
                    size = inverse * inverse * (0.5 * d.dot(pull) - 4.0 * own - other)
                    result += parameter(state, self.whole.strength) * state.mass[j] * inverse * (size * d + 3.5 * pull)
        light = parameter(state, self.whole.speed_of_light)
        return result / (light * light)

    @ti.func
    def potential(self, state: Template, i, time):
        """0: the whole force has the energy of both parts."""
        return ti.cast(0.0, state.wide)
