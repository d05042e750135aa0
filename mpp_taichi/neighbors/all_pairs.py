"""All pairs: the direct sum of the pair forces over all pairs, in three loop shapes; a fourth is in symmetric_pairs.py.

    a_i += sum over forces of response_i * sum over j != i of source_j * shape(s_ij) * d_ij
    d_ij = x_j - x_i,  s_ij = (|d_ij|^2 + softening^2)^(-1/2)

A pair force is a formula: `softening` (a Python number) and the Taichi functions `response(state, i)`,
`source(state, j)`, `shape(inverse_distance)`, `potential(state, i, j, inverse_distance)`. Forces of equal softening share
one inverse distance. No loop uses an atomic, and each sum is taken in one order: the bits do not depend on the threads.
"""

from collections.abc import Sequence
from typing import Any

import taichi as ti

from mpp_taichi.arithmetic.force_numbers import parameter, wide_number
from mpp_taichi.arithmetic.inverse_distance import inverse_distance, softened_square
from mpp_taichi.arithmetic.low_parts import added
from mpp_taichi.arithmetic.particle_update import separation, wide_position
from mpp_taichi.device.fast_taichi.explicit_vectors import explicit_vectors, require_components_apart
from mpp_taichi.device.fast_taichi.lane_arithmetic import VECTOR_BYTES, inverse_roots, multiply_add
from mpp_taichi.device.heavy_loops import CPU_GRAIN, is_heavy
from mpp_taichi.neighbors._pair_groups import grouped
from mpp_taichi.neighbors.symmetric_pairs import SymmetricPairs, adds_in_parallel
from mpp_taichi.types import Template

GATHERED = 256  # bodies of a block, whose sum a thread of a GPU adds to the total
BLOCK_PAIRS = 16  # pairs of a block, whose sum is added with a low part: a plain sum of thousands loses three bits
SYMMETRIC_COUNT = 512  # least number of bodies at which the evaluation of each pair once is faster
UNROLLED_PAIRS = 36  # up to nine bodies the serial double loop is written out; beyond, compiling would take seconds


