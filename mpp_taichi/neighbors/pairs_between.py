"""Pairs between groups: the sum of pair forces that act between two groups each, over the pairs that act and no others."""

from collections.abc import Sequence
from typing import Any

import taichi as ti

from mpp_taichi.arithmetic.particle_update import wide_position
from mpp_taichi.neighbors.all_pairs import AllPairs
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

    def __init__(self, pair_forces: Sequence[Any], particle_count: int, dimensions: int) -> None:
        """Take the forces, each with `between`."""
        self.particle_count = particle_count
        self.parts = tuple(AllPairs((force,), particle_count, dimensions) for force in pair_forces)  # for the terms of a pair
        self.longest_loop = max(one[1] + other[1] for one, other in (force.between for force in pair_forces))

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
        state.acceleration[i] += self._sum(state, first, i, self._pull, ti.Vector.zero(float, state.dimensions))

    @ti.func
    def potential_energy_of(self, state: Template, i):
        """Half of the potential energy of particle i with its partners, in the widest float (`state.wide`)."""
        first = i // self.particle_count * self.particle_count
        return self._sum(state, first, i, self._half_energy, ti.cast(0.0, state.wide))

    @ti.func
    def _sum(self, state: Template, first, i, term: Template, zero):
        """The sum of term(state, the sum of one force, i, j) over the partners j of particle i."""
        total = zero
        for part in ti.static(self.parts):
            one, other = ti.static(part.members[0].force.between)
            in_one, in_other = self._is_in(i - first, one), self._is_in(i - first, other)
            if in_one:
                for j in range(first + other[0], first + other[0] + other[1]):
                    if j != i:
                        total += term(state, part, i, j)
            if in_other:
                for j in range(first + one[0], first + one[0] + one[1]):
                    if j != i and not (in_one and self._is_in(j - first, other)):
                        total += term(state, part, i, j)
        return total

    @ti.func
    def _is_in(self, i, group: Template):
        return group[0] <= i and i < group[0] + group[1]

    @ti.func
    def _pull(self, state: Template, part: Template, i, j):
        return part.acceleration_from(state, i, j)

    @ti.func
    def _half_energy(self, state: Template, part: Template, i, j):
        way = wide_position(state, j) - wide_position(state, i)
        return 0.5 * part.potential_between(state, i, j, way)
