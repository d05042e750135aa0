"""Pair sums with derivatives: acceleration, jerk and snap of all pairs, in one sweep.

    a_i = r_i Σ_j s_j g d,   ȧ_i = r_i Σ_j s_j (g w + ġ d),   ä_i = r_i Σ_j s_j (g q + 2 ġ w + g̈ d)
    d = x_j − x_i,  w = v_j − v_i,  q = a_j − a_i
    ġ = g′ u̇,  g̈ = g″ u̇² + g′ ü,  u = 1/ρ,  u̇ = −u³ d·w,  ü = 3 u⁵ (d·w)² − u³ (w·w + d·q)

g(u) is the shape of a pair force, g′ its `slope`, g″ its `curvature`. Source: differentiated by hand; for gravity these are
equations 2 and 3 of Nitadori & Makino, New Astronomy 13 (2008) 498.
"""

from typing import Any

import taichi as ti

from mpp_taichi.arithmetic.inverse_distance import (
    change_of_inverse_distance,
    inverse_distance,
    second_change_of_inverse_distance,
)
from mpp_taichi.device.fast_taichi.explicit_vectors import explicit_vectors, require_components_apart
from mpp_taichi.device.fast_taichi.lane_arithmetic import multiply_add
from mpp_taichi.device.heavy_loops import CPU_GRAIN, is_heavy
from mpp_taichi.neighbors._pair_groups import derivatives_take_lanes
from mpp_taichi.neighbors.all_pairs import AllPairs
from mpp_taichi.types import Template


