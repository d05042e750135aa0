"""Driven bodies: bodies on given paths, put where they are by an agent outside the system, which does work on the others.

    x = x(t),  v = x′(t),  P = (m x″ − F)·x′

P is the power of the agent, F the force of all other particles and of the fields on the body. The body is held, so that no kick
changes its velocity; after each drift it is put anew, so that no error of its place accumulates.
"""

from collections.abc import Sequence
from typing import Any

import taichi as ti

from mpp_taichi.arithmetic.force_numbers import parameter, wide_number
from mpp_taichi.arithmetic.formula_steps import KernelArithmetic
from mpp_taichi.arithmetic.inverse_distance import inverse_distance
from mpp_taichi.arithmetic.particle_update import separation, velocity_seen
from mpp_taichi.arithmetic.point_lookup import provide
from mpp_taichi.arithmetic.traced import traced
from mpp_taichi.forces._row_sum import row_sum
from mpp_taichi.neighbors._pair_groups import grouped
from mpp_taichi.scene.formulas.path_law import TIME, PathLaw
from mpp_taichi.scene.formulas.program import points_of
from mpp_taichi.types import Template


@ti.data_oriented
class DrivenBodies:
    """Paths of bodies, given by their indices, as a part of the kernels of a step."""

    def __init__(self, indices: Sequence[int], laws: Sequence[PathLaw]) -> None:
        """Take the index and the path of each body."""
        self.indices, self.laws, self.count = tuple(indices), tuple(laws), len(laws)
        for law in laws:
            provide(points_of(law))

    @traced
    def motion(self, state: Any, b: int, time: Any) -> list[Any]:
        """Place and velocity of body b at a time, component after component."""
        found = self.laws[b].motion.run(KernelArithmetic, {TIME: time}, 1.0)
        return [parameter(state, each) for each in found]

    @traced
    def change(self, state: Any, b: int, time: Any) -> list[Any]:
        """Velocity and acceleration of body b at a time, component after component."""
        found = self.laws[b].change.run(KernelArithmetic, {TIME: time}, 1.0)
        return [parameter(state, each) for each in found]

    @ti.func
    def put(self, state: Template, first, time, places: Template, velocities: Template):
        """Give each body of the copy that begins at particle `first` the place and velocity of this time, or one of both."""
        for b in ti.static(range(self.count)):
            now = self.motion(state, b, time)
            i = first + ti.static(self.indices[b])
            for k in ti.static(range(state.dimensions)):
                if ti.static(places):
                    state.position[i][k] = now[k]
                if ti.static(velocities):
                    state.velocity[i][k] = now[state.dimensions + k]

    @ti.func
    def power(self, state: Template, total_force: Template, mass: Template, time):
        """Power of the agents that move the bodies of the first copy [energy / time], in the widest float of the device."""
        result = ti.cast(0.0, state.wide)
        for b in ti.static(range(self.count)):
            now = self.change(state, b, time)
            i = ti.static(self.indices[b])
            force = self.force_on(state, total_force, i, mass, time)
            for k in ti.static(range(state.dimensions)):
                needed = wide_number(state, mass[i]) * wide_number(state, now[state.dimensions + k])
                result += (needed - force[k]) * wide_number(state, now[k])
        return result

    @ti.func
    def force_on(self, state: Template, total_force: Template, i: Template, mass: Template, time):
        """Force of all other particles and of the fields on particle i of the first copy [force], though it is held."""
        result = ti.Vector.zero(state.wide, state.dimensions)
        if mass[i] > 0.0:  # fields act on masses, and give accelerations
            for force in ti.static(total_force.external):
                felt = force.accelerate(state, i, velocity_seen(state, i), time)
                for k in ti.static(range(state.dimensions)):
                    result[k] += wide_number(state, mass[i]) * wide_number(state, felt[k])
        for bond in ti.static(total_force.bonds):
            pull = row_sum(state, 0, i, bond, False)
            for k in ti.static(range(state.dimensions)):
                result[k] += wide_number(state, pull[k])
        if ti.static(total_force.has_pairs):
            for j in range(total_force.particle_count):
                if j != i:
                    d = separation(state, i, j)
                    on_i, on_j = self.weights(state, total_force, i, j, d.dot(d))
                    # Both accelerations give the same force, by Newton's third law; a particle without mass gives none.
                    factor = ti.cast(0.0, state.wide)
                    if mass[i] > 0.0:
                        factor = wide_number(state, mass[i]) * wide_number(state, on_i)
                    elif mass[j] > 0.0:
                        factor = wide_number(state, mass[j]) * wide_number(state, on_j)
                    for k in ti.static(range(state.dimensions)):
                        result[k] += factor * wide_number(state, d[k])
        return result

    @traced
    def weights(self, state: Any, total_force: Any, i: Any, j: Any, squared: Any) -> tuple[Any, Any]:
        """Factors of x_j − x_i in the accelerations of i and, with the opposite sign, of j."""
        on_i: Any = 0.0
        on_j: Any = 0.0
        for group in grouped(total_force.pair_forces)[1]:
            inverse = inverse_distance(squared, group.softening_squared)
            for force in (member.force for member in group.members):
                shape = force.shape(inverse)
                on_i = on_i + force.response(state, i) * (force.source(state, j) * shape)
                on_j = on_j + force.response(state, j) * (force.source(state, i) * shape)
        return on_i, on_j
