"""Tree nodes: a hierarchy of runs of sorted bodies, with the multipoles of each run.

A leaf is a run of `LEAF` bodies, and a parent joins two runs that follow each other. So the shape of the tree depends only on
the number of bodies; the positions decide only the numbers that a node holds. Nodes are numbered in the order in which a walk
from the root meets them: the first child of node k is k + 1, and `skip[k]` is the node after all descendants of k.
"""

import math
from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.device.heavy_loops import CPU_GRAIN
from mpp_taichi.state.field_group import FieldGroup
from mpp_taichi.types import Template

LEAF = 16
SERIAL_LEVEL = CPU_GRAIN  # nodes of a level that one thread does


def preorder(leaf_count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[np.ndarray]]:
    """The tree over so many leaves: skip, first leaf and leaf count of every node, and the nodes of each level, leaves first.

    A level pairs the nodes of the level below. A last node without a partner goes up unchanged and makes no new node.
    """
    first, count = np.arange(leaf_count), np.ones(leaf_count, int)
    row = np.arange(leaf_count)
    levels = [row]
    while len(row) > 1:
        pairs = len(row) // 2
        left, right = row[: 2 * pairs : 2], row[1 : 2 * pairs : 2]
        new = len(first) + np.arange(pairs)
        first = np.concatenate([first, first[left]])
        count = np.concatenate([count, count[left] + count[right]])
        levels.append(new)
        row = np.concatenate([new, row[2 * pairs :]])
    # A node comes after all nodes that begin earlier, and after larger nodes that begin with the same leaf.
    order = np.lexsort((-count, first))
    number = np.empty(len(order), int)
    number[order] = np.arange(len(order))
    size = 2 * count - 1  # nodes of a binary tree with so many leaves
    return (number + size)[order], first[order], count[order], [number[level] for level in levels]


