"""Multipoles of the nodes of a tree, to an order p: what a node pulls on a place far from it.

The multipoles of a node with the centre of mass c are M_m = Σ m_j (c − x_j)^m / m! over its bodies j, for all multi-indices m with
|m| ≤ p (arithmetic/taylor_series.py). A leaf sums up its bodies. A parent sums up its two children, about its own centre c′:
M′_m = Σ_k M_k (c′ − c)^(m−k) / (m − k)!. No truncation is made. Source: W. Dehnen, J. Comput. Phys. 179 (2002) 27, §3.
"""

from typing import Any

import taichi as ti

from mpp_taichi.arithmetic.taylor_series import added, indices, place_of, scaled_powers
from mpp_taichi.neighbors.tree_nodes import LEAF, SERIAL_LEVEL
from mpp_taichi.state.field_group import FieldGroup


@ti.data_oriented
class MultipoleNodes:
    """The multipoles of all nodes, in the frame of `TreeOrder`.

    multipoles   (node_count × width,) a row of M_m for each node, in the order of `indices`
    """

    def __init__(self, nodes: Any, order: int) -> None:
        """Allocate for the nodes of a TreeNodes; needs a started Taichi."""
        self.nodes, self.expansion_order, self.dimensions = nodes, order, nodes.dimensions
        self.width = len(indices(order, self.dimensions))
        place = place_of(order, self.dimensions)
        every = indices(order, self.dimensions)
        self.shifts = tuple((place[added(k, m)], place[k], place[m]) for k in every for m in every if sum(k) + sum(m) <= order)
        self.multipoles = ti.field(float)
        self._memory = FieldGroup((nodes.node_count * self.width, self.multipoles))

    def destroy(self) -> None:
        """Free the memory."""
        self._memory.destroy()

    def build(self) -> None:
        """Compute the multipoles of all nodes, from the leaves up."""
        offsets, level = self.nodes.offsets, 1
        self._build_leaves(self.nodes.leaf_count)
        while level + 1 < len(offsets) and offsets[level + 1] - offsets[level] > SERIAL_LEVEL:
            self._build_level(offsets[level], offsets[level + 1])
            level += 1
        if level + 1 < len(offsets):
            self._build_top(offsets[level], offsets[-1])

    @ti.kernel
    def _build_leaves(self, count: ti.i32):
        for leaf in range(count):
            node = self.nodes.level_node[leaf]
            row = node * self.width
            center = self.nodes.center(node)
            for k in ti.static(range(self.width)):
                self.multipoles[row + k] = 0.0
            for slot in range(leaf * LEAF, (leaf + 1) * LEAF):
                mass = self.nodes.order.mass[slot]
                if mass > 0.0:  # bodies that fill up the last leaf are far away, and have no mass
                    away = center - self.nodes.body(slot)
                    powers = scaled_powers([away[axis] for axis in ti.static(range(self.dimensions))], self.expansion_order)
                    for k in ti.static(range(self.width)):
                        self.multipoles[row + k] = self.multipoles[row + k] + mass * powers[k]

    @ti.kernel
    def _build_level(self, begin: ti.i32, end: ti.i32):
        for k in range(begin, end):
            self._join(self.nodes.level_node[k])

    @ti.kernel
    def _build_top(self, begin: ti.i32, end: ti.i32):
        ti.loop_config(serialize=True)
        for k in range(begin, end):
            self._join(self.nodes.level_node[k])

    @ti.func
    def _join(self, node):
        row = node * self.width
        for k in ti.static(range(self.width)):
            self.multipoles[row + k] = 0.0
        child = node + 1
        for _ in range(2):
            shift = self.nodes.center(node) - self.nodes.center(child)
            powers = scaled_powers([shift[axis] for axis in ti.static(range(self.dimensions))], self.expansion_order)
            own = child * self.width
            for target, k, m in ti.static(self.shifts):
                self.multipoles[row + target] = self.multipoles[row + target] + self.multipoles[own + k] * powers[m]
            child = self.nodes.skip[child]
