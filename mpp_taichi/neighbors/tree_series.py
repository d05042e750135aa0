"""Tree series: distant nodes act on whole nodes by series of an order p, and not on each group of bodies by itself.

device/fast_taichi/series_walk.h has the walk, and series_math.h the series (a fast multipole method). A source of mass M,
radius b and second moments Q acts on a target of radius r by a series if d > b + r for the distance d of their centers, and

    E = (p + 1) S / (ρ^(p+1) (ρ − b − r)) ≤ A,   S = σ^(3/2) (M − q) r^p + s^(p/2+1) q ((b + r)^p − p b r^(p−1)),

with q = tr Q / b². With s = σ = 1, E is a bound of the first terms that are left out, which have powers r^(p−k) P_k of the
moments P_0 = M, P_1 = 0 and P_k ≤ tr Q b^(k−2) (W. Dehnen, Comput. Astrophys. Cosmol. 1 (2014) 1). Bodies in a row come near
to the bound. Of bodies that lie equally in n directions, moments of order k along one direction are likely to be n^(−k/2) as
large. So the spread s of the source (tree_estimate.py), which is 1 in a row and 1/n there, and the spread σ of the target bring
the bound near to the size of the error. The exponents are calibrated, as is the permitted error A: a share of the field at the
target, for the group with the weakest field. The variance that tree_check.py reads is the sum of σ³ E²/10.
"""

from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.device.fast_taichi import series_walk
from mpp_taichi.device.heavy_loops import CPU_GRAIN, is_heavy
from mpp_taichi.neighbors.tree_walk import TreeWalk
from mpp_taichi.state.field_group import FieldGroup
from mpp_taichi.types import Template

ROOT_LEAVES = 128  # leaves of the largest nodes that are worked off by one thread, with all their descendants
LEAST_ROOTS = 64  # so that several threads have work for few bodies, too
CAPACITY = 1 << 14  # sources in a list of a piece of the walk; groups that have more are left to the TreeWalk
MOST_LEAVES = 2048  # that a group sums body by body; in a wider group each body walks alone
RECORD = 8  # numbers of a node that a test of a distance reads
SHARES = {6: (4e-4, 1e-3, 1.4), 8: (2e-6, 1e-5, 1.1)}
"""By the order, (share, accuracy, exponent): a source may cause an error of share · (accuracy / this accuracy)^exponent of the
field. They are calibrated, so that 99 % of 5,000 to 10⁶ bodies in a sphere, a disc, Plummer's sphere or a lattice keep the
accuracy in one walk."""
HIGH_ORDER = 3e-5  # accuracy from which on series of the higher order are faster


