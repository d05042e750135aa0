"""Tree gather: the walk of `tree_walk.py` for GPUs, one thread for each body and no lists.

The bodies of a group make the same decision at each node, so that their threads stay together.
"""

from typing import Any

import taichi as ti

from mpp_taichi.arithmetic.inverse_distance import inverse_distance, softened_square
from mpp_taichi.neighbors.tree_estimate import GROUP
from mpp_taichi.neighbors.tree_nodes import LEAF
from mpp_taichi.state.field_group import FieldGroup
from mpp_taichi.types import Template


@ti.data_oriented
class TreeGather:
    """Sums by slot, in the units of the frame with G = 1; they differ from TreeWalk's sums only by the order of the terms."""

    def __init__(self, order: Any, nodes: Any, estimate: Any) -> None:
        """Allocate for the bodies of a TreeOrder, their TreeNodes and TreeEstimate."""
        self.order, self.nodes = order, nodes
        self.dimensions = order.dimensions
        self.padded_count = order.padded_count
        self.estimate = estimate
        self.total, self.well = ti.field(float), ti.field(float)
        self._memory = FieldGroup((self.padded_count * self.dimensions, self.total), (self.padded_count, self.well))

    def destroy(self) -> None:
        """Free the memory."""
        self._memory.destroy()

    def begin(self, accuracy: float, tolerance: float) -> None:
        """Nothing, as for a TreeWalk."""

    def run(self, softening: float, *, potential: bool) -> None:
        """Compute the accelerations of the pending groups, and the potential where `potential`."""
        self._walk(softening * softening, potential)

    @ti.kernel
    def _walk(self, softening_squared: float, potential: Template):
        for slot in range(self.order.particle_count):
            if self.estimate.pending[slot // GROUP] == 1:
                self._serve(slot, softening_squared, potential)

    @ti.func
    def _serve(self, slot, softening_squared, potential: Template):
        """Compute the sums of a body."""
        group = slot // GROUP
        home = self.estimate.group_node(group)
        lower, upper = self.nodes.corner(home, 0), self.nodes.corner(home, 1)
        limit = self.estimate.limit[group]
        x = self.nodes.body(slot)
        total = ti.Vector.zero(float, self.dimensions)
        well = 0.0
        node = 0
        variance = 0.0
        while node < self.nodes.node_count:
            center = self.nodes.center(node)
            outside = ti.max(lower - center, center - upper, 0.0)
            squared = outside.dot(outside)
            distance = ti.sqrt(softened_square(squared, softening_squared))
            radius, octupole = self.nodes.radius(node), self.nodes.octupole(node)
            if self.estimate.is_far(squared, distance, radius, octupole, limit):
                d = center - x
                inverse = inverse_distance(d.dot(d), softening_squared)
                along, across, turned, depth = self.nodes.pull(self.nodes.moments, node * self.nodes.moment_width, d, inverse)
                for axis in ti.static(range(self.dimensions)):
                    total[axis] += along * d[axis] - across * turned[axis]
                well += depth
                variance += self.estimate.variance_of(distance, self.nodes.likely_octupole(node))
                node = self.nodes.skip[node]
            else:
                if self.nodes.leaves[node] == 1:
                    first = self.nodes.first_leaf[node] * LEAF
                    total_of_leaf = ti.Vector.zero(float, self.dimensions)  # rounds less than one long sum
                    for j in range(first, ti.min(first + LEAF, self.order.particle_count)):
                        if j != slot:
                            d = self.nodes.body(j) - x
                            inverse = inverse_distance(d.dot(d), softening_squared)
                            pull = self.order.mass[j] * inverse
                            well += pull
                            total_of_leaf += pull * (inverse * inverse) * d
                    total += total_of_leaf
                node += 1
        for axis in ti.static(range(self.dimensions)):
            self.total[axis * self.padded_count + slot] = total[axis]
        if ti.static(potential):
            self.well[slot] = well
        if slot % GROUP == 0:
            self.estimate.variance[group] = variance