@ti.data_oriented
class PairDerivatives:
    """Direct sum over all pairs of accelerations and one or two of their derivatives in time; O(N²).

    Reads `position`, `velocity` and, for the snap, `estimate`, an estimate of the accelerations; adds to `acceleration`, `jerk`
    and `snap`. As in AllPairs there are no atomics, and each sum has one order.
    """

    sets_directly = False
    in_tiles = False

    def __init__(self, pairs: AllPairs, derivatives: int) -> None:
        """Take forces, softenings and lanes from the sum of the accelerations; `derivatives` is 1 or 2."""
        self.pairs = self.all_pairs = pairs
        self.derivatives = derivatives
        self.particle_count, self.dimensions = pairs.particle_count, pairs.dimensions
        self.lane_count, self.tile_count = pairs.lane_count, pairs.tile_count
        self.groups, self.members = pairs.groups, pairs.members
        # A tile holds a body in each lane and reads all other bodies once. For few bodies the lanes are not worth the work.
        self.tiles_in_serial = len(self.members) == 1 and not pairs.unrolled
        self.elementwise = all(m.elementwise and derivatives_take_lanes(m.force) for m in self.members)
        self.longest_loop = pairs.longest_loop
        self._checked_state: Any = None

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
    def potential_energy_of(self, state: Template, i):
        """Half of the potential energy of body i with all others, as of AllPairs."""
        return self.pairs.potential_energy_of(state, i)

    @ti.func
    def potential_between(self, state: Template, i, j, separation):
        """Potential energy of the bodies i and j at a separation, as of AllPairs."""
        return self.pairs.potential_between(state, i, j, separation)

    # One thread

    @ti.func
    def accumulate_serial(self, state: Template, first):
        """Add all sums of the particles first … first + N − 1; for use inside a serialized loop."""
        if ti.static(self.tiles_in_serial):
            for tile in range(self.tile_count):
                self._accumulate_tile(state, first, tile)
        else:
            for i in range(first, first + self.particle_count):
                for j in range(i + 1, first + self.particle_count):
                    on_i, on_j = self._factors(state, i, j)
                    self._add(state, i, self._terms(state, i, j, on_i))
                    self._add(state, j, self._terms(state, i, j, -on_j))

    @ti.func
    def _factors(self, state: Template, i, j):
        """(g, ġ, g̈), times responses and sources, of the pull of j on i and of the pull of i on j."""
        d = state.position[j] - state.position[i]
        w = state.velocity[j] - state.velocity[i]
        approach, spread = d.dot(w), w.dot(w)
        if ti.static(self.derivatives > 1):
            spread += d.dot(state.estimate[j] - state.estimate[i])
        on_i = ti.Vector.zero(float, 3)
        on_j = ti.Vector.zero(float, 3)
        for group in ti.static(self.groups):
            inverse = inverse_distance(d.dot(d), group.softening_squared)
            change = change_of_inverse_distance(inverse, approach)
            second = second_change_of_inverse_distance(inverse, approach, spread)
            for member in ti.static(group.members):
                slope = member.force.slope(inverse)
                curved = member.force.curvature(inverse) * change * change + slope * second
                factors = ti.Vector([member.force.shape(inverse), slope * change, curved])
                on_i += member.force.response(state, i) * (member.force.source(state, j) * factors)
                on_j += member.force.response(state, j) * (member.force.source(state, i) * factors)
        return on_i, on_j

    @ti.func
    def _terms(self, state: Template, i, j, factors):
        """Acceleration, jerk and snap from the separation of j from i and these factors, a row for each."""
        d = state.position[j] - state.position[i]
        w = state.velocity[j] - state.velocity[i]
        result = ti.Matrix.zero(float, self.derivatives + 1, self.dimensions)
        snap = ti.Vector.zero(float, self.dimensions)
        if ti.static(self.derivatives > 1):
            q = state.estimate[j] - state.estimate[i]
            snap = factors[0] * q + 2.0 * factors[1] * w + factors[2] * d
        for axis in ti.static(range(self.dimensions)):
            result[0, axis] = factors[0] * d[axis]
            result[1, axis] = factors[0] * w[axis] + factors[1] * d[axis]
            if ti.static(self.derivatives > 1):
                result[2, axis] = snap[axis]
        return result

    @ti.func
    def _add(self, state: Template, i, terms):
        for axis in ti.static(range(self.dimensions)):
            state.acceleration[i][axis] = state.acceleration[i][axis] + terms[0, axis]
            state.jerk[i][axis] = state.jerk[i][axis] + terms[1, axis]
            if ti.static(self.derivatives > 1):
                state.snap[i][axis] = state.snap[i][axis] + terms[2, axis]

    # One thread of a GPU per body

    @ti.func
    def accumulate_parallel_gather(self, state: Template):
        """Add all sums, one body per iteration of a parallel loop; for GPUs."""
        for i in range(self.particle_count):
            total = ti.Matrix.zero(float, self.derivatives + 1, self.dimensions)
            for j in range(self.particle_count):
                if i != j:
                    on_i, _on_j = self._factors(state, i, j)
                    total += self._terms(state, i, j, on_i)
            self._add(state, i, total)

    # Cores of a CPU, lanes of their vector units

    def add_accelerations(self, state: Any) -> None:
        """Add all sums on the CPU in a launch of its own, compiled with explicit vectors.

        Raises TypeError when the vectors of the state are not stored component by component.
        """
        if state is not self._checked_state:
            require_components_apart(state, ("position", "velocity", "acceleration", "jerk"))
            self._checked_state = state
        with explicit_vectors():
            self._accumulate_on_cpu(state)

    @ti.kernel
    def _accumulate_on_cpu(self, state: Template):
        for block in range(self.pairs.thread_count * CPU_GRAIN):
            if is_heavy(block, CPU_GRAIN):
                thread = block // CPU_GRAIN
                begin = thread * self.tile_count // self.pairs.thread_count
                end = (thread + 1) * self.tile_count // self.pairs.thread_count
                for tile in range(begin, end):
                    self._accumulate_tile(state, 0, tile)

    def _fields(self, state: Any) -> list:
        """The fields that are read of every body. Without a snap the last is the velocity, whose terms the compiler drops."""
        return [state.position, state.velocity, *([state.estimate] if self.derivatives > 1 else [])]

    @ti.func
    def _lanes(self, field: Template, begin):
        """Entries of a vector field for the bodies of a tile: a vector of lanes for each axis."""
        return [
            ti.Vector([field[begin + lane][axis] for lane in ti.static(range(self.lane_count))])
            for axis in ti.static(range(self.dimensions))
        ]

    @ti.func
    def _accumulate_tile(self, state: Template, first, tile):
        # As in AllPairs, the last tile is moved back to be full, and stores only the bodies that the tile before does not.
        begin = first + ti.min(tile * self.lane_count, self.particle_count - self.lane_count)
        own = [self._lanes(field, begin) for field in ti.static(self._fields(state))]
        response = [
            ti.Vector([member.force.response(state, begin + lane) for lane in ti.static(range(self.lane_count))])
            for member in ti.static(self.members)
        ]
        total = [ti.Vector.zero(float, self.lane_count) for axis in ti.static(range(self.dimensions))]
        jerk = [ti.Vector.zero(float, self.lane_count) for axis in ti.static(range(self.dimensions))]
        snap = [ti.Vector.zero(float, self.lane_count) for axis in ti.static(range(self.dimensions))]
        nowhere = ti.Vector.zero(float, self.lane_count)
        for order in range(first, first + self.particle_count - self.lane_count):
            j = order + ti.select(order >= begin, self.lane_count, 0)
            self._pull(state, j, own, response, nowhere, total, jerk, snap)
        # In the lane of the body itself the squared distance gets a 1. There d, w and q are zero, and so are all terms.
        lane_number = ti.Vector([ti.cast(lane, float) for lane in ti.static(range(self.lane_count))])
        for step in range(self.lane_count):
            from_own = lane_number - ti.cast(step, float)
            self._pull(state, begin + step, own, response, ti.max(1.0 - from_own * from_own, 0.0), total, jerk, snap)
        for lane in ti.static(range(self.lane_count)):
            i = begin + lane
            if i >= first + tile * self.lane_count:
                factor = 1.0
                if ti.static(len(self.members) == 1):
                    factor = response[0][lane]
                for axis in ti.static(range(self.dimensions)):
                    state.acceleration[i][axis] = state.acceleration[i][axis] + factor * total[axis][lane]
                    state.jerk[i][axis] = state.jerk[i][axis] + factor * jerk[axis][lane]
                    if ti.static(self.derivatives > 1):
                        state.snap[i][axis] = state.snap[i][axis] + factor * snap[axis][lane]

    @ti.func
    def _pull(
        self,
        state: Template,
        j,
        own: Template,
        response: Template,
        apart: Template,
        total: Template,
        jerk: Template,
        snap: Template,
    ):
        """Add the terms of body j to the sums of a tile. `apart` is added to the squared distances, lane by lane."""
        fields = ti.static(self._fields(state))
        d = [state.position[j][axis] - own[0][axis] for axis in ti.static(range(self.dimensions))]
        w = [state.velocity[j][axis] - own[1][axis] for axis in ti.static(range(self.dimensions))]
        q = [fields[-1][j][axis] - own[-1][axis] for axis in ti.static(range(self.dimensions))]
        squared, approach, spread = self._dot(d, d) + apart, self._dot(d, w), self._dot(w, w) + self._dot(d, q)
        weight, rate, curve = squared, squared, squared
        for group in ti.static(self.groups):
            inverse = inverse_distance(squared, group.softening_squared)
            change = change_of_inverse_distance(inverse, approach)
            second = second_change_of_inverse_distance(inverse, approach, spread)
            for member in ti.static(group.members):
                source = member.force.source(state, j)
                shape = source * self._each_lane(member.force.shape, inverse)
                slope = source * self._each_lane(member.force.slope, inverse)
                curvature = source * self._each_lane(member.force.curvature, inverse)
                bend = curvature * change * change + slope * second
                if ti.static(len(self.members) == 1):
                    weight, rate, curve = shape, slope * change, bend
                elif ti.static(member.index == 0):
                    factor = response[member.index]
                    weight, rate, curve = factor * shape, factor * slope * change, factor * bend
                else:
                    factor = response[member.index]
                    weight, rate, curve = weight + factor * shape, rate + factor * slope * change, curve + factor * bend
        twice = 2.0 * rate
        for axis in ti.static(range(self.dimensions)):
            total[axis] = multiply_add(weight, d[axis], total[axis])
            jerk[axis] = multiply_add(weight, w[axis], multiply_add(rate, d[axis], jerk[axis]))
            if ti.static(self.derivatives > 1):
                pulled = multiply_add(twice, w[axis], multiply_add(curve, d[axis], snap[axis]))
                snap[axis] = multiply_add(weight, q[axis], pulled)

    @ti.func
    def _dot(self, one: Template, other: Template):
        result = one[0] * other[0]
        for axis in ti.static(range(1, self.dimensions)):
            result = multiply_add(one[axis], other[axis], result)
        return result

    @ti.func
    def _each_lane(self, formula: Template, inverse):
        result = inverse
        if ti.static(self.elementwise):
            result = formula(inverse)
        else:
            result = ti.Vector([formula(inverse[lane]) for lane in ti.static(range(self.lane_count))])
        return result
