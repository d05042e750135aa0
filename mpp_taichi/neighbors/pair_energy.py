"""Pair energy: the potential energy of all pairs on the vector units of a CPU, each pair once, in f64."""

from typing import Any

import taichi as ti

from mpp_taichi.arithmetic.force_numbers import parameter, wide_number
from mpp_taichi.arithmetic.inverse_distance import softened_square
from mpp_taichi.device.fast_taichi.explicit_vectors import explicit_vectors
from mpp_taichi.device.fast_taichi.lane_arithmetic import VECTOR_BYTES, inverse_roots
from mpp_taichi.device.heavy_loops import CPU_GRAIN, is_heavy
from mpp_taichi.types import Template

LANES = VECTOR_BYTES // 8
LEAST_COUNT = 256  # bodies; with fewer, a launch of its own takes longer than the sum
PIECES = 64  # of the tiles: a fixed number, so that the bits do not depend on the threads


@ti.data_oriented
class PairEnergy:
    """The energies of the rows of pairs, row i = Σ_(j>i) Σ_forces potential(i, j), of an AllPairs.

    A tile holds one body in each lane, and takes the bodies after the tile one by one, two at a time, because two inverse roots
    at a time are faster. The pairs within a tile, and those of the bodies after the last full tile, are taken pair by pair.
    Tile k and the k-th tile from the end have together the same work for every k, and are one piece of work.
    """

    def __init__(self, pairs: Any) -> None:
        """For the forces and bodies of `pairs`."""
        self.pairs, self.count, self.dimensions = pairs, pairs.particle_count, pairs.dimensions
        self.tile_count = self.count // LANES

    def add_to(self, state: Any, terms: Any) -> None:
        """Add the rows to the terms of the bodies, (N,), in f64."""
        with explicit_vectors():
            self._add(state, terms)

    @ti.kernel
    def _add(self, state: Template, terms: ti.types.ndarray(dtype=ti.f64, ndim=1)):
        for q in range(PIECES * CPU_GRAIN):
            if is_heavy(q, CPU_GRAIN):
                piece = q // CPU_GRAIN
                for turn in range((self.tile_count + 2 * PIECES - 1) // (2 * PIECES)):
                    tile = turn * PIECES + piece
                    if tile < (self.tile_count + 1) // 2:
                        self._add_tile(state, terms, tile * LANES)
                        if self.tile_count - 1 - tile != tile:
                            self._add_tile(state, terms, (self.tile_count - 1 - tile) * LANES)
                if piece == 0:
                    for i in range(self.tile_count * LANES, self.count):
                        terms[i] = terms[i] + self._row(state, i, self.count)

    @ti.func
    def _add_tile(self, state: Template, terms: Template, begin):
        place = [
            ti.Vector([self._coordinate(state, begin + lane, axis) for lane in ti.static(range(LANES))])
            for axis in ti.static(range(self.dimensions))
        ]
        total = ti.Vector.zero(ti.f64, LANES)
        after = begin + LANES
        for twin in range((self.count - after) // 2):
            one, other = self._columns(state, begin, place, after + 2 * twin, after + 2 * twin + 1)
            total += one + other
        if (self.count - after) % 2 == 1:
            one, _ = self._columns(state, begin, place, self.count - 1, self.count - 1)
            total += one
        for lane in ti.static(range(LANES)):
            i = begin + lane
            terms[i] = terms[i] + (total[lane] + self._row(state, i, after))

    @ti.func
    def _columns(self, state: Template, begin, place: Template, j, k):
        """The energies of the bodies of a tile with body j, and with body k."""
        square_j, square_k = self._squares(state, place, j), self._squares(state, place, k)
        energy_j, energy_k = ti.Vector.zero(ti.f64, LANES), ti.Vector.zero(ti.f64, LANES)
        for group in ti.static(self.pairs.groups):
            softening_squared = wide_number(state, parameter(state, group.softening_squared))
            softened_j = softened_square(square_j, softening_squared)
            softened_k = softened_square(square_k, softening_squared)
            inverse_j, inverse_k = inverse_roots(softened_j, softened_k, True)
            for member in ti.static(group.members):
                energy_j += self._energies(state, member, begin, j, inverse_j)
                energy_k += self._energies(state, member, begin, k, inverse_k)
        return energy_j, energy_k

    @ti.func
    def _squares(self, state: Template, place: Template, j):
        """Squared distances of a body from the bodies of a tile."""
        squared = ti.Vector.zero(ti.f64, LANES)
        for axis in ti.static(range(self.dimensions)):
            way = self._coordinate(state, j, axis) - place[axis]
            squared += way * way
        return squared

    @ti.func
    def _energies(self, state: Template, member: Template, begin, j, inverse):
        """The energies of one force of the bodies of a tile with body j."""
        return ti.Vector([member.force.potential(state, begin + lane, j, inverse[lane]) for lane in ti.static(range(LANES))])

    @ti.func
    def _row(self, state: Template, i, end):
        """The energies of body i with the bodies i + 1 … end − 1, pair by pair."""
        result = ti.cast(0.0, ti.f64)
        for j in range(i + 1, end):
            way = [
                self._coordinate(state, j, axis) - self._coordinate(state, i, axis)
                for axis in ti.static(range(self.dimensions))
            ]
            result += self.pairs.potential_between(state, i, j, ti.Vector(way))
        return result

    @ti.func
    def _coordinate(self, state: Template, i, axis: Template):
        """One coordinate of `wide_position`: in explicit vectors LLVM cannot cast a vector to another float."""
        result = ti.cast(state.position[i][axis], ti.f64)
        if ti.static(state.carries_low):
            result += ti.cast(state.position_low[i][axis], ti.f64)
        return result