@ti.data_oriented
class TreeNodes:
    """The numbers of the nodes that a walk reads, in the frame of `TreeOrder`; each is a flat field with a row for each node.

    shape    center of mass, radius, bound of the octupole, likely octupole (tree_estimate.py)
    moments  center of mass, mass, 3 Q (upper triangle), 1.5 tr Q, with Q = Σ m δ δᵀ about the center of mass
    box      lower and upper corner
    """

    def __init__(self, order: Any) -> None:
        """Allocate for the bodies of a TreeOrder."""
        self.order = order
        self.dimensions = d = order.dimensions
        self.leaf_count = order.padded_count // LEAF
        skip, first, count, levels = preorder(self.leaf_count)
        self.node_count = len(skip)
        self.depth = max(math.log2(self.leaf_count), 1.0)
        self.pairs = tuple((a, b) for a in range(d) for b in range(a, d))
        self.second_count = len(self.pairs)
        self.shape_width = d + 3
        self.moment_width = d + 2 + self.second_count
        self.box_width = 2 * d
        self.skip, self.first_leaf, self.leaves, self.level_node = (ti.field(ti.i32) for _ in range(4))
        self.shape, self.moments, self.box = (ti.field(float) for _ in range(3))
        self._memory = FieldGroup(
            (self.node_count, self.skip, self.first_leaf, self.leaves, self.level_node),
            (self.node_count * self.shape_width, self.shape),
            (self.node_count * self.moment_width, self.moments),
            (self.node_count * self.box_width, self.box),
        )
        for field, values in (
            (self.skip, skip),
            (self.first_leaf, first),
            (self.leaves, count),
            (self.level_node, np.concatenate(levels)),
        ):
            field.from_numpy(values.astype(np.int32))
        self.offsets = np.cumsum([0, *(len(level) for level in levels)]).tolist()

    def destroy(self) -> None:
        """Free the memory."""
        self._memory.destroy()

    def build(self) -> None:
        """Compute all nodes, from the leaves up."""
        self._build_leaves(self.leaf_count)
        level = 1
        while level + 1 < len(self.offsets) and self.offsets[level + 1] - self.offsets[level] > SERIAL_LEVEL:
            self._build_level(self.offsets[level], self.offsets[level + 1])
            level += 1
        if level + 1 < len(self.offsets):
            self._build_top(self.offsets[level], self.offsets[-1])

    @ti.kernel
    def _build_leaves(self, count: ti.i32):
        for leaf in range(count):
            self._sum_leaf(self.level_node[leaf], leaf * LEAF)

    @ti.kernel
    def _build_level(self, begin: ti.i32, end: ti.i32):
        for k in range(begin, end):
            self._join(self.level_node[k])

    @ti.kernel
    def _build_top(self, begin: ti.i32, end: ti.i32):
        ti.loop_config(serialize=True)
        for k in range(begin, end):
            self._join(self.level_node[k])

    @ti.func
    def _row(self, field: Template, begin, step):
        return ti.Vector([field[begin + axis * step] for axis in ti.static(range(self.dimensions))])

    @ti.func
    def body(self, slot):
        """Position of the body in a slot."""
        return ti.Vector(
            [self.order.position[axis * self.order.padded_count + slot] for axis in ti.static(range(self.dimensions))]
        )

    @ti.func
    def _sum_leaf(self, node, begin):
        end = ti.min(begin + LEAF, self.order.particle_count)
        lower = self.body(ti.min(begin, self.order.particle_count - 1))  # a leaf of filled slots lies at the last body
        upper = lower
        mass = 0.0
        lever = ti.Vector.zero(float, self.dimensions)
        for slot in range(begin, end):
            x = self.body(slot)
            lower, upper = ti.min(lower, x), ti.max(upper, x)
            mass += self.order.mass[slot]
            lever += self.order.mass[slot] * x
        center = 0.5 * (lower + upper)
        if mass > 0.0:
            center = ti.max(lower, ti.min(lever / mass, upper))  # a rounding outside the box could part a body from itself
        second = ti.Vector.zero(float, self.second_count)
        radius_squared = 0.0
        for slot in range(begin, end):
            d = self.body(slot) - center
            for k, pair in ti.static(enumerate(self.pairs)):
                second[k] += self.order.mass[slot] * (d[pair[0]] * d[pair[1]])
            radius_squared = ti.max(radius_squared, d.dot(d))
        self._store(node, center, mass, second, lower, upper, ti.sqrt(radius_squared))

    @ti.func
    def _join(self, node):
        """Compute a node from its two children; the second moments by the parallel axis theorem."""
        left, right = node + 1, self.skip[node + 1]
        masses = ti.Vector([self.mass(left), self.mass(right)])
        mass = masses.sum()
        lower = ti.min(self.corner(left, 0), self.corner(right, 0))
        upper = ti.max(self.corner(left, 1), self.corner(right, 1))
        center = 0.5 * (lower + upper)
        if mass > 0.0:
            center = (masses[0] * self.center(left) + masses[1] * self.center(right)) / mass
            center = ti.max(lower, ti.min(center, upper))
        second = ti.Vector.zero(float, self.second_count)
        radius_of_parts = 0.0
        for part in ti.static(range(2)):
            child = left if part == 0 else right
            d = self.center(child) - center
            for k, pair in ti.static(enumerate(self.pairs)):
                own = self.moments[child * self.moment_width + self.dimensions + 1 + k] / 3.0
                second[k] += own + masses[part] * (d[pair[0]] * d[pair[1]])
            radius_of_parts = ti.max(radius_of_parts, d.norm() + self.radius(child))
        far = ti.max(upper - center, center - lower)
        self._store(node, center, mass, second, lower, upper, ti.min(far.norm(), radius_of_parts))

    @ti.func
    def _store(self, node, center, mass, second, lower, upper, radius):
        d = ti.static(self.dimensions)
        trace = 0.0
        for k, pair in ti.static(enumerate(self.pairs)):
            self.moments[node * self.moment_width + d + 1 + k] = 3.0 * second[k]
            if ti.static(pair[0] == pair[1]):
                trace += second[k]
        spread = 0.0  # Σ (Q_ij / tr Q)², from 1/d to 1
        if trace > 0.0:
            for k, pair in ti.static(enumerate(self.pairs)):
                spread += (1.0 if ti.static(pair[0] == pair[1]) else 2.0) * (second[k] / trace) ** 2
        for axis in ti.static(range(d)):
            self.moments[node * self.moment_width + axis] = center[axis]
            self.shape[node * self.shape_width + axis] = center[axis]
            self.box[node * self.box_width + axis] = lower[axis]
            self.box[node * self.box_width + d + axis] = upper[axis]
        self.moments[node * self.moment_width + d] = mass
        self.moments[node * self.moment_width + d + 1 + self.second_count] = 1.5 * trace
        self.shape[node * self.shape_width + d] = radius
        self.shape[node * self.shape_width + d + 1] = trace * radius  # no less than Σ m |δ|³
        self.shape[node * self.shape_width + d + 2] = ti.static(math.sqrt(2.0)) * trace * radius * spread**2

    @ti.func
    def center(self, node):
        """Center of mass of a node."""
        return self._row(self.shape, node * self.shape_width, 1)

    @ti.func
    def mass(self, node):
        """Mass of a node."""
        return self.moments[node * self.moment_width + self.dimensions]

    @ti.func
    def radius(self, node):
        """Greatest distance of a body of the node from the center of mass."""
        return self.shape[node * self.shape_width + self.dimensions]

    @ti.func
    def octupole(self, node):
        """The bound b tr Q of the octupole, with which the error of a node grows."""
        return self.shape[node * self.shape_width + self.dimensions + 1]

    @ti.func
    def likely_octupole(self, node):
        """The likely octupole o, which is smaller than the bound."""
        return self.shape[node * self.shape_width + self.dimensions + 2]

    @ti.func
    def corner(self, node, side: Template):
        """Lower (0) or upper (1) corner of the box around a node."""
        return self._row(self.box, node * self.box_width + side * self.dimensions, 1)

    @ti.func
    def pull(self, rows: Template, row, way: Template, inverse):
        """The pull of the node in a row of moments, a = along · d − across · turned with turned = 3 Q d; and −φ.

        The function takes numbers and vectors of lanes alike.
        """
        d = ti.static(self.dimensions)
        turned = [inverse * 0.0 for axis in ti.static(range(d))]
        for k, pair in ti.static(enumerate(self.pairs)):
            second = rows[row + d + 1 + k]
            turned[pair[0]] = turned[pair[0]] + second * way[pair[1]]
            if ti.static(pair[0] != pair[1]):
                turned[pair[1]] = turned[pair[1]] + second * way[pair[0]]
        product = way[0] * turned[0]
        for axis in ti.static(range(1, d)):
            product = product + way[axis] * turned[axis]
        squared = inverse * inverse
        cubed = inverse * squared
        product = product * squared
        mass = rows[row + d]
        trace = rows[row + d + 1 + self.second_count]
        along = cubed * (mass + squared * (2.5 * product - trace))
        depth = inverse * (mass + squared * (0.5 * product - (1.0 / 3.0) * trace))
        return along, cubed * squared, turned, depth
