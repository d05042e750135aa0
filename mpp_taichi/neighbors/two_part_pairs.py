"""Pair sums in double-single arithmetic: each body sums the pulls of all others, one after the other."""

from functools import reduce
from typing import Any

import taichi as ti

from mpp_taichi.arithmetic.force_numbers import parameter, wide_number, zero_vector
from mpp_taichi.arithmetic.inverse_distance import inverse_distance
from mpp_taichi.arithmetic.particle_update import separation, wide_position
from mpp_taichi.arithmetic.traced import traced
from mpp_taichi.device.heavy_loops import CPU_GRAIN, is_heavy
from mpp_taichi.neighbors.all_pairs import AllPairs
from mpp_taichi.types import Template


@ti.data_oriented
class TwoPartPairs:
    """Direct sum over all pairs for a state whose forces have low parts; O(N²).

    Each plan sums in the order of the bodies, so that all plans give the same bits. A double-single product loses digits below
    2⁻⁷⁸, hence an inverse cube needs distances between 1.5e-13 and 6e7 [length]; beyond, the error grows to that of f32.
    """

    sets_directly = False
    in_tiles = False

    def __init__(self, pairs: AllPairs) -> None:
        """Take forces and softenings from the sum in one part."""
        self.pairs, self.groups = pairs, pairs.groups
        self.all_pairs = pairs
        self.particle_count, self.thread_count = pairs.particle_count, pairs.thread_count
        self.longest_loop = pairs.longest_loop

    def is_symmetric(self, state: Any) -> bool:
        """No: each body sums the pulls of all others."""
        return False

    def loops(self, state: Any) -> int:
        """Number of parallel loops of `add_accelerations`."""
        return 1

    def destroy(self) -> None:
        """Free the memory of the sums."""
        self.pairs.destroy()

    @ti.func
    def accumulate_serial(self, state: Template, first):
        """Add the accelerations of particles first … first + N − 1; for use inside a serialized loop."""
        for i in range(first, first + self.particle_count):
            self._add_to(state, first, i)

    @ti.func
    def accumulate_parallel_gather(self, state: Template):
        """Add all accelerations, one body per iteration of a parallel loop; for GPUs."""
        for i in range(self.particle_count):
            self._add_to(state, 0, i)

    def add_accelerations(self, state: Any) -> None:
        """Add all accelerations on the CPU in a launch of its own."""
        self._accumulate_on_cpu(state)

    @ti.kernel
    def _accumulate_on_cpu(self, state: Template):
        for block in range(self.thread_count * CPU_GRAIN):
            if is_heavy(block, CPU_GRAIN):
                thread = block // CPU_GRAIN
                begin = thread * self.particle_count // self.thread_count
                for i in range(begin, (thread + 1) * self.particle_count // self.thread_count):
                    self._add_to(state, 0, i)

    @ti.func
    def _add_to(self, state: Template, first, i):
        total = zero_vector(state)
        for j in range(first, first + self.particle_count):
            if i != j:
                total += self.acceleration_from(state, i, j)
        state.acceleration[i] = state.acceleration[i] + total

    @traced
    def acceleration_from(self, state: Any, i: Any, j: Any) -> Any:
        """Acceleration of body i by body j."""
        d = separation(state, i, j)
        squared, weights = d.dot(d), []
        for group in self.groups:
            inverse = inverse_distance(squared, group.softening_squared)
            for force in (member.force for member in group.members):
                weights.append(force.response(state, i) * (force.source(state, j) * force.shape(inverse)))
        return reduce(lambda total, weight: total.accumulated(weight), weights) * d

    @ti.func
    def potential_energy_of(self, state: Template, i):
        """Half of the potential energy of body i with all other bodies of its replica, in the widest float (`state.wide`)."""
        energy = ti.cast(0.0, state.wide)
        first = i // self.particle_count * self.particle_count
        position = wide_position(state, i)
        for j in range(first, first + self.particle_count):
            if j != i:
                d = wide_position(state, j) - position
                for group in ti.static(self.groups):
                    softening_squared = wide_number(state, parameter(state, group.softening_squared))
                    inverse = inverse_distance(d.dot(d), softening_squared)
                    for member in ti.static(group.members):
                        energy += 0.5 * member.force.potential(state, i, j, inverse)
        return energy
