"""Pair energy: the potential energy of all pairs on the vector units of a CPU, each pair once, summed in f64."""

from typing import Any

import taichi as ti

from mpp_taichi.arithmetic.force_numbers import parameter, wide_number
from mpp_taichi.arithmetic.inverse_distance import softened_square
from mpp_taichi.device.fast_taichi.explicit_vectors import explicit_vectors
from mpp_taichi.device.fast_taichi.lane_arithmetic import VECTOR_BYTES, inverse_roots, multiply_add
from mpp_taichi.device.heavy_loops import CPU_GRAIN, is_heavy
from mpp_taichi.types import Template

LEAST_COUNT = 256  # bodies; with fewer, a launch of its own takes longer than the sum
MOST_PIECES = 64  # of the work: a number that depends on N alone, so that the bits do not depend on the threads


def has_single_distances(state: Any) -> bool:
    """Whether distances are computed in f32: where places are numbers of f32, without low parts."""
    return bool(ti.lang.impl.current_cfg().default_fp == ti.f32 and not state.carries_low)


@ti.data_oriented
class PairEnergy:
    """The energies of the rows of pairs, row i = Σ_(j>i) Σ_forces potential(i, j), of an AllPairs.

    A tile holds one body in each lane, and takes the bodies after the tile one by one, two at a time, because two inverse roots
    at a time are faster. The pairs within a tile, and those of the bodies after the last full tile, are taken pair by pair.
    Tile k and the k-th tile from the end have together the same work for every k, and are one piece of work.

    Where places are numbers of f32, the inverse distances of the tiles are computed in f32, since twice as many lanes fill a
    register. The rounding of an inverse distance is at most 6 · 2⁻²⁴ of itself, as large as a rounding of the places makes it.
    Energies are products and sums of f64 in every precision, so that products of masses in kilograms do not overflow.
    """

    def __init__(self, state: Any, pairs: Any) -> None:
        """For the bodies of `state` and the forces of `pairs`."""
        self.pairs, self.count, self.dimensions = pairs, pairs.particle_count, pairs.dimensions
        self.real = ti.f32 if has_single_distances(state) else ti.f64
        self.lanes = VECTOR_BYTES // (4 if self.real == ti.f32 else 8)
        self.tile_count = self.count // self.lanes
        pairs_of_tiles = (self.tile_count + 1) // 2
        self.turns = -(-pairs_of_tiles // MOST_PIECES)
        self.pieces = -(-pairs_of_tiles // self.turns)  # as equal as they can be

    def add_to(self, state: Any, terms: Any) -> None:
        """Add the rows to the terms of the bodies, (N,), in f64."""
        with explicit_vectors():
            self._add(state, terms)

    @ti.kernel
    def _add(self, state: Template, terms: ti.types.ndarray(dtype=ti.f64, ndim=1)):
        for q in range(self.pieces * CPU_GRAIN):
            if is_heavy(q, CPU_GRAIN):
                piece = q // CPU_GRAIN
                for turn in range(self.turns):
                    tile = turn * self.pieces + piece
                    if tile < (self.tile_count + 1) // 2:
                        self._add_tile(state, terms, tile * self.lanes)
                        if self.tile_count - 1 - tile != tile:
                            self._add_tile(state, terms, (self.tile_count - 1 - tile) * self.lanes)
                if piece == 0:
                    for i in range(self.tile_count * self.lanes, self.count):
                        terms[i] = terms[i] + self._row(state, i, self.count)

    @ti.func
    def _add_tile(self, state: Template, terms: Template, begin):
        place = [
            ti.Vector([self._coordinate(state, begin + lane, axis, self.real) for lane in ti.static(range(self.lanes))])
            for axis in ti.static(range(self.dimensions))
        ]
        total = ti.Vector.zero(ti.f64, self.lanes)
        after = begin + self.lanes
        for twin in range((self.count - after) // 2):
            total = self._with_columns(state, total, begin, place, after + 2 * twin, after + 2 * twin + 1)
        if (self.count - after) % 2 == 1:
            last = self.count - 1
            total += 0.5 * self._with_columns(state, ti.Vector.zero(ti.f64, self.lanes), begin, place, last, last)
        for lane in ti.static(range(self.lanes)):
            i = begin + lane
            terms[i] = terms[i] + (total[lane] + self._row(state, i, after))

    @ti.func
    def _with_columns(self, state: Template, total, begin, place: Template, j, k):
        """The total with the energies of the bodies of a tile with body j, and with body k."""
        result = total
        square_j, square_k = self._squares(state, place, j), self._squares(state, place, k)
        for group in ti.static(self.pairs.groups):
            softening_squared = ti.cast(wide_number(state, parameter(state, group.softening_squared)), self.real)
            softened_j = softened_square(square_j, softening_squared)
            softened_k = softened_square(square_k, softening_squared)
            inverse_j, inverse_k = inverse_roots(softened_j, softened_k, ti.static(self.real == ti.f64))
            for member in ti.static(group.members):
                result += self._energies(state, member, begin, j, inverse_j) + self._energies(
                    state, member, begin, k, inverse_k
                )
        return result

    @ti.func
    def _squares(self, state: Template, place: Template, j):
        """Squared distances of a body from the bodies of a tile."""
        squared = ti.Vector.zero(self.real, self.lanes)
        for axis in ti.static(range(self.dimensions)):
            way = self._coordinate(state, j, axis, self.real) - place[axis]
            squared = multiply_add(way, way, squared)
        return squared

    @ti.func
    def _energies(self, state: Template, member: Template, begin, j, inverse):
        """The energies of one force of the bodies of a tile with body j."""
        return ti.Vector(
            [
                member.force.potential(state, begin + lane, j, ti.cast(inverse[lane], ti.f64))
                for lane in ti.static(range(self.lanes))
            ]
        )

    @ti.func
    def _row(self, state: Template, i, end):
        """The energies of body i with the bodies i + 1 … end − 1, pair by pair."""
        result = ti.cast(0.0, ti.f64)
        for j in range(i + 1, end):
            way = [
                self._coordinate(state, j, axis, ti.f64) - self._coordinate(state, i, axis, ti.f64)
                for axis in ti.static(range(self.dimensions))
            ]
            result += self.pairs.potential_between(state, i, j, ti.Vector(way))
        return result

    @ti.func
    def _coordinate(self, state: Template, i, axis: Template, real: Template):
        """One coordinate of `wide_position`: in explicit vectors LLVM cannot cast a vector to another float."""
        result = ti.cast(state.position[i][axis], real)
        if ti.static(state.carries_low):
            result += ti.cast(state.position_low[i][axis], real)
        return result
