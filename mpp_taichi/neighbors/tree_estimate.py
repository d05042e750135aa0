"""Tree estimate: how strong the field is at each group of bodies, and so which nodes are far enough from the group.

A node whose second moments about its center of mass have the trace tr Q, and whose farthest body is at b from there, is a
multipole of second order for a group of bodies if

    b tr Q / (ρ³ (ρ − b)²) ≤ tolerance · max(|a|, `CANCELLATION` Σ |a_node|)   and   d > b,   ρ² = d² + ε²,

with d from the nearest point of the group's box. The left side bounds the order of the error, which is the pull of the octupole
and of all higher moments: Σ m |δ|³ ≤ b tr Q, and a body at b may be as near as ρ − b (Salmon and Warren, J. Comput. Phys. 111
(1994) 136). The field a is the field of all other groups, from a first walk with monopoles, softened by twice the radius of the
group, because the pull of near bodies differs from body to body of the group. Of the fields at the first and at the last body
the weaker counts, because a group may reach from one clump of bodies into another. The right side is a relative error for each
node, as in Springel, MNRAS 364 (2005) 1105, which takes a from the step before; here forces depend only on positions.
"""

from typing import Any

import taichi as ti

from mpp_taichi.arithmetic.inverse_distance import softened_square
from mpp_taichi.neighbors.tree_nodes import LEAF
from mpp_taichi.state.field_group import FieldGroup

GROUP = 32  # bodies that share a walk; twice as many are no faster
CANCELLATION = 0.03  # where pulls cancel, as in the middle of a sphere, no error is small beside their sum
SMALLEST_PULL = 1e-30  # in units of the frame; without it no error would be small enough where there is no pull at all


@ti.data_oriented
class TreeEstimate:
    """limit (groups,): the allowed error of the pull of one node, in units of the frame with G = 1."""

    def __init__(self, order: Any, nodes: Any) -> None:
        """Allocate for the bodies of a TreeOrder and their TreeNodes."""
        self.nodes = nodes
        self.dimensions = order.dimensions
        self.particle_count = order.particle_count
        self.group_count = order.padded_count // GROUP
        self.group_leaves = GROUP // LEAF
        self.first_group = nodes.offsets[self.group_leaves.bit_length() - 1]  # in the list of nodes by level
        self.limit = ti.field(float)
        self._memory = FieldGroup((self.group_count, self.limit))

    def destroy(self) -> None:
        """Free the memory."""
        self._memory.destroy()

    @ti.kernel
    def estimate(self, softening_squared: float, tolerance: float):
        """Set the limit of each group, from the field of monopoles, each softened by the radius of its node."""
        for group in range(self.group_count):
            begin = group * self.group_leaves
            last = ti.min((group + 1) * GROUP, self.particle_count) - 1
            places = [self.nodes.body(ti.min(group * GROUP, last)), self.nodes.body(last)]
            size = 2.0 * self.nodes.radius(self.group_node(group))
            blur = softened_square(size * size, softening_squared)
            field = [ti.Vector.zero(float, self.dimensions) for place in ti.static(range(2))]
            strength = [0.0 for place in ti.static(range(2))]
            node = 0
            while node < self.nodes.node_count:
                center = self.nodes.center(node)
                radius = self.nodes.radius(node)
                radius_squared = radius * radius
                apart = True
                for place in ti.static(range(2)):
                    apart = apart and (center - places[place]).norm_sqr() > radius_squared
                if apart or self.nodes.leaves[node] == 1:
                    first = self.nodes.first_leaf[node]
                    if first + self.nodes.leaves[node] <= begin or first >= begin + self.group_leaves:
                        for place in ti.static(range(2)):
                            d = center - places[place]
                            within = d.norm_sqr() + radius_squared + blur
                            if within > 0.0:
                                pull = self.nodes.mass(node) / (within * ti.sqrt(within))
                                field[place] += pull * d
                                strength[place] += pull * d.norm()
                    node = self.nodes.skip[node]
                else:
                    node += 1
            weakest = ti.math.inf
            for place in ti.static(range(2)):
                weakest = ti.min(weakest, ti.max(field[place].norm(), CANCELLATION * strength[place]))
            self.limit[group] = ti.max(tolerance * weakest, SMALLEST_PULL)

    @ti.func
    def group_node(self, group):
        """The node that holds the bodies of a group."""
        return self.nodes.level_node[self.first_group + group]

    @ti.func
    def is_far(self, squared, radius, octupole, limit, softening_squared):
        """Whether the multipoles of a node may stand for its bodies, at this squared distance from the box of the group."""
        far = False
        if squared > radius * radius:
            distance = ti.sqrt(softened_square(squared, softening_squared))
            gap = distance - radius
            far = distance * distance * distance * (gap * gap) * limit > octupole
        return far
