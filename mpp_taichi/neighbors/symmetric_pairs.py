"""Symmetric pairs: the direct sum on the vector units of a CPU with every pair evaluated once (Newton's third law)."""

from typing import Any

import taichi as ti

from mpp_taichi.neighbors.lane_arithmetic import inverse_roots, multiply_add
from mpp_taichi.types import Template

BLOCK = 128  # bodies whose reactions stay in the first cache of a core; a multiple of every number of lanes
MOST_CHUNKS = 16  # sums that threads may work on at once
BODIES_PER_CHUNK = 512
SERIAL_SUMS = 1 << 14  # that are added up before another thread is awake
MOST_SUMS = 1 << 22  # of one axis, of all chunks together
SMALLEST_BLOCK = 512  # Taichi gives no CPU thread fewer iterations than this


def chunk_count(count: int) -> int:
    """Sums of so many bodies: two at least, as pairs are symmetric from 512 bodies on, which are worth a second thread."""
    return max(2, min(MOST_CHUNKS, count // BODIES_PER_CHUNK, MOST_SUMS // count))


def adds_in_parallel(count: int) -> bool:
    """Whether the loop over sums is; what one thread ends before another is awake it does alone."""
    return count * chunk_count(count) > SERIAL_SUMS


@ti.data_oriented
class SymmetricPairs:
    """The sum of an AllPairs with half of its square roots and divisions; to be compiled with explicit vectors.

    A tile of bodies, one to a lane, meets the bodies of a block behind it one by one. What the tile feels is summed in
    registers; what such a body feels, lane by lane in a row of its own that is summed up once its block is done. The blocks are
    dealt out to chunks with a sum each, and these are added in one order: the bits depend on the number of bodies, not on that
    of the threads. Bodies behind the last full tile are met by all tiles, and among themselves one by one.
    """

    def __init__(self, pairs: Any) -> None:
        """For the forces and bodies of `pairs`."""
        self.pairs = pairs
        self.count, self.dimensions, self.lanes = pairs.particle_count, pairs.dimensions, pairs.lane_count
        self.tile_count = self.count // self.lanes  # full ones
        self.block_count = -(-self.count // BLOCK)
        self.chunk_count = chunk_count(self.count)
        self.adds_in_parallel = adds_in_parallel(self.count)
        self.turns = -(-self.block_count // self.chunk_count)
        self.row = self.block_count * BLOCK // self.lanes  # tiles with room for every body
        builder = ti.FieldsBuilder()
        self.sums, self.reactions = (ti.Vector.field(self.lanes, float) for _ in range(2))
        self.totals = ti.field(float)  # of the rows of reactions
        builder.dense(ti.i, self.chunk_count * self.dimensions * self.row).place(self.sums)
        builder.dense(ti.i, self.chunk_count * self.dimensions * BLOCK).place(self.reactions)
        builder.dense(ti.i, self.chunk_count * self.dimensions * BLOCK).place(self.totals)
        self._tree = builder.finalize()

    def destroy(self) -> None:
        """Give the memory back."""
        self._tree.destroy()

    @ti.kernel
    def sum_accelerations(self, state: Template, sets: Template):
        """All accelerations, in two loops, the second as `adds_in_parallel` says; added to what there is unless it `sets`."""
        for q in range(self.chunk_count * SMALLEST_BLOCK):
            if q % SMALLEST_BLOCK == 0:
                chunk = q // SMALLEST_BLOCK
                for k in range(self.dimensions * self.row):
                    self._store(self.sums, chunk * self.dimensions * self.row + k, ti.Vector.zero(float, self.lanes))
                for turn in range(self.turns):  # to and fro, as later blocks have more tiles before them
                    block = turn * self.chunk_count + (chunk if turn % 2 == 0 else self.chunk_count - 1 - chunk)
                    if block < self.block_count:
                        self._meet_block(state, chunk, block)
        if ti.static(not self.adds_in_parallel):
            ti.loop_config(serialize=True)
        for tile in range(-(-self.count // self.lanes)):
            self._add_chunks(state, tile, sets)

    # Rows of lanes ---------------------------------------------------------------------------------------------------

    def lane_of(self, field: Any, lane: int) -> Any:
        """One number of each vector: where vectors are explicit, Taichi loads and stores no whole one."""
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

    # A chunk ---------------------------------------------------------------------------------------------------------

    @ti.func
    def _meet_block(self, state: Template, chunk, block):
        """The bodies of a block and all bodies before them."""
        begin = block * BLOCK
        end = ti.min(begin + BLOCK, self.count)
        for k in range(BLOCK * self.dimensions):
            self._store(self.reactions, self._reaction_at(chunk, 0, 0) + k, ti.Vector.zero(float, self.lanes))
        for tile in range(ti.min(self.tile_count, -(-end // self.lanes))):
            self._meet_tile(state, chunk, begin, end, tile)
        for k in range(self._reaction_at(chunk, 0, 0), self._reaction_at(chunk, BLOCK, 0)):
            row = self._load(self.reactions, k)
            part = [row[lane] for lane in ti.static(range(self.lanes))]
            for level in ti.static(range(self.lanes.bit_length() - 1)):  # in halves, so that few wait for each other
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
    def _meet_tile(self, state: Template, chunk, begin, end, tile):
        """A tile, the bodies from `begin` to `end` that lie behind it, and if it lies in the block those of the tile itself."""
        own = tile * self.lanes
        position = [
            ti.Vector([state.position[own + lane][axis] for lane in ti.static(range(self.lanes))])
            for axis in ti.static(range(self.dimensions))
        ]
        response = [
            ti.Vector([member.force.response(state, own + lane) for lane in ti.static(range(self.lanes))])
            for member in ti.static(self.pairs.members)
        ]
        source = [
            ti.Vector([member.force.source(state, own + lane) for lane in ti.static(range(self.lanes))])
            for member in ti.static(self.pairs.members)
        ]
        total = [self._load(self.sums, self._sum_at(chunk, axis, tile)) for axis in ti.static(range(self.dimensions))]
        first = ti.max(begin, own + self.lanes)

        # Two at a time, for the sake of their inverse roots.
        for pair in range(ti.max(end - first, 0) // 2):
            j = first + 2 * pair
            to_j = self._ways(state, position, j)
            to_k = self._ways(state, position, j + 1)
            square_j, square_k = self.pairs.square(to_j), self.pairs.square(to_k)
            pull_j, push_j = ti.Vector.zero(float, self.lanes), ti.Vector.zero(float, self.lanes)
            pull_k, push_k = ti.Vector.zero(float, self.lanes), ti.Vector.zero(float, self.lanes)
            for group in ti.static(self.pairs.groups):
                inverse_j, inverse_k = inverse_roots(
                    square_j + group.softening_squared, square_k + group.softening_squared, False
                )
                for member in ti.static(group.members):
                    pull_j, push_j = self._weigh(state, member, response, source, j, inverse_j, pull_j, push_j)
                    pull_k, push_k = self._weigh(state, member, response, source, j + 1, inverse_k, pull_k, push_k)
            for axis in ti.static(range(self.dimensions)):
                total[axis] = multiply_add(pull_j, to_j[axis], multiply_add(pull_k, to_k[axis], total[axis]))
                self._react(chunk, j - begin, axis, push_j, to_j[axis])
                self._react(chunk, j + 1 - begin, axis, push_k, to_k[axis])
        # The tile among itself, from both sides: a body's own lane gets a distance of one, and pulls by zero. And an odd one.
        lane_number = ti.Vector([ti.cast(lane, float) for lane in ti.static(range(self.lanes))])
        for step in range(0 if own >= begin else self.lanes, self.lanes + ti.max(end - first, 0) % 2):
            j = own + step if step < self.lanes else end - 1
            to_j = self._ways(state, position, j)
            from_own = lane_number - ti.cast(step, float)
            square_j = self.pairs.square(to_j) + ti.max(1.0 - from_own * from_own, 0.0)
            pull_j, push_j = ti.Vector.zero(float, self.lanes), ti.Vector.zero(float, self.lanes)
            for group in ti.static(self.pairs.groups):
                inverse = 1.0 / ti.sqrt(square_j + group.softening_squared)
                for member in ti.static(group.members):
                    pull_j, push_j = self._weigh(state, member, response, source, j, inverse, pull_j, push_j)
            for axis in ti.static(range(self.dimensions)):
                total[axis] = multiply_add(pull_j, to_j[axis], total[axis])
                if step == self.lanes:
                    self._react(chunk, j - begin, axis, push_j, to_j[axis])
        for axis in ti.static(range(self.dimensions)):
            self._store(self.sums, self._sum_at(chunk, axis, tile), total[axis])

    @ti.func
    def _ways(self, state: Template, position: Template, j):
        """Components of the separations of body j from those of a tile."""
        return [state.position[j][axis] - position[axis] for axis in ti.static(range(self.dimensions))]

    @ti.func
    def _weigh(self, state: Template, member: Template, response: Template, source: Template, j, inverse, pull, push):
        """Add one force's factors of the separations, on the tile and on body j; a lone force's response waits for the end."""
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

    @ti.func
    def _react(self, chunk, k, axis: Template, push, way):
        place = self._reaction_at(chunk, k, axis)
        self._store(self.reactions, place, multiply_add(push, way, self._load(self.reactions, place)))

    # The whole -------------------------------------------------------------------------------------------------------

    @ti.func
    def _add_chunks(self, state: Template, tile, sets: Template):
        """Add, or set, what all chunks found for a tile; and the pairs of a last one that is not full."""
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
        if tile == self.tile_count:
            for i in range(tile * self.lanes, self.count):
                for j in range(tile * self.lanes, self.count):
                    if i != j:
                        found = self.pairs.acceleration_from(state, i, j)
                        for axis in ti.static(range(self.dimensions)):
                            state.acceleration[i][axis] = state.acceleration[i][axis] + found[axis]
