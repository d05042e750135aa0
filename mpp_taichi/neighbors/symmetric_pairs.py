"""Symmetric pairs: the direct sum on the vector units of a CPU, with each pair evaluated once (Newton's third law)."""

from typing import Any

import taichi as ti

from mpp_taichi.arithmetic.inverse_distance import inverse_distance, softened_square
from mpp_taichi.device.fast_taichi.lane_arithmetic import inverse_roots, multiply_add
from mpp_taichi.device.heavy_loops import CPU_GRAIN, is_heavy
from mpp_taichi.state.field_group import FieldGroup
from mpp_taichi.types import Template

BLOCK = 128  # bodies whose reactions fit into the first cache of a core; a multiple of every number of lanes
MOST_CHUNKS = 16  # chunks that threads may work on at the same time
BODIES_PER_CHUNK = 512
SERIAL_SUMS = 1 << 14  # sums that one thread adds up before a second thread is awake
MOST_SUMS = 1 << 22  # along one axis, in all chunks together


def chunk_count(count: int) -> int:
    """Number of chunks for so many bodies: at least two, as the 512 bodies that make pairs symmetric need a second thread."""
    return max(2, min(MOST_CHUNKS, count // BODIES_PER_CHUNK, MOST_SUMS // count))


def adds_in_parallel(count: int) -> bool:
    """Whether the loop over the sums is parallel; one thread finishes fewer sums before a second thread is awake."""
    return count * chunk_count(count) > SERIAL_SUMS


@ti.data_oriented
class SymmetricPairs:
    """The sum of an AllPairs with half of its square roots and divisions; to be compiled with explicit vectors.

    A tile holds one body in each lane. Two tiles at a time, because two inverse roots at a time are faster, take the bodies of
    a later block one by one. The pulls on the bodies of the tiles are summed in registers. The reactions, the pulls on a body
    of the block, are summed lane by lane in a row of this body, and the rows are summed up at the end of the block. Each block
    belongs to a chunk, each chunk has a sum for every body, and the sums of the chunks are added in one order: the bits depend
    on the number of bodies, not on the number of threads. Bodies after the last two full tiles are taken by all tiles, and
    pair by pair among themselves.
    """

    def __init__(self, pairs: Any) -> None:
        """Allocate for the forces and bodies of `pairs`."""
        self.pairs = pairs
        self.count, self.dimensions, self.lanes = pairs.particle_count, pairs.dimensions, pairs.lane_count
        self.twin_count = self.count // (2 * self.lanes)  # twins, of two full tiles each
        self.block_count = -(-self.count // BLOCK)
        self.chunk_count = chunk_count(self.count)
        self.adds_in_parallel = adds_in_parallel(self.count)
        self.turns = -(-self.block_count // self.chunk_count)
        self.row = self.block_count * BLOCK // self.lanes  # tiles with room for every body
        self.sums, self.reactions = (ti.Vector.field(self.lanes, float) for _ in range(2))
        self.totals = ti.field(float)  # sums over the rows of reactions
        self._memory = FieldGroup(
            (self.chunk_count * self.dimensions * self.row, self.sums),
            (self.chunk_count * self.dimensions * BLOCK, self.reactions, self.totals),
        )

    def destroy(self) -> None:
        """Free the memory."""
        self._memory.destroy()

    @ti.kernel
    def sum_accelerations(self, state: Template, sets: Template):
        """Add all accelerations, or set them where `sets`, in two loops; the second is parallel where `adds_in_parallel`."""
        for q in range(self.chunk_count * CPU_GRAIN):
            if is_heavy(q, CPU_GRAIN):
                chunk = q // CPU_GRAIN
                for k in range(self.dimensions * self.row):
                    self._store(self.sums, chunk * self.dimensions * self.row + k, ti.Vector.zero(float, self.lanes))
                for turn in range(self.turns):  # to and fro, because later blocks have more tiles before them
                    block = turn * self.chunk_count + (chunk if turn % 2 == 0 else self.chunk_count - 1 - chunk)
                    if block < self.block_count:
                        self._meet_block(state, chunk, block)
        if ti.static(not self.adds_in_parallel):
            ti.loop_config(serialize=True)
        for tile in range(-(-self.count // self.lanes)):
            self._add_chunks(state, tile, sets)

    # Rows of lanes

    def lane_of(self, field: Any, lane: int) -> Any:
        """One number of each vector of a field. With explicit vectors Taichi cannot load or store a whole vector of a field."""
        return field.get_scalar_field(lane)

    @ti.func
    def _load(self, field: Template, place):
        return ti.Vector([ti.static(self.lane_of(field, lane))[place] for lane in ti.static(range(self.lanes))])

    @ti.func
    def _store(self, field: Template, place, values):
        for lane in ti.static(range(self.lanes)):
            ti.static(self.lane_of(field, lane))[place] = values[lane]

    @ti.func
    def _sum_at(self, chunk, axis: Template, tile):
        return (chunk * self.dimensions + axis) * self.row + tile

    @ti.func
    def _reaction_at(self, chunk, k, axis: Template):
        return (chunk * BLOCK + k) * self.dimensions + axis

    # One chunk

    @ti.func
    def _meet_block(self, state: Template, chunk, block):
        """The pairs of the bodies of a block with each other and with all bodies before the block."""
        begin = block * BLOCK
        end = ti.min(begin + BLOCK, self.count)
        for k in range(BLOCK * self.dimensions):
            self._store(self.reactions, self._reaction_at(chunk, 0, 0) + k, ti.Vector.zero(float, self.lanes))
        for twin in range(ti.min(self.twin_count, -(-end // (2 * self.lanes)))):
            self._meet_twin(state, chunk, begin, end, twin)
        for k in range(self._reaction_at(chunk, 0, 0), self._reaction_at(chunk, BLOCK, 0)):
            row = self._load(self.reactions, k)
            part = [row[lane] for lane in ti.static(range(self.lanes))]
            for level in ti.static(range(self.lanes.bit_length() - 1)):  # in halves, so that few additions wait for each other
                for lane in ti.static(range(self.lanes >> (level + 1))):
                    part[lane] = part[lane] + part[lane + ti.static(self.lanes >> (level + 1))]
            self.totals[k] = part[0]
        for t in range(BLOCK // self.lanes):
            for axis in ti.static(range(self.dimensions)):
                place = self._sum_at(chunk, axis, begin // self.lanes + t)
                found = ti.Vector(
                    [
                        self.totals[self._reaction_at(chunk, t * self.lanes + lane, axis)]
                        for lane in ti.static(range(self.lanes))
                    ]
                )
                self._store(self.sums, place, self._load(self.sums, place) - found)

    @ti.func
    def _meet_twin(self, state: Template, chunk, begin, end, twin):
        """The pairs of two tiles with the later bodies from `begin` to `end`, and within the tiles if they lie in the block."""
        own = twin * 2 * self.lanes
        one, two = self._positions(state, own), self._positions(state, own + self.lanes)
        response_one, response_two = self._responses(state, own), self._responses(state, own + self.lanes)
        source_one, source_two = self._sources(state, own), self._sources(state, own + self.lanes)
        felt_one, felt_two = self._sums(chunk, 2 * twin), self._sums(chunk, 2 * twin + 1)
        for j in range(ti.max(begin, own + 2 * self.lanes), end):
            way_one, way_two = self._ways(state, one, j), self._ways(state, two, j)
            square_one, square_two = self.pairs.square(way_one), self.pairs.square(way_two)
            pull_one, push_one = ti.Vector.zero(float, self.lanes), ti.Vector.zero(float, self.lanes)
            pull_two, push_two = ti.Vector.zero(float, self.lanes), ti.Vector.zero(float, self.lanes)
            for group in ti.static(self.pairs.groups):
                softened_one = softened_square(square_one, group.softening_squared)
                softened_two = softened_square(square_two, group.softening_squared)
                inverse_one, inverse_two = inverse_roots(softened_one, softened_two, False)
                for member in ti.static(group.members):
                    pull_one, push_one = self._weigh(
                        state, member, response_one, source_one, j, inverse_one, pull_one, push_one
                    )
                    pull_two, push_two = self._weigh(
                        state, member, response_two, source_two, j, inverse_two, pull_two, push_two
                    )
            for axis in ti.static(range(self.dimensions)):
                felt_one[axis] = multiply_add(pull_one, way_one[axis], felt_one[axis])
                felt_two[axis] = multiply_add(pull_two, way_two[axis], felt_two[axis])
                place = self._reaction_at(chunk, j - begin, axis)
                reaction = multiply_add(push_one, way_one[axis], self._load(self.reactions, place))
                self._store(self.reactions, place, multiply_add(push_two, way_two[axis], reaction))
        if own >= begin:
            self._meet_own(state, own, 0, one, response_one, source_one, felt_one)
            self._meet_own(state, own, 1, two, response_two, source_two, felt_two)
        for axis in ti.static(range(self.dimensions)):
            self._store(self.sums, self._sum_at(chunk, axis, 2 * twin), felt_one[axis])
            self._store(self.sums, self._sum_at(chunk, axis, 2 * twin + 1), felt_two[axis])

    @ti.func
    def _meet_own(
        self,
        state: Template,
        own,
        which: Template,
        position: Template,
        response: Template,
        source: Template,
        felt: Template,
    ):
        """The pulls of all bodies of both tiles on one tile; in the lane of the body itself the squared distance gets a 1."""
        lane_number = ti.Vector([ti.cast(lane + which * self.lanes, float) for lane in ti.static(range(self.lanes))])
        for step in range(2 * self.lanes):
            j = own + step
            way = self._ways(state, position, j)
            from_own = lane_number - ti.cast(step, float)
            square = self.pairs.square(way) + ti.max(1.0 - from_own * from_own, 0.0)
            pull, push = ti.Vector.zero(float, self.lanes), ti.Vector.zero(float, self.lanes)
            for group in ti.static(self.pairs.groups):
                inverse = inverse_distance(square, group.softening_squared)
                for member in ti.static(group.members):
                    pull, push = self._weigh(state, member, response, source, j, inverse, pull, push)
            for axis in ti.static(range(self.dimensions)):
                felt[axis] = multiply_add(pull, way[axis], felt[axis])

    @ti.func
    def _positions(self, state: Template, own):
        return [
            ti.Vector([state.position[own + lane][axis] for lane in ti.static(range(self.lanes))])
            for axis in ti.static(range(self.dimensions))
        ]

    @ti.func
    def _responses(self, state: Template, own):
        return [
            ti.Vector([member.force.response(state, own + lane) for lane in ti.static(range(self.lanes))])
            for member in ti.static(self.pairs.members)
        ]

    @ti.func
    def _sources(self, state: Template, own):
        return [
            ti.Vector([member.force.source(state, own + lane) for lane in ti.static(range(self.lanes))])
            for member in ti.static(self.pairs.members)
        ]

    @ti.func
    def _sums(self, chunk, tile):
        return [self._load(self.sums, self._sum_at(chunk, axis, tile)) for axis in ti.static(range(self.dimensions))]

    @ti.func
    def _ways(self, state: Template, position: Template, j):
        """Components of the separations of body j from the bodies of a tile."""
        return [state.position[j][axis] - position[axis] for axis in ti.static(range(self.dimensions))]

    @ti.func
    def _weigh(self, state: Template, member: Template, response: Template, source: Template, j, inverse, pull, push):
        """Add the factors of one force, on the tile and on body j; a lone force takes its response at the end of the sum."""
        shape = self.pairs.shape_of(member, inverse)
        on_own = member.force.source(state, j) * shape
        on_j = source[member.index] * shape
        if ti.static(len(self.pairs.members) > 1):
            on_own = response[member.index] * on_own
            on_j = member.force.response(state, j) * on_j
        if ti.static(member.index > 0):
            on_own = pull + on_own
            on_j = push + on_j
        return on_own, on_j

    # All chunks

    @ti.func
    def _add_chunks(self, state: Template, tile, sets: Template):
        """Add, or set, the sums of all chunks for a tile; and the pairs of the bodies after the last two full tiles."""
        for axis in ti.static(range(self.dimensions)):
            total = ti.Vector.zero(float, self.lanes)
            for chunk in range(self.chunk_count):
                total = total + self._load(self.sums, self._sum_at(chunk, axis, tile))
            for lane in ti.static(range(self.lanes)):
                i = tile * self.lanes + lane
                if i < self.count:
                    addend = total[lane]
                    if ti.static(len(self.pairs.members) == 1):
                        addend = self.pairs.members[0].force.response(state, i) * addend
                    if ti.static(sets):
                        state.acceleration[i][axis] = addend
                    else:
                        state.acceleration[i][axis] = state.acceleration[i][axis] + addend
        rest = self.twin_count * 2 * self.lanes
        for i in range(ti.max(tile * self.lanes, rest), ti.min((tile + 1) * self.lanes, self.count)):
            for j in range(rest, self.count):
                if i != j:
                    found = self.pairs.acceleration_from(state, i, j)
                    for axis in ti.static(range(self.dimensions)):
                        state.acceleration[i][axis] = state.acceleration[i][axis] + found[axis]
