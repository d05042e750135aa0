"""Pair sum of dual numbers: one pair after the other, each evaluated once, for the tangent of a step in one thread."""

from typing import Any

import taichi as ti

from mpp_taichi.arithmetic.inverse_distance import inverse_distance
from mpp_taichi.arithmetic.particle_update import separation
from mpp_taichi.arithmetic.traced import traced
from mpp_taichi.neighbors.all_pairs import AllPairs
from mpp_taichi.types import Template


@ti.data_oriented
class PairsInTurn:
    """Direct sum over all pairs for the tangent of a step; O(N²).

    Pairs are added in the order of the serial double loop of `AllPairs`, so that up to nine bodies, or with forces of several
    kinds, the accelerations have the bits of a run without a tangent.
    """

    sets_directly = False
    in_tiles = False

    def __init__(self, pairs: AllPairs) -> None:
        """Take forces and softenings from the sum of plain numbers."""
        self.pairs, self.groups = pairs, pairs.groups
        self.particle_count, self.longest_loop = pairs.particle_count, pairs.longest_loop

    def destroy(self) -> None:
        """Free the memory of the sums."""
        self.pairs.destroy()

    @ti.func
    def accumulate_serial(self, state: Template, first):
        """Add the accelerations of particles first … first + N − 1; for use inside a serialized loop."""
        for i in range(first, first + self.particle_count):
            for j in range(i + 1, first + self.particle_count):
                d = separation(state, i, j)
                on_i, on_j = self.weights(state, i, j, d.dot(d))
                state.acceleration[i] = state.acceleration[i] + on_i * d
                state.acceleration[j] = state.acceleration[j] - on_j * d

    @traced
    def weights(self, state: Any, i: Any, j: Any, squared: Any) -> Any:
        """Factors of d_ij in the accelerations of i and, with the opposite sign, of j."""
        on_i: Any = 0.0
        on_j: Any = 0.0
        for group in self.groups:
            inverse = inverse_distance(squared, group.softening_squared)
            for force in (member.force for member in group.members):
                shape = force.shape(inverse)
                on_i = on_i + force.response(state, i) * (force.source(state, j) * shape)
                on_j = on_j + force.response(state, j) * (force.source(state, i) * shape)
        return on_i, on_j