@ti.data_oriented
class TreeSeries:
    """Sums by slot, as those of a TreeWalk, in units of the frame with G = 1."""

    def __init__(self, order: Any, nodes: Any, estimate: Any) -> None:
        """Allocate for the bodies of a TreeOrder, their TreeNodes and TreeEstimate."""
        self.order, self.nodes, self.estimate = order, nodes, estimate
        self.walk = TreeWalk(order, nodes, estimate)
        self.total, self.well = self.walk.total, self.walk.well
        self.piece_count = self.walk.chunk_count
        skip, leaves = nodes.skip.to_numpy(), nodes.leaves.to_numpy()
        roots, upper = divided(skip, leaves, max(2, min(ROOT_LEAVES, nodes.leaf_count // LEAST_ROOTS)))
        self.root_count, self.upper_count = len(roots), len(upper)
        self.orders = series_walk.ORDERS[series_walk.precision()]
        self.row_width = series_walk.row_width(self.orders[-1])
        self.roots, self.lists = ti.field(ti.i32), ti.field(ti.i32)
        self.table = ti.field(ti.i64)
        self.records, self.rows = ti.field(float), ti.field(float)
        self._memory = FieldGroup(
            (len(roots) + len(upper), self.roots),
            (self.piece_count * 2 * CAPACITY, self.lists),
            (len(self._fields()) + len(self._numbers()) + 2, self.table),
            (len(skip) * RECORD, self.records),
            (len(skip) * self.row_width, self.rows),
        )
        self.roots.from_numpy(np.concatenate([roots, upper]).astype(np.int32))
        self.describe(CAPACITY, MOST_LEAVES)
        self.begin(0.0, 1.0)

    def destroy(self) -> None:
        """Free the memory."""
        self._memory.destroy()
        self.walk.destroy()

    def _fields(self) -> tuple[Any, ...]:
        """What the functions of series_walk.h read and write, in the order of their structure Tree."""
        nodes, estimate = self.nodes, self.estimate
        read = (self.order.position, self.order.mass, nodes.shape, nodes.moments, estimate.limit)
        whole_numbers = (nodes.skip, nodes.first_leaf, nodes.leaves, estimate.pending, self.lists)
        return (*read, *whole_numbers, self.records, self.rows, self.total, self.well, estimate.variance)

    def _numbers(self) -> tuple[int, ...]:
        return self.order.padded_count, self.nodes.moment_width

    @ti.kernel
    def describe(self, capacity: ti.i32, most: ti.i32):
        """Write the structure Tree; its last numbers are `CAPACITY` and `MOST_LEAVES`, or smaller numbers."""
        count = ti.static(len(self._fields()) + len(self._numbers()))
        for k, field in ti.static(enumerate(self._fields())):
            self.table[k] = ti.get_addr(field, 0)
        for k, number in ti.static(enumerate(self._numbers(), len(self._fields()))):
            self.table[k] = number
        self.table[count] = capacity
        self.table[count + 1] = most

    def begin(self, accuracy: float, tolerance: float) -> None:
        """Prepare for the first walk of a force; the limit of a group is `tolerance` times the field."""
        self.expansion_order = self.orders[0] if accuracy > HIGH_ORDER else self.orders[-1]
        share, at, exponent = SHARES[self.expansion_order]
        self.factor = share * (accuracy / at) ** exponent / tolerance
        self.has_moments = False

    def run(self, softening: float, *, potential: bool) -> None:
        """Compute the accelerations of the pending groups, and the potential where `potential`."""
        arguments = softening * softening, self.factor, int(potential), int(not self.has_moments)
        self.has_moments = True
        if self._walk(self.expansion_order, *arguments) > 0:
            self.walk.run(softening, potential=potential)

    @ti.kernel
    def _walk(
        self, expansion_order: Template, softening_squared: float, factor: float, potential: ti.i32, moments: ti.i32
    ) -> ti.i32:
        """Compute the moments, if asked for, and serve the pending groups; the number of groups that are left."""
        for q in range(self.piece_count * CPU_GRAIN):
            if is_heavy(q, CPU_GRAIN) and moments == 1:
                piece = q // CPU_GRAIN
                for k in range(self._begin(piece), self._begin(piece + 1)):
                    table, first = ti.get_addr(self.table, 0), self.roots[k]
                    last = self.nodes.skip[first] - 1
                    ti.static(series_walk.call(expansion_order, "moments", table, first, last))
        ti.loop_config(serialize=True)
        for k in range(self.root_count, self.root_count + self.upper_count * moments):
            table, first = ti.get_addr(self.table, 0), self.roots[k]
            last = first
            ti.static(series_walk.call(expansion_order, "moments", table, first, last))
        for q in range(self.piece_count * CPU_GRAIN):
            if is_heavy(q, CPU_GRAIN):
                piece = q // CPU_GRAIN
                for k in range(self._begin(piece), self._begin(piece + 1)):
                    table, node, number = ti.get_addr(self.table, 0), self.roots[k], piece
                    squared, share, well = softening_squared, factor, potential
                    ti.static(series_walk.call(expansion_order, "walk", table, node, number, squared, share, well))
        left = 0
        for group in range(self.estimate.group_count):
            left += self.estimate.pending[group]
        return left

    @ti.func
    def _begin(self, piece):
        """Number of the first root of a piece of the walk."""
        return piece * self.root_count // self.piece_count


def divided(skip: np.ndarray, leaves: np.ndarray, largest: int) -> tuple[np.ndarray, np.ndarray]:
    """The largest nodes of at most so many leaves, which together have all leaves; the nodes above them, parents last."""
    roots, upper, node = [], [], 0
    while node < len(skip):
        if leaves[node] <= largest:
            roots.append(node)
            node = int(skip[node])
        else:
            upper.append(node)
            node += 1
    return np.array(roots, int), np.array(upper[::-1], int)
