"""Pairs between groups: the sum of pair forces that act between two groups each, over the pairs that act and no others."""

from collections.abc import Sequence
from typing import Any

import taichi as ti

from mpp_taichi.arithmetic.force_numbers import parameter, wide_number
from mpp_taichi.arithmetic.inverse_distance import inverse_distance
from mpp_taichi.arithmetic.particle_update import separation, wide_position
from mpp_taichi.types import Template


@ti.data_oriented
class PairsBetween:
    """a_i = Σ_forces r_i Σ_j s_j g(1/ρ_ij) d_ij over the partners j of particle i; O(Σ_forces |A| |B|).

    For a force between the groups A and B the partners of a particle of A are those of B, and the other way round; a particle
    of both has the particles of both as partners. Each particle sums over its own partners, in the order of the forces and of
    the particles, so that all plans give the same bits. The groups are runs of particles, (first index, count).
    """

    sets_directly = False
    in_tiles = False

    def __init__(self, pair_forces: Sequence[Any], particle_count: int) -> None:
        """Take the forces, each with `between`."""
        self.forces, self.particle_count = tuple(pair_forces), particle_count
        self.longest_loop = max(first[1] + second[1] for first, second in (force.between for force in self.forces))

    def destroy(self) -> None:
        """There is nothing to free."""

    def is_symmetric(self, state: Any) -> bool:
        """No: each particle sums over its own partners."""
        return False

    def loops(self, state: Any) -> int:
        """One parallel loop."""
        return 1

    def add_accelerations(self, state: Any) -> None:
        """Add all accelerations in a launch of its own."""
        self._add(state)

    @ti.kernel
    def _add(self, state: Template):
        self.accumulate_parallel_gather(state)

    @ti.func
    def accumulate_parallel_gather(self, state: Template):
        """Add all accelerations, one particle per iteration of a parallel loop."""
        for i in range(self.particle_count):
            self._add_to(state, 0, i)

    @ti.func
    def accumulate_serial(self, state: Template, first):
        """Add the accelerations of particles first … first + N − 1; for use inside a serialized loop."""
        for i in range(first, first + self.particle_count):
            self._add_to(state, first, i)

    @ti.func
    def _add_to(self, state: Template, first, i):
        total = ti.Vector.zero(float, state.dimensions)
        for force in ti.static(self.forces):
            one, other = ti.static(force.between)
            in_one, in_other = self._is_in(i - first, one), self._is_in(i - first, other)
            if in_one:
                for j in range(first + other[0], first + other[0] + other[1]):
                    if j != i:
                        total += self._pull(state, force, i, j)
            if in_other:
                for j in range(first + one[0], first + one[0] + one[1]):
                    if j != i and not (in_one and self._is_in(j - first, other)):
                        total += self._pull(state, force, i, j)
        state.acceleration[i] += total

    @ti.func
    def _is_in(self, i, group: Template):
        return group[0] <= i and i < group[0] + group[1]

    @ti.func
    def _pull(self, state: Template, force: Template, i, j):
        """Acceleration of particle i by particle j."""
        d = separation(state, i, j)
        inverse = inverse_distance(d.dot(d), force.softening * force.softening)
        return force.response(state, i) * (force.source(state, j) * force.shape(inverse)) * d

    @ti.func
    def potential_energy_of(self, state: Template, i):
        """Half of the potential energy of particle i with its partners, in the widest float (`state.wide`)."""
        total = ti.cast(0.0, state.wide)
        first = i // self.particle_count * self.particle_count
        for force in ti.static(self.forces):
            one, other = ti.static(force.between)
            in_one, in_other = self._is_in(i - first, one), self._is_in(i - first, other)
            if in_one:
                for j in range(first + other[0], first + other[0] + other[1]):
                    if j != i:
                        total += 0.5 * self._energy(state, force, i, j)
            if in_other:
                for j in range(first + one[0], first + one[0] + one[1]):
                    if j != i and not (in_one and self._is_in(j - first, other)):
                        total += 0.5 * self._energy(state, force, i, j)
        return total

    @ti.func
    def _energy(self, state: Template, force: Template, i, j):
        way = wide_position(state, j) - wide_position(state, i)
        softening_squared = wide_number(state, parameter(state, force.softening * force.softening))
        return force.potential(state, i, j, inverse_distance(way.dot(way), softening_squared))
