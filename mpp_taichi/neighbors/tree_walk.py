"""Tree walk: far nodes pull as multipoles, and the bodies of near leaves pull one by one.

A node of mass M and second moments Q = Σ m δ δᵀ about its center of mass, at d from a body, with u = (|d|² + ε²)^(−1/2):

    a = G { d u³ [M + u² (7.5 dᵀQd u² − 1.5 tr Q)] − 3 Q d u⁵ },   φ = −G u [M + u² (1.5 dᵀQd u² − 0.5 tr Q)]

which is Plummer's potential expanded to second order; without softening the traces belong to the quadrupole. The first order
vanishes about the center of mass. `tree_estimate.py` decides which nodes are far enough. The bodies of a group share a walk.
"""

from typing import Any

import taichi as ti

from mpp_taichi.arithmetic.inverse_distance import inverse_root, softened_square
from mpp_taichi.device.fast_taichi.explicit_vectors import explicit_vectors
from mpp_taichi.device.fast_taichi.lane_arithmetic import VECTOR_BYTES, inverse_roots, multiply_add
from mpp_taichi.device.heavy_loops import CPU_GRAIN, is_heavy
from mpp_taichi.neighbors.tree_estimate import GROUP
from mpp_taichi.neighbors.tree_nodes import LEAF
from mpp_taichi.state.field_group import FieldGroup
from mpp_taichi.types import Template

CHUNKS_PER_THREAD = 16  # pieces of the work; a thread takes the next piece when it is free
LIST = 256  # entries of a list, an even number; a full list is summed. A list of nodes takes 23 KiB of the cache
LISTED_BODIES = 1024  # with which a list of runs is full, too: round-off of a sum grows with the number of its terms


