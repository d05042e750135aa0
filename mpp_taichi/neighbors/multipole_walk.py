"""Fast multipole walk: far nodes act on whole nodes, by series, and not on each group of bodies.

The potential −φ(z + a) = Σ_n L_n a^n / n! near the centre of mass z of a target node is a series of order p. Its coefficients are
sums over source nodes with the multipoles M_m and the centre c (multipole_nodes.py):

    L_n = Σ_m M_m D_{n+m}(z − c),   |n| + |m| ≤ p,   D_n = ∂^n (1/ρ),   ρ² = d² + ε²

A target node hands its series on to its two children, L′_k = Σ_n L_n b^(n−k) / (n − k)! at z + b, and a group of bodies evaluates
it at each body: a_i = Σ_n L_{n+e_i} a^n / n!. So the cost of a force does not grow with N for each body.

A source is far enough from a target if d > b + r for the radii b and r of both, and

    (p + 1) S / (ρ^(p+1) (ρ − b − r)) ≤ factor · limit,   S = (M − q) r^p + q ((b + r)^p − p b r^(p−1)),   q = tr Q / b²,

which is the order of the first terms that are left out: the sum over k of the terms r^(p−k) P_k with the powers P_0 = M, P_1 = 0
about the centre of mass, and P_k ≤ tr Q b^(k−2). `limit` is that of the groups (tree_estimate.py), the least one in the target.
Source of the method: L. Greengard and V. Rokhlin, J. Comput. Phys. 73 (1987) 325; of the Cartesian series about centres of mass
and of errors by powers P_k: W. Dehnen, Comput. Astrophys. Cosmol. 1 (2014) 1; of the lists of a target, which its children
go on with: J. Stadel, PhD thesis, University of Washington (2001), §2.

Each target node has the list of sources that neither its parents nor itself settled. Each of them is taken apart until its parts
are smaller than the target, and is then left to the children. A group settles its whole list: by series, by the multipoles of
`tree_walk.py`, and body by body. Where a list would be full, the groups below the target walk alone, as in `tree_walk.py`.
"""

from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.arithmetic.inverse_distance import inverse_root, softened_square
from mpp_taichi.arithmetic.taylor_series import added, derivatives, indices, place_of, raised, scaled_powers
from mpp_taichi.device.fast_taichi.explicit_vectors import explicit_vectors
from mpp_taichi.device.fast_taichi.lane_arithmetic import multiply_add
from mpp_taichi.device.heavy_loops import CPU_GRAIN, is_heavy
from mpp_taichi.neighbors.multipole_nodes import MultipoleNodes
from mpp_taichi.neighbors.tree_estimate import GROUP
from mpp_taichi.neighbors.tree_nodes import LEAF
from mpp_taichi.neighbors.tree_walk import LIST, LISTED_BODIES
from mpp_taichi.state.field_group import FieldGroup
from mpp_taichi.types import Template

ROOT_LEAVES = 128  # leaves of the target nodes that are worked off one by one, with all their descendants
LEVELS = 12  # of targets from such a node down to a group, at most
BATCH = 128  # sources that are summed together; their rows take 20 KiB of the cache
CANDIDATES = 1 << 14  # entries of the lists of one thread
NEAREST = {ti.f32: 3e-6, ti.f64: 1e-25}  # in the frame: of nearer nodes D_n may be beyond the range of numbers


