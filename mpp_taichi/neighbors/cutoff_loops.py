"""Cutoff loops: the loops over lists of neighbours, on the vector units of a CPU and by a thread for each particle of a GPU."""

import taichi as ti

from mpp_taichi.arithmetic.inverse_distance import inverse_distance, softened_square
from mpp_taichi.device.fast_taichi.lane_arithmetic import inverse_roots, multiply_add
from mpp_taichi.device.heavy_loops import is_heavy, loop_grain
from mpp_taichi.neighbors.all_pairs import AllPairs
from mpp_taichi.neighbors.periodic import nearest_image
from mpp_taichi.neighbors.tile_boxes import TileBoxes
from mpp_taichi.neighbors.tile_lists import COPY_BITS, TileLists
from mpp_taichi.state.field_group import FieldGroup, SideBySide
from mpp_taichi.types import Template

PIECES = 64  # of the tiles: a fixed number, so that the work of a piece does not depend on the threads


@ti.data_oriented
class CutoffLoops:
    """Sums of pair forces over TileLists.

    place    `dimensions` fields by slot: positions in the box that repeats, or beyond its faces after a step or two [length]
    source   a field by slot for each force

    On a CPU a tile holds one particle in each lane, and takes the particles of its list one by one, two at a time, because two
    inverse roots at a time are faster. The pairs within a tile are taken in the same way; in the lane of the particle itself
    the squared distance gets a 1. Slots without a particle lie farther away than the forces reach.
    """

    def __init__(self, pairs: AllPairs, boxes: TileBoxes, lists: TileLists, reach: float) -> None:
        """Allocate for the forces of `pairs`; needs a started Taichi."""
        self.pairs, self.boxes, self.lists, self.reach = pairs, boxes, lists, reach
        self.particle_count, self.dimensions, self.lanes = boxes.particle_count, boxes.dimensions, boxes.lanes
        self.tile_count = boxes.tile_count
        self.members, self.groups = pairs.members, pairs.groups
        self.farthest = (2.0 * reach) ** 2  # where a formula is evaluated for pairs with a slot that is empty
        self.place = tuple(ti.field(float) for _ in range(self.dimensions))
        self.source = tuple(ti.field(float) for _ in self.members)
        self._memory = FieldGroup((lists.empty + 1, SideBySide((*self.place, *self.source))))

    def destroy(self) -> None:
        """Free the memory."""
        self._memory.destroy()

    @ti.kernel
    def fill(self, state: Template):
        """Positions and sources by slot."""
        for slot in range(self.lists.empty + 1):
            for axis in ti.static(range(self.dimensions)):
                beyond = ti.static(2.0 * self.boxes.period[axis] + 3.0 * self.reach)
                ti.static(self.place[axis])[slot] = self.boxes.lower[1][axis] - beyond
            if slot < self.particle_count:
                i = self.boxes.order[slot]
                place = self.place_of(state.position[i], i)
                for axis in ti.static(range(self.dimensions)):
                    ti.static(self.place[axis])[slot] = place[axis]
                for member in ti.static(self.members):
                    ti.static(self.source[member.index])[slot] = member.force.source(state, i)

    @ti.func
    def place_of(self, position, i):
        """The copy of particle i that is near the place for which the lists were made."""
        result = position
        if ti.static(self.lists.repeats):
            listed = self.boxes.inside[i]
            result = listed + nearest_image(position - listed, self.boxes.period)
        return result

    # Lanes

    @ti.kernel
    def add_in_lanes(self, state: Template, entry: Template):
        """Add all accelerations, a tile at a time; to be compiled with explicit vectors."""
        grain = ti.static(loop_grain())
        for q in range(PIECES * grain):
            if is_heavy(q, grain):
                piece = q // grain
                for tile in range(piece * self.tile_count // PIECES, (piece + 1) * self.tile_count // PIECES):
                    self._add_tile(state, entry, tile)

    @ti.func
    def _add_tile(self, state: Template, entry: Template, tile):
        begin = tile * self.lanes
        own = [
            ti.Vector([ti.static(self.place[axis])[begin + lane] for lane in ti.static(range(self.lanes))])
            for axis in ti.static(range(self.dimensions))
        ]
        response = [
            ti.Vector([member.force.response(state, self._particle(begin + lane)) for lane in ti.static(range(self.lanes))])
            for member in ti.static(self.members)
        ]
        total = [ti.Vector.zero(float, self.lanes) for axis in ti.static(range(self.dimensions))]
        for twin in range(self.lists.begin[tile] // 2, self.lists.end[tile] // 2):
            one, two = entry[2 * twin], entry[2 * twin + 1]
            j, k = one >> COPY_BITS, two >> COPY_BITS
            to_j, to_k = self._ways(one, own), self._ways(two, own)
            self._add_pulls(j, k, to_j, to_k, self.pairs.square(to_j), self.pairs.square(to_k), response, total)
        lane_number = ti.Vector([ti.cast(lane, float) for lane in ti.static(range(self.lanes))])
        for step in range(self.lanes // 2):
            j, k = begin + 2 * step, begin + 2 * step + 1
            to_j, to_k = self._ways(j << COPY_BITS, own), self._ways(k << COPY_BITS, own)
            from_j = lane_number - ti.cast(2 * step, float)
            from_k = from_j - 1.0
            square_j = self.pairs.square(to_j) + ti.max(1.0 - from_j * from_j, 0.0)
            square_k = self.pairs.square(to_k) + ti.max(1.0 - from_k * from_k, 0.0)
            self._add_pulls(j, k, to_j, to_k, square_j, square_k, response, total)
        for lane in ti.static(range(self.lanes)):
            if begin + lane < self.particle_count:
                i = self._particle(begin + lane)
                for axis in ti.static(range(self.dimensions)):
                    addend = total[axis][lane]
                    if ti.static(len(self.members) == 1):
                        addend = response[0][lane] * addend
                    state.acceleration[i][axis] = state.acceleration[i][axis] + addend

    @ti.func
    def _particle(self, slot):
        """The particle of a slot, and of a slot without a particle the last."""
        return self.boxes.order[ti.min(slot, self.particle_count - 1)]

    @ti.func
    def _ways(self, each, own: Template):
        """Ways from the particles of a tile to an entry of its list, by components."""
        slot = each >> COPY_BITS
        place = [ti.static(self.place[axis])[slot] for axis in ti.static(range(self.dimensions))]
        if ti.static(self.lists.repeats):
            copy = each & ((1 << COPY_BITS) - 1)
            for axis in ti.static(range(self.dimensions)):
                place[axis] += ti.static(self.lists.copy[axis])[copy]
        return [place[axis] - own[axis] for axis in ti.static(range(self.dimensions))]

    @ti.func
    def _add_pulls(self, j, k, to_j: Template, to_k: Template, square_j, square_k, response: Template, total: Template):
        """Add the pulls of two particles on a tile to the totals; a lone force has its response at the end of the sum."""
        weight_j = ti.Vector.zero(float, self.lanes)
        weight_k = ti.Vector.zero(float, self.lanes)
        for group in ti.static(self.groups):
            softened_j = softened_square(ti.min(square_j, self.farthest), group.softening_squared)
            softened_k = softened_square(ti.min(square_k, self.farthest), group.softening_squared)
            inverse_j, inverse_k = inverse_roots(softened_j, softened_k, False)
            for member in ti.static(group.members):
                addend_j = ti.static(self.source[member.index])[j] * self.pairs.shape_of(member, inverse_j)
                addend_k = ti.static(self.source[member.index])[k] * self.pairs.shape_of(member, inverse_k)
                if ti.static(len(self.members) > 1):
                    addend_j = response[member.index] * addend_j
                    addend_k = response[member.index] * addend_k
                weight_j, weight_k = weight_j + addend_j, weight_k + addend_k
        for axis in ti.static(range(self.dimensions)):
            total[axis] = multiply_add(weight_j, to_j[axis], total[axis])
            total[axis] = multiply_add(weight_k, to_k[axis], total[axis])

    # Threads

    @ti.kernel
    def add(self, state: Template, entry: Template):
        """Add all accelerations by a thread for each particle."""
        for slot in range(self.particle_count):
            i, tile = self.boxes.order[slot], slot // self.lanes
            own = [ti.static(self.place[axis])[slot] for axis in ti.static(range(self.dimensions))]
            total = ti.Vector.zero(float, self.dimensions)
            for k in range(self.lists.begin[tile], self.lists.end[tile]):
                total += self._pull(state, i, entry[k], own)
            for other in range(tile * self.lanes, ti.min((tile + 1) * self.lanes, self.particle_count)):
                if other != slot:
                    total += self._pull(state, i, other << COPY_BITS, own)
            state.acceleration[i] += total

    @ti.func
    def _pull(self, state: Template, i, each, own: Template):
        """Acceleration of particle i by an entry."""
        way = ti.Vector(self._ways(each, own))
        weight = 0.0
        for group in ti.static(self.groups):
            inverse = inverse_distance(ti.min(way.dot(way), self.farthest), group.softening_squared)
            for member in ti.static(group.members):
                source = ti.static(self.source[member.index])[each >> COPY_BITS]
                weight += member.force.response(state, i) * (source * member.force.shape(inverse))
        return weight * way
