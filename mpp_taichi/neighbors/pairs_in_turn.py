"""Pair sum of dual numbers and of lanes: one pair after the other, each evaluated once, in one thread."""

from collections.abc import Callable
from typing import Any

import taichi as ti

from mpp_taichi.arithmetic.inverse_distance import inverse_distance
from mpp_taichi.arithmetic.particle_update import separation
from mpp_taichi.arithmetic.traced import traced
from mpp_taichi.neighbors.all_pairs import AllPairs
from mpp_taichi.types import Template

WRITTEN_OUT = 4  # bodies; with more the compiler would take longer than a loop saves


@ti.data_oriented
class PairsInTurn:
    """Direct sum over all pairs for numbers with operators of their own; O(N²).

    Pairs are added in the order of the serial double loop of `AllPairs`, so that up to nine bodies, or with forces of several
    kinds, the accelerations have the bits of plain numbers.
    """

    sets_directly = False
    in_tiles = False

    def __init__(self, pairs: AllPairs) -> None:
        """Take forces and softenings from the sum of plain numbers."""
        self.pairs, self.groups = pairs, pairs.groups
        self.all_pairs = pairs
        self.particle_count, self.longest_loop = pairs.particle_count, pairs.longest_loop

    def destroy(self) -> None:
        """Free the memory of the sums."""
        self.pairs.destroy()

    @ti.func
    def accumulate_serial(self, state: Template, first):
        """Add the accelerations of particles first … first + N − 1; for use inside a serialized loop."""
        if ti.static(self.particle_count <= WRITTEN_OUT and state.number_kind.written_out):
            self.accumulate_in_registers(state, first)
        else:
            self.accumulate_in_loops(state, first)

    @traced
    def accumulate_in_registers(self, state: Any, first: Any) -> None:
        """The sum of few bodies, written out: each position is read once, and each acceleration is written once."""
        bodies = range(self.particle_count)
        position, acceleration = state.position, state.acceleration
        places, total = [position[first + i] for i in bodies], [acceleration[first + i] for i in bodies]
        forces = [member.force for group in self.groups for member in group.members]
        response = {force: [force.response(state, first + i) for i in bodies] for force in forces}
        source = {force: [force.source(state, first + i) for i in bodies] for force in forces}
        for i in bodies:
            for j in bodies[i + 1 :]:
                d = places[j] - places[i]
                on_i, on_j = self.weights(
                    d.dot(d), lambda force, k: response[force][k], lambda force, k: source[force][k], i, j
                )
                total[i], total[j] = total[i] + on_i * d, total[j] - on_j * d
        for i in bodies:
            acceleration[first + i]._assign(total[i])

    @ti.func
    def accumulate_in_loops(self, state: Template, first):
        """The sum of many bodies."""
        for i in range(first, first + self.particle_count):
            for j in range(i + 1, first + self.particle_count):
                d = separation(state, i, j)
                on_i, on_j = self.weights_of(state, i, j, d.dot(d))
                state.acceleration[i] = state.acceleration[i] + on_i * d
                state.acceleration[j] = state.acceleration[j] - on_j * d

    @traced
    def weights_of(self, state: Any, i: Any, j: Any, squared: Any) -> Any:
        """Factors of d_ij in the accelerations of i and, with the opposite sign, of j."""
        return self.weights(squared, lambda force, k: force.response(state, k), lambda force, k: force.source(state, k), i, j)

    def weights(self, squared: Any, response: Callable[..., Any], source: Callable[..., Any], i: Any, j: Any) -> Any:
        """The same, with functions for the response and the source of a force and a body."""
        on_i: Any = 0.0
        on_j: Any = 0.0
        for group in self.groups:
            inverse = inverse_distance(squared, group.softening_squared)
            for force in (member.force for member in group.members):
                shape = force.shape(inverse)
                on_i = on_i + response(force, i) * (source(force, j) * shape)
                on_j = on_j + response(force, j) * (source(force, i) * shape)
        return on_i, on_j