@ti.data_oriented
class MultipoleWalk:
    """Sums by slot in the fields of a TreeWalk, for all groups; groups that it leaves pending are for the TreeWalk."""

    def __init__(self, walk: Any, order: int) -> None:
        """Allocate for a TreeWalk, and for series of an order."""
        config = ti.lang.impl.current_cfg()
        self.walk, self.order, self.nodes, self.estimate = walk, walk.order, walk.nodes, walk.estimate
        self.dimensions, self.lane_count, self.tile_count = walk.dimensions, walk.lane_count, walk.tile_count
        self.chunk_count = walk.chunk_count
        self.expansion_order = p = order
        self.sources = MultipoleNodes(self.nodes, p)
        self.width = self.sources.width
        every, place = indices(p, self.dimensions), place_of(p, self.dimensions)
        self.products = tuple(
            (place[n], place[m], place[added(n, m)]) for n in every for m in every if sum(n) + sum(m) <= p and sum(m) != 1
        )
        self.slopes = tuple(
            (place[n], axis, place[raised(n, axis)]) for n in indices(p - 1, self.dimensions) for axis in range(self.dimensions)
        )
        self.nearest_squared = NEAREST[config.default_fp] ** 2
        skip, leaves = self.nodes.skip.to_numpy(), self.nodes.leaves.to_numpy()
        depth, roots = _depths(skip), _roots(skip, leaves)
        self.root_count = len(roots)
        self.row = self.dimensions + self.width
        self.depth, self.roots, self.begin, self.candidates, self.path = (ti.field(ti.i32) for _ in range(5))
        self.local, self.batch, self.limit, self.variance = (ti.field(float) for _ in range(4))
        chunks = self.chunk_count
        self._memory = FieldGroup(
            (len(skip), self.depth, self.limit),
            (len(roots), self.roots),
            (chunks * (LEVELS + 2), self.begin, self.path, self.variance),
            (chunks * CANDIDATES, self.candidates),
            (chunks * LEVELS * self.width, self.local),
            (chunks * BATCH * self.row, self.batch),
        )
        self.depth.from_numpy(depth.astype(np.int32))
        self.roots.from_numpy(roots.astype(np.int32))

    def destroy(self) -> None:
        """Free the memory."""
        self.sources.destroy()
        self._memory.destroy()

    def run(self, softening: float, factor: float, *, potential: bool) -> None:
        """Compute the accelerations of all groups that are not left pending, and the potential where `potential`."""
        self.sources.build()
        self._share_limits()
        with explicit_vectors():
            self._walk(softening * softening, factor, potential)

    @ti.kernel
    def _share_limits(self):
        """The limit of a target is the least one of its groups."""
        for node in range(self.nodes.node_count):
            groups = self.nodes.leaves[node] // ti.static(GROUP // LEAF)
            first = self.nodes.first_leaf[node] // ti.static(GROUP // LEAF)
            least = ti.math.inf
            if self.nodes.leaves[node] <= ROOT_LEAVES:
                for group in range(first, first + groups):
                    least = ti.min(least, self.estimate.limit[group])
            self.limit[node] = least

    @ti.kernel
    def _walk(self, softening_squared: float, factor: float, potential: Template):
        for q in range(self.chunk_count * CPU_GRAIN):
            if is_heavy(q, CPU_GRAIN):
                chunk = q // CPU_GRAIN
                for k in range(chunk * self.root_count // self.chunk_count, (chunk + 1) * self.root_count // self.chunk_count):
                    root = self.roots[k]
                    levels = chunk * (LEVELS + 2)
                    self.begin[levels] = 0
                    self.begin[levels + 1] = 1
                    self.candidates[chunk * CANDIDATES] = 0
                    node = root
                    end = self.nodes.skip[root]
                    while node < end:
                        level = self.depth[node] - self.depth[root]
                        node = self._serve(chunk, node, level, softening_squared, factor, potential)

    @ti.func
    def _serve(self, chunk, node, level, softening_squared, factor, potential: Template):
        """Settle the sources of a target; the number of the next target."""
        d = ti.static(self.dimensions)
        levels = chunk * (LEVELS + 2)
        row = (chunk * LEVELS + level) * self.width
        entry = chunk * LIST
        self.path[levels + level] = node
        is_group = self.nodes.leaves[node] == ti.static(GROUP // LEAF)
        begin = self.nodes.first_leaf[node] * LEAF
        box = node * self.nodes.box_width
        lower = [self.nodes.box[box + axis] for axis in ti.static(range(d))]
        upper = [self.nodes.box[box + d + axis] for axis in ti.static(range(d))]
        center = [self.nodes.shape[node * self.nodes.shape_width + axis] for axis in ti.static(range(d))]
        radius = self.nodes.radius(node)
        limit = self.limit[node]
        allowed = factor * limit
        target_power = 1.0  # r^(p−1)
        for _ in ti.static(range(self.expansion_order - 1)):
            target_power = target_power * radius
        variance = 0.0
        if level == 0:
            for k in ti.static(range(self.width)):
                self.local[row + k] = 0.0
        else:
            variance = self.variance[levels + level - 1]
            self._hand_down(self.path[levels + level - 1], node, row)
        if is_group:
            for tile in range(self.tile_count):
                self.walk._sum_group(begin, begin + tile * self.lane_count, softening_squared, potential)
        first = self.begin[levels + level]
        out = self.begin[levels + level + 1]
        last = out
        count, cells, runs, bodies, last_end = 0, 0, 0, 0, -1
        for c in range(first, last):
            source = self.candidates[chunk * CANDIDATES + c]
            end = self.nodes.skip[source]
            while source < end:
                shape = source * self.nodes.shape_width
                squared, outside = 0.0, 0.0
                for axis in ti.static(range(d)):
                    x = self.nodes.shape[shape + axis]
                    way = center[axis] - x
                    squared += way * way
                    past = ti.max(lower[axis] - x, x - upper[axis], 0.0)
                    outside += past * past
                reach = self.nodes.shape[shape + d]
                octupole = self.nodes.shape[shape + d + 1]
                size = radius + reach
                far = False
                error = 0.0
                if squared > size * size and squared > self.nearest_squared:
                    distance = ti.sqrt(softened_square(squared, softening_squared))
                    share = 0.0  # q
                    if reach > 0.0:
                        share = octupole / (reach * reach * reach)
                    both = size
                    power = distance
                    for _ in ti.static(range(self.expansion_order - 1)):
                        both = both * size
                        power = power * distance
                    mass = self.nodes.moments[source * self.nodes.moment_width + d]
                    sum_of_terms = (mass - share) * target_power * radius + share * (
                        both - ti.static(float(self.expansion_order)) * reach * target_power
                    )
                    sum_of_terms = ti.static(self.expansion_order + 1.0) * sum_of_terms
                    gap = power * distance * (distance - size)
                    far = sum_of_terms < gap * allowed
                    if far:
                        error = sum_of_terms / gap
                if far:
                    for axis in ti.static(range(d)):
                        self.batch[(chunk * self.row + axis) * BATCH + count] = self.nodes.shape[shape + axis]
                    for k in ti.static(range(self.width)):
                        self.batch[(chunk * self.row + d + k) * BATCH + count] = self.sources.multipoles[
                            source * self.width + k
                        ]
                    count += 1
                    variance += error * error
                    source = self.nodes.skip[source]
                    if count == BATCH:
                        self._sum_batch(chunk, node, row, count, softening_squared)
                        count = 0
                elif is_group:
                    distance = ti.sqrt(softened_square(outside, softening_squared))
                    if self.estimate.is_far(outside, distance, reach, octupole, limit):
                        for k in ti.static(range(self.nodes.moment_width)):
                            self.walk.cells[(entry + cells) * self.nodes.moment_width + k] = self.nodes.moments[
                                source * self.nodes.moment_width + k
                            ]
                        cells += 1
                        variance += self.estimate.variance_of(distance, self.nodes.shape[shape + d + 2])
                        source = self.nodes.skip[source]
                    else:
                        if self.nodes.leaves[source] == 1:
                            start = self.nodes.first_leaf[source] * LEAF
                            if start < begin or start >= begin + GROUP:
                                if start == last_end:
                                    runs -= 1
                                else:
                                    self.walk.runs[(entry + runs) * 2] = start
                                last_end = start + LEAF
                                self.walk.runs[(entry + runs) * 2 + 1] = last_end
                                runs += 1
                                bodies += LEAF
                        source += 1
                    if cells == LIST or runs == LIST or bodies >= LISTED_BODIES:
                        self._sum_lists(begin, entry, cells, runs, softening_squared, potential)
                        cells, runs, bodies, last_end = 0, 0, 0, -1
                elif reach > radius and self.nodes.leaves[source] > 1:
                    source += 1
                else:
                    if out < CANDIDATES:
                        self.candidates[chunk * CANDIDATES + out] = source
                    out += 1
                    source = self.nodes.skip[source]
        self.begin[levels + level + 2] = out
        self.variance[levels + level] = variance
        after = node + 1
        if out > CANDIDATES:
            after = self.nodes.skip[node]  # these groups stay pending
        else:
            if count > 0:
                self._sum_batch(chunk, node, row, count, softening_squared)
            if is_group:
                self._sum_lists(begin, entry, cells, runs, softening_squared, potential)
                for tile in range(self.tile_count):
                    self._evaluate(begin + tile * self.lane_count, row, center, potential)
                group = begin // GROUP
                self.estimate.variance[group] = variance
                self.estimate.pending[group] = 0
                after = self.nodes.skip[node]
        return after

    @ti.func
    def _sum_lists(self, begin, entry, cells, runs, softening_squared, potential: Template):
        """Add the pulls of the multipoles and bodies near a group, as in `tree_walk.py`."""
        d = ti.static(self.dimensions)
        width = ti.static(self.nodes.moment_width)
        even = cells
        if cells % 2 == 1:
            for k in ti.static(range(width)):
                self.walk.cells[(entry + cells) * width + k] = 0.0
                if ti.static(k < d):
                    self.walk.cells[(entry + cells) * width + k] = self.walk.cells[(entry + cells - 1) * width + k]
            even += 1
        for tile in range(self.tile_count):
            self.walk._sum_lists(begin + tile * self.lane_count, entry, even, runs, softening_squared, potential)

    @ti.func
    def _hand_down(self, parent, node, row):
        """Set the series of a target to that of its parent, about its own centre."""
        shift = self.nodes.center(node) - self.nodes.center(parent)
        powers = scaled_powers([shift[axis] for axis in ti.static(range(self.dimensions))], self.expansion_order)
        above = row - self.width
        for k in ti.static(range(self.width)):
            self.local[row + k] = 0.0
        for total, k, m in ti.static(self.sources.shifts):
            self.local[row + k] = self.local[row + k] + self.local[above + total] * powers[m]

    @ti.func
    def _source(self, chunk, k: Template, first):
        """One number of the sources of a batch from `first` on, a lane for each."""
        begin = (chunk * self.row + k) * BATCH + first
        return ti.Vector([self.batch[begin + lane] for lane in ti.static(range(self.lane_count))])

    @ti.func
    def _sum_batch(self, chunk, node, row, count, softening_squared):
        """Add the series of the sources of a batch to those of a target."""
        d = ti.static(self.dimensions)
        padded = (count + self.lane_count - 1) // self.lane_count * self.lane_count
        for spare in range(count, padded):
            for k in ti.static(range(self.row)):
                begin = (chunk * self.row + k) * BATCH
                self.batch[begin + spare] = 0.0
                if ti.static(k < d):
                    self.batch[begin + spare] = self.batch[begin + count - 1]
        total = [ti.Vector.zero(float, self.lane_count) for _ in ti.static(range(self.width))]
        for tile in range(padded // self.lane_count):
            first = tile * self.lane_count
            way = [
                self.nodes.shape[node * self.nodes.shape_width + axis] - self._source(chunk, axis, first)
                for axis in ti.static(range(d))
            ]
            square = softened_square(way[0] * way[0], softening_squared)
            for axis in ti.static(range(1, d)):
                square = multiply_add(way[axis], way[axis], square)
            slope = derivatives(way, inverse_root(square), self.expansion_order)
            multipole = [self._source(chunk, d + k, first) for k in ti.static(range(self.width))]
            for n, m, both in ti.static(self.products):
                total[n] = multiply_add(multipole[m], slope[both], total[n])
        for k in ti.static(range(self.width)):
            added_up = 0.0
            for lane in ti.static(range(self.lane_count)):
                added_up = added_up + total[k][lane]
            self.local[row + k] = self.local[row + k] + added_up

    @ti.func
    def _evaluate(self, slot, row, center: Template, potential: Template):
        """Add the series of a group to the sums of a tile of its bodies."""
        d = ti.static(self.dimensions)
        away = [self.walk._lanes(slot, axis) - center[axis] for axis in ti.static(range(d))]
        powers = scaled_powers(away, self.expansion_order)
        total = [ti.Vector.zero(float, self.lane_count) for _ in ti.static(range(d))]
        for n, axis, k in ti.static(self.slopes):
            total[axis] = total[axis] + powers[n] * self.local[row + k]
        for lane in ti.static(range(self.lane_count)):
            for axis in ti.static(range(d)):
                k = axis * self.walk.padded_count + slot + lane
                self.walk.total[k] = self.walk.total[k] + total[axis][lane]
        if ti.static(potential):
            well = ti.Vector.zero(float, self.lane_count)
            for k in ti.static(range(self.width)):
                well = well + powers[k] * self.local[row + k]
            for lane in ti.static(range(self.lane_count)):
                self.walk.well[slot + lane] = self.walk.well[slot + lane] + well[lane]


def _depths(skip: np.ndarray) -> np.ndarray:
    """The number of ancestors of each node."""
    ends, depth = [], np.empty(len(skip), int)
    for node, end in enumerate(skip.tolist()):
        while ends and ends[-1] <= node:
            ends.pop()
        depth[node] = len(ends)
        ends.append(end)
    return depth


def _roots(skip: np.ndarray, leaves: np.ndarray) -> np.ndarray:
    """The largest nodes of at most `ROOT_LEAVES` leaves, which together have all leaves."""
    found, node = [], 0
    while node < len(skip):
        if leaves[node] <= ROOT_LEAVES:
            found.append(node)
            node = int(skip[node])
        else:
            node += 1
    return np.array(found)