@ti.data_oriented
class AllPairs:
    """Direct sum over all pairs: O(N²) work, and no memory beyond the memory of the state.

    Range: squared distances must be normal numbers of the precision, so in f32 distances must lie between 1.1e-19 and 1.8e19
    [length]. An inverse cube needs distances between 1.5e-13 and 4e12; beyond 4e12 it loses digits to underflow, and from 9e14
    on it is zero. Outside the range a sum is inf, NaN or zero. Without softening two bodies at one place give NaN.
    """

    all_pairs = property(lambda self: self, doc="This sum; sums that are built on it have it under the same name.")

    def __init__(self, pair_forces: Sequence[Any], particle_count: int, dimensions: int, *, merges: bool = False) -> None:
        """Sort the forces by softening; needs a started Taichi, whose precision and thread count it takes.

        `merges`: a body may become part of another body (`state.merged_into`), and then pulls no other body.
        """
        self.merges = merges
        config = ti.lang.impl.current_cfg()
        self.particle_count, self.dimensions = particle_count, dimensions
        self.members, self.groups = grouped(pair_forces)
        widest = VECTOR_BYTES // (4 if config.default_fp == ti.f32 else 8)
        self.lane_count = min(widest, 1 << (particle_count.bit_length() - 1))
        self.tile_count = -(-particle_count // self.lane_count)
        self.thread_count = config.cpu_max_num_threads
        self.has_work = particle_count > 1 and len(self.members) > 0
        self.longest_loop = particle_count
        self._checked_state: Any = None
        self._symmetric: SymmetricPairs | None = None
        self.unrolled = particle_count * (particle_count - 1) // 2 <= UNROLLED_PAIRS
        self.in_tiles = not self.unrolled and len(self.members) == 1  # how one thread sums
        self.sets_directly = particle_count == 2  # saves a tenth of a step; with more bodies it is faster to store zeros first

    @ti.func
    def accumulate_serial(self, state: Template, first):
        """Add the accelerations of particles first … first + N - 1; for use inside a serialized loop.

        Each pair is visited once and acts both ways (Newton's third law).
        """
        if ti.static(self.has_work):
            if ti.static(self.unrolled):
                self._accumulate_unrolled(state, first, False)
            elif ti.static(self.in_tiles):
                for tile in range(self.tile_count):
                    self._accumulate_tile(state, first, tile)
            else:
                for i in range(first, first + self.particle_count):
                    for j in range(i + 1, first + self.particle_count):
                        d = separation(state, i, j)
                        on_i, on_j = self._weights(state, i, j, d.dot(d))
                        state.acceleration[i] = state.acceleration[i] + on_i * d
                        state.acceleration[j] = state.acceleration[j] - on_j * d

    @ti.func
    def set_serial(self, state: Template, first):
        """Like accumulate_serial, but overwrites the accelerations; only where `unrolled`."""
        self._accumulate_unrolled(state, first, True)

    @ti.func
    def _accumulate_unrolled(self, state: Template, first, from_zero: Template):
        """The sum in registers: each position is read once, and each acceleration is written once."""
        position = [state.position[first + i] for i in ti.static(range(self.particle_count))]
        low = [self._low(state, first + i) for i in ti.static(range(self.particle_count))]
        total = [ti.Vector.zero(float, self.dimensions) for i in ti.static(range(self.particle_count))]
        if ti.static(not from_zero):
            for i in ti.static(range(self.particle_count)):
                total[i] = state.acceleration[first + i]
        for i in ti.static(range(self.particle_count)):
            for j in ti.static(range(i + 1, self.particle_count)):
                d = position[j] - position[i]
                if ti.static(state.forces_see_low):
                    d = d + (low[j] - low[i])
                on_i, on_j = self._weights(state, first + i, first + j, d.dot(d))
                total[i] = total[i] + on_i * d
                total[j] = total[j] - on_j * d
        for i in ti.static(range(self.particle_count)):
            state.acceleration[first + i] = total[i]

    @ti.func
    def _low(self, state: Template, i):
        """Low part of the position of body i where forces see low parts, else zero."""
        result = ti.Vector.zero(float, self.dimensions)
        if ti.static(state.forces_see_low):
            result = state.position_low[i]
        return result

    @ti.func
    def _weights(self, state: Template, i, j, distance_squared):
        """Factors of d_ij in the accelerations of i and, with the opposite sign, of j."""
        on_i = 0.0
        on_j = 0.0
        distance_squared = self._apart(self._apart(distance_squared, state, i), state, j)
        for group in ti.static(self.groups):
            inverse = inverse_distance(distance_squared, group.softening_squared)
            for member in ti.static(group.members):
                shape = member.force.shape(inverse)
                on_i += member.force.response(state, i) * (member.force.source(state, j) * shape)
                on_j += member.force.response(state, j) * (member.force.source(state, i) * shape)
        return on_i, on_j

    @ti.func
    def _apart(self, squared, state: Template, j):
        """A squared distance from j, plus 1 where j has merged: j may lie where another body is, and 0 · 1/0 is not 0."""
        result = squared
        if ti.static(self.merges):
            result = squared + ti.cast(state.merged_into[j] >= 0, float)
        return result

    # One thread of a GPU per body

    @ti.func
    def accumulate_parallel_gather(self, state: Template):
        """Add all accelerations, one body per iteration of a parallel loop; for GPUs."""
        if ti.static(self.has_work):
            for i in range(self.particle_count):
                self._gather_in_blocks(state, i)

    @ti.func
    def _gather_in_blocks(self, state: Template, i):
        """Sum over blocks of bodies, so that few terms meet the large total; with a low part where forces see low parts."""
        size = ti.static(2 * BLOCK_PAIRS if state.forces_see_low else GATHERED)
        whole = state.acceleration[i]
        lost = ti.Vector.zero(float, self.dimensions)
        for block in range(-(-self.particle_count // size)):
            total = ti.Vector.zero(float, self.dimensions)
            for j in range(block * size, ti.min((block + 1) * size, self.particle_count)):
                if i != j:
                    total += self.acceleration_from(state, i, j)
            if ti.static(state.forces_see_low):
                for axis in ti.static(range(self.dimensions)):
                    whole[axis], lost[axis] = added(state, whole[axis], lost[axis], total[axis])
            else:
                whole += total
        state.acceleration[i] = whole

    @ti.func
    def acceleration_from(self, state: Template, i, j):
        """Acceleration of body i by body j."""
        d = separation(state, i, j)
        distance_squared = self._apart(d.dot(d), state, j)
        weight = 0.0
        for group in ti.static(self.groups):
            inverse = inverse_distance(distance_squared, group.softening_squared)
            for member in ti.static(group.members):
                source = member.force.source(state, j)
                weight += member.force.response(state, i) * (source * member.force.shape(inverse))
        return weight * d

    # Cores of a CPU, lanes of their vector units

    def is_symmetric(self, state: Any) -> bool:
        """Whether `add_accelerations` evaluates each pair once, which is no faster for few bodies."""
        return self.particle_count >= SYMMETRIC_COUNT and not self.merges and not state.forces_see_low

    def loops(self, state: Any) -> int:
        """Number of parallel loops of `add_accelerations`."""
        return 2 if self.is_symmetric(state) and adds_in_parallel(self.particle_count) else 1

    def destroy(self) -> None:
        """Free the memory of the sums."""
        if self._symmetric is not None:
            self._symmetric.destroy()

    def add_accelerations(self, state: Any) -> None:
        """Add all accelerations on the CPU in a launch of its own, compiled with explicit vectors.

        Raises TypeError when the vectors of the state are not stored component by component (`ti.Layout.SOA`): Taichi
        would store nothing, without an error.
        """
        self._check(state)
        if self.is_symmetric(state):
            return self._launch_symmetric(state, sets=False)
        with explicit_vectors():
            self._accumulate_on_cpu(state)

    def set_accelerations(self, state: Any) -> None:
        """Like add_accelerations, but overwrites the accelerations; only where `is_symmetric`."""
        self._check(state)
        self._launch_symmetric(state, sets=True)

    def _launch_symmetric(self, state: Any, *, sets: bool) -> None:
        self._symmetric = self._symmetric or SymmetricPairs(self)
        with explicit_vectors():
            self._symmetric.sum_accelerations(state, sets)

    def _check(self, state: Any) -> None:
        if state is not self._checked_state:
            low = ("position_low",) if state.forces_see_low else ()
            require_components_apart(state, ("position", "acceleration", *low))
            self._checked_state = state

    @ti.kernel
    def _accumulate_on_cpu(self, state: Template):
        self.accumulate_parallel_cpu(state)

    @ti.func
    def accumulate_parallel_cpu(self, state: Template):
        """Add all accelerations, a tile of `lane_count` bodies at a time, one lane per body.

        For a lone force and vectors stored component by component, LLVM makes vector instructions of the lanes by itself. For
        several forces it may not, and `add_accelerations` is then up to five times faster.
        """
        if ti.static(self.has_work):
            for block in range(self.thread_count * CPU_GRAIN):
                if is_heavy(block, CPU_GRAIN):
                    thread = block // CPU_GRAIN
                    begin = thread * self.tile_count // self.thread_count
                    end = (thread + 1) * self.tile_count // self.thread_count
                    for tile in range(begin, end):
                        self._accumulate_tile(state, 0, tile)

    @ti.func
    def _accumulate_tile(self, state: Template, first, tile):
        # The last tile is moved back to be full. The bodies that it shares with the tile before are stored by that tile.
        begin = first + ti.min(tile * self.lane_count, self.particle_count - self.lane_count)
        position = [
            ti.Vector([state.position[begin + lane][axis] for lane in ti.static(range(self.lane_count))])
            for axis in ti.static(range(self.dimensions))
        ]
        low = [self._low_lanes(state, begin, axis) for axis in ti.static(range(self.dimensions))]
        response = [
            ti.Vector([member.force.response(state, begin + lane) for lane in ti.static(range(self.lane_count))])
            for member in ti.static(self.members)
        ]
        total = [ti.Vector.zero(float, self.lane_count) for axis in ti.static(range(self.dimensions))]
        whole = [ti.Vector.zero(float, self.lane_count) for axis in ti.static(range(self.dimensions))]
        lost = [ti.Vector.zero(float, self.lane_count) for axis in ti.static(range(self.dimensions))]
        others = ti.static(self.particle_count - self.lane_count)

        # Bodies outside the tile, in twos, because two inverse roots at a time are faster.
        pairs = ti.static(others // 2)
        block_pairs = ti.static(BLOCK_PAIRS if state.forces_see_low else max(pairs, 1))
        for block in range(-(-pairs // block_pairs)):
            for pair in range(block * block_pairs, ti.min((block + 1) * block_pairs, pairs)):
                j = self._outside(first + 2 * pair, begin)
                k = self._outside(first + 2 * pair + 1, begin)
                to_j = [self._way(state, j, axis, position, low) for axis in ti.static(range(self.dimensions))]
                to_k = [self._way(state, k, axis, position, low) for axis in ti.static(range(self.dimensions))]
                squared_j = self._apart(self.square(to_j), state, j)
                squared_k = self._apart(self.square(to_k), state, k)
                weight_j = ti.Vector.zero(float, self.lane_count)
                weight_k = ti.Vector.zero(float, self.lane_count)
                for group in ti.static(self.groups):
                    softened_j = softened_square(squared_j, group.softening_squared)
                    softened_k = softened_square(squared_k, group.softening_squared)
                    inverse_j, inverse_k = inverse_roots(softened_j, softened_k, state.forces_see_low)
                    for member in ti.static(group.members):
                        weight_j = self._add_weight(weight_j, state, member, response, j, inverse_j)
                        weight_k = self._add_weight(weight_k, state, member, response, k, inverse_k)
                for axis in ti.static(range(self.dimensions)):
                    total[axis] = multiply_add(weight_j, to_j[axis], total[axis])
                    total[axis] = multiply_add(weight_k, to_k[axis], total[axis])
            self._put_by(state, total, whole, lost)

        lane_number = ti.Vector([ti.cast(lane, float) for lane in ti.static(range(self.lane_count))])
        # The bodies of the tile, and a last odd body. In the lane of the body itself the squared distance gets a 1 and d is 0.
        for step in range(self.lane_count + others % 2):
            j = begin + step
            if step == self.lane_count:
                j = self._outside(first + others - 1, begin)
            to_j = [self._way(state, j, axis, position, low) for axis in ti.static(range(self.dimensions))]
            from_own = lane_number - ti.cast(step, float)
            own = ti.max(1.0 - from_own * from_own, 0.0)  # 1 in lane `step`, 0 in the others
            squared = self._apart(self.square(to_j) + own, state, j)
            weight = ti.Vector.zero(float, self.lane_count)
            for group in ti.static(self.groups):
                inverse = inverse_distance(squared, group.softening_squared)
                for member in ti.static(group.members):
                    weight = self._add_weight(weight, state, member, response, j, inverse)
            for axis in ti.static(range(self.dimensions)):
                total[axis] = multiply_add(weight, to_j[axis], total[axis])
        self._put_by(state, total, whole, lost)
        if ti.static(state.forces_see_low):
            for axis in ti.static(range(self.dimensions)):
                total[axis] = whole[axis]

        for lane in ti.static(range(self.lane_count)):
            i = begin + lane
            if i >= first + tile * self.lane_count:
                for axis in ti.static(range(self.dimensions)):
                    addend = total[axis][lane]
                    if ti.static(len(self.members) == 1):
                        addend = response[0][lane] * addend
                    state.acceleration[i][axis] = state.acceleration[i][axis] + addend

    @ti.func
    def _outside(self, order, begin):
        """Index of a body outside the tile, from its number among the bodies outside."""
        return order + ti.select(order >= begin, self.lane_count, 0)

    @ti.func
    def _low_lanes(self, state: Template, begin, axis: Template):
        """Low parts of the positions of a tile where forces see low parts, else zeros."""
        result = ti.Vector.zero(float, self.lane_count)
        if ti.static(state.forces_see_low):
            result = ti.Vector([state.position_low[begin + lane][axis] for lane in ti.static(range(self.lane_count))])
        return result

    @ti.func
    def _way(self, state: Template, j, axis: Template, position: Template, low: Template):
        """One component of the separations of body j from the bodies of a tile."""
        result = state.position[j][axis] - position[axis]
        if ti.static(state.forces_see_low):
            result = result + (state.position_low[j][axis] - low[axis])
        return result

    @ti.func
    def _put_by(self, state: Template, total: Template, whole: Template, lost: Template):
        """For forces that see low parts: add a block's sum to `whole`, with its rounding error in `lost`; clear the sum."""
        if ti.static(state.forces_see_low):
            for axis in ti.static(range(self.dimensions)):
                whole[axis], lost[axis] = added(state, whole[axis], lost[axis], total[axis])
                total[axis] = ti.Vector.zero(float, self.lane_count)

    @ti.func
    def square(self, separation: Template):
        """Squared lengths of the separations of a tile, which are given by components."""
        squared = separation[0] * separation[0]
        for axis in ti.static(range(1, self.dimensions)):
            squared = multiply_add(separation[axis], separation[axis], squared)
        return squared

    @ti.func
    def _add_weight(self, weight, state: Template, member: Template, response: Template, j, inverse):
        """Add the factor of one force to the weight of the separation; a lone force has its response at the end of the sum."""
        addend = member.force.source(state, j) * self.shape_of(member, inverse)
        if ti.static(len(self.members) > 1):
            addend = response[member.index] * addend
        result = addend
        if ti.static(member.index > 0):
            result = weight + addend
        return result

    @ti.func
    def shape_of(self, member: Template, inverse):
        """Shape of a force for each of a vector of inverse distances."""
        shape = inverse
        if ti.static(member.elementwise):
            shape = member.force.shape(inverse)
        else:
            shape = ti.Vector([member.force.shape(inverse[lane]) for lane in ti.static(range(self.lane_count))])
        return shape

    # Energy

    @ti.func
    def potential_energy_of(self, state: Template, i):
        """Half of the potential energy of body i with all other bodies of its replica, in the widest float (`state.wide`).

        Constants are rounded as in the forces, so that the potential belongs to the forces.
        """
        energy = ti.cast(0.0, state.wide)
        first = i // self.particle_count * self.particle_count
        position = wide_position(state, i)
        for j in range(first, first + self.particle_count):
            if j != i:
                energy += 0.5 * self.potential_between(state, i, j, wide_position(state, j) - position)
        return energy

    @ti.func
    def potential_between(self, state: Template, i, j, separation):
        """Potential energy of the bodies i and j at a separation in `state.wide`."""
        energy = ti.cast(0.0, state.wide)
        distance_squared = self._apart(self._apart(separation.dot(separation), state, i), state, j)
        for group in ti.static(self.groups):
            inverse = inverse_distance(distance_squared, wide_number(state, parameter(state, group.softening_squared)))
            for member in ti.static(group.members):
                energy += member.force.potential(state, i, j, inverse)
        return energy