@ti.data_oriented
class TreeWalk:
    """Sums by slot, in the units of the frame with G = 1.

    total   (padded_count × dimensions,) accelerations, axis after axis
    well    (padded_count,) −φ, where the potential was asked for
    """

    def __init__(self, order: Any, nodes: Any, estimate: Any) -> None:
        """Allocate for the bodies of a TreeOrder, their TreeNodes and TreeEstimate."""
        config = ti.lang.impl.current_cfg()
        self.order, self.nodes = order, nodes
        self.dimensions = order.dimensions
        self.padded_count = order.padded_count
        self.group_count = order.padded_count // GROUP
        self.estimate = estimate
        self.lane_count = min(GROUP, VECTOR_BYTES // (4 if config.default_fp == ti.f32 else 8))
        self.tile_count = GROUP // self.lane_count
        self.chunk_count = CHUNKS_PER_THREAD * config.cpu_max_num_threads
        self.total, self.well, self.cells = (ti.field(float) for _ in range(3))
        self.runs = ti.field(ti.i32)
        self._memory = FieldGroup(
            (self.padded_count * self.dimensions, self.total),
            (self.padded_count, self.well),
            (self.chunk_count * LIST * nodes.moment_width, self.cells),
            (self.chunk_count * LIST * 2, self.runs),
        )

    def destroy(self) -> None:
        """Free the memory."""
        self._memory.destroy()

    def begin(self, accuracy: float, tolerance: float) -> None:
        """Nothing: the limits of the groups are all that a walk reads."""

    def run(self, softening: float, *, potential: bool) -> None:
        """Compute the accelerations of the pending groups, and the potential where `potential`."""
        with explicit_vectors():
            self._walk(softening * softening, potential)

    # The lists of nodes and bodies

    @ti.kernel
    def _walk(self, softening_squared: float, potential: Template):
        for q in range(self.chunk_count * CPU_GRAIN):
            if is_heavy(q, CPU_GRAIN):
                chunk = q // CPU_GRAIN
                for group in range(self._begin(chunk), self._begin(chunk + 1)):
                    if self.estimate.pending[group] == 1:
                        self._serve(chunk * LIST, group, softening_squared, potential)

    @ti.func
    def _begin(self, chunk):
        """Index of the first group of a chunk; in 64 bits, because the product may not fit 32."""
        return ti.cast(ti.cast(chunk, ti.i64) * self.group_count // self.chunk_count, ti.i32)

    @ti.func
    def _serve(self, entry, group, softening_squared, potential: Template):
        """Compute the sums of a group, with the lists that begin at `entry`."""
        d = ti.static(self.dimensions)
        width = ti.static(self.nodes.moment_width)
        begin = group * GROUP
        corner = self.estimate.group_node(group) * self.nodes.box_width
        lower = [self.nodes.box[corner + axis] for axis in ti.static(range(d))]
        upper = [self.nodes.box[corner + d + axis] for axis in ti.static(range(d))]
        limit = self.estimate.limit[group]
        for tile in range(self.tile_count):
            self._sum_group(begin, begin + tile * self.lane_count, softening_squared, potential)
        node = 0
        variance = 0.0
        while node < self.nodes.node_count:
            cells = 0
            runs = 0
            bodies = 0
            last_end = -1
            while node < self.nodes.node_count and cells < LIST and runs < LIST and bodies < LISTED_BODIES:
                shape = node * self.nodes.shape_width
                squared = 0.0
                for axis in ti.static(range(d)):
                    x = self.nodes.shape[shape + axis]
                    way = ti.max(lower[axis] - x, x - upper[axis], 0.0)
                    squared += way * way
                distance = ti.sqrt(softened_square(squared, softening_squared))
                radius, octupole = self.nodes.shape[shape + d], self.nodes.shape[shape + d + 1]
                if self.estimate.is_far(squared, distance, radius, octupole, limit):
                    for k in ti.static(range(width)):
                        self.cells[(entry + cells) * width + k] = self.nodes.moments[node * width + k]
                    cells += 1
                    variance += self.estimate.variance_of(distance, self.nodes.shape[shape + d + 2])
                    node = self.nodes.skip[node]
                else:
                    if self.nodes.leaves[node] == 1:
                        first = self.nodes.first_leaf[node] * LEAF
                        if first < begin or first >= begin + GROUP:
                            if first == last_end:
                                runs -= 1  # the leaf continues the run before
                            else:
                                self.runs[(entry + runs) * 2] = first
                            last_end = first + LEAF
                            self.runs[(entry + runs) * 2 + 1] = last_end
                            runs += 1
                            bodies += LEAF
                    node += 1
            if cells % 2 == 1:  # nodes are summed in twos: add a node without mass, for which the even LIST has room
                for k in ti.static(range(width)):
                    self.cells[(entry + cells) * width + k] = 0.0
                    if ti.static(k < d):
                        self.cells[(entry + cells) * width + k] = self.cells[(entry + cells - 1) * width + k]
                cells += 1
            for tile in range(self.tile_count):
                slot = begin + tile * self.lane_count
                self._sum_lists(slot, entry, cells, runs, softening_squared, potential)
        self.estimate.variance[group] = variance

    # The sums, with a lane for each body

    @ti.func
    def _coordinate(self, slot, axis: Template):
        return self.order.position[axis * self.padded_count + slot]

    @ti.func
    def _lanes(self, slot, axis: Template):
        """One coordinate of the bodies of a tile, a lane for each."""
        return ti.Vector([self._coordinate(slot + lane, axis) for lane in ti.static(range(self.lane_count))])

    @ti.func
    def _way(self, j, position: Template):
        """Separations of body j from the bodies of a tile, axis by axis."""
        return [
            self.order.position[axis * self.padded_count + j] - position[axis] for axis in ti.static(range(self.dimensions))
        ]

    @ti.func
    def _square(self, way: Template, softening_squared):
        """ρ² of the separations of a tile, given by components. Here ε² is added first, which rounds unlike ε² added last."""
        result = softened_square(way[0] * way[0], softening_squared)
        for axis in ti.static(range(1, self.dimensions)):
            result = multiply_add(way[axis], way[axis], result)
        return result

    @ti.func
    def _sum_group(self, begin, slot, softening_squared, potential: Template):
        """Set the sums of the tile at `slot` to the sums over the bodies of its group."""
        d = ti.static(self.dimensions)
        position = [self._lanes(slot, axis) for axis in ti.static(range(d))]
        total = [ti.Vector.zero(float, self.lane_count) for axis in ti.static(range(d))]
        well = ti.Vector.zero(float, self.lane_count)
        lane_number = ti.Vector([ti.cast(lane, float) for lane in ti.static(range(self.lane_count))])
        for j in range(begin, begin + GROUP):
            way = self._way(j, position)
            from_own = lane_number - ti.cast(j - slot, float)
            own = ti.max(1.0 - from_own * from_own, 0.0)  # 1 in the lane of body j itself, 0 in the others
            inverse = inverse_root(self._square(way, softening_squared) + own)
            pull = self.order.mass[j] * inverse
            if ti.static(potential):
                well = well + pull * (1.0 - own)
            pull = pull * (inverse * inverse)
            for axis in ti.static(range(d)):
                total[axis] = multiply_add(pull, way[axis], total[axis])
        for lane in ti.static(range(self.lane_count)):
            for axis in ti.static(range(d)):
                self.total[axis * self.padded_count + slot + lane] = total[axis][lane]
            if ti.static(potential):
                self.well[slot + lane] = well[lane]

    @ti.func
    def _sum_lists(self, slot, entry, cells, runs, softening_squared, potential: Template):
        """Add the pulls of the lists to the sums of a tile, in twos, because two inverse roots at a time are faster."""
        d = ti.static(self.dimensions)
        position = [self._lanes(slot, axis) for axis in ti.static(range(d))]
        total = [ti.Vector.zero(float, self.lane_count) for axis in ti.static(range(d))]
        well = ti.Vector.zero(float, self.lane_count)
        for pair in range(cells // 2):
            a = (entry + 2 * pair) * self.nodes.moment_width
            b = a + self.nodes.moment_width
            to_a = [self.cells[a + axis] - position[axis] for axis in ti.static(range(d))]
            to_b = [self.cells[b + axis] - position[axis] for axis in ti.static(range(d))]
            inverse_a, inverse_b = inverse_roots(
                self._square(to_a, softening_squared), self._square(to_b, softening_squared), False
            )
            along_a, across_a, turned_a, depth_a = self.nodes.pull(self.cells, a, to_a, inverse_a)
            along_b, across_b, turned_b, depth_b = self.nodes.pull(self.cells, b, to_b, inverse_b)
            for axis in ti.static(range(d)):
                total[axis] = total[axis] + (along_a * to_a[axis] - across_a * turned_a[axis])
                total[axis] = total[axis] + (along_b * to_b[axis] - across_b * turned_b[axis])
            if ti.static(potential):
                well = well + depth_a + depth_b
        for run in range(runs):
            first = self.runs[(entry + run) * 2]
            last = self.runs[(entry + run) * 2 + 1]
            for pair in range((last - first) // 2):
                j = first + 2 * pair
                to_j = self._way(j, position)
                to_k = self._way(j + 1, position)
                inverse_j, inverse_k = inverse_roots(
                    self._square(to_j, softening_squared), self._square(to_k, softening_squared), False
                )
                pull_j = self.order.mass[j] * (inverse_j * inverse_j * inverse_j)
                pull_k = self.order.mass[j + 1] * (inverse_k * inverse_k * inverse_k)
                for axis in ti.static(range(d)):
                    total[axis] = multiply_add(pull_j, to_j[axis], total[axis])
                    total[axis] = multiply_add(pull_k, to_k[axis], total[axis])
                if ti.static(potential):
                    well = well + self.order.mass[j] * inverse_j + self.order.mass[j + 1] * inverse_k
        for lane in ti.static(range(self.lane_count)):
            for axis in ti.static(range(d)):
                k = axis * self.padded_count + slot + lane
                self.total[k] = self.total[k] + total[axis][lane]
            if ti.static(potential):
                self.well[slot + lane] = self.well[slot + lane] + well[lane]
