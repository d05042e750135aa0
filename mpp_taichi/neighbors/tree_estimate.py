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

After a walk, `tree_check.py` compares the accelerations with the likely error of the walk, the root of a sum over far nodes of

    E² = (o / ρ⁵)²,   o = √2 b tr Q s²,   s = Σ (Q_ij / tr Q)².

The left side of the condition for far nodes is a bound; E is not. Bodies in a row have s = 1, and bodies that lie equally in n
directions have s = 1/n. Their octupole along the direction to the group is likely to be n^(−3/2) b tr Q. The errors of nodes
have any sign, and their sums are about normal in n dimensions; the factor √(2/n) brings them to a normal error in a plane.
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
    """What a walk reads and leaves for each group, in units of the frame with G = 1; each has the shape (groups,).

    limit     the allowed error of the pull of one node
    least     the lowest limit: an error of this size is no greater than the round-off of the sum
    variance  E² of the accelerations that the last walk found
    pending   1 where the group is to walk, 0 where its sums stand
    """

    def __init__(self, order: Any, nodes: Any) -> None:
        """Allocate for the bodies of a TreeOrder and their TreeNodes."""
        self.nodes = nodes
        self.dimensions = order.dimensions
        self.particle_count = order.particle_count
        self.group_count = order.padded_count // GROUP
        self.group_leaves = GROUP // LEAF
        self.first_group = nodes.offsets[self.group_leaves.bit_length() - 1]  # in the list of nodes by level
        self.limit, self.least, self.variance = (ti.field(float) for _ in range(3))
        self.pending = ti.field(ti.i32)
        self._memory = FieldGroup((self.group_count, self.limit, self.least, self.variance, self.pending))

    def destroy(self) -> None:
        """Free the memory."""
        self._memory.destroy()

    @ti.kernel
    def estimate(self, softening_squared: float, tolerance: float, rounding: float):
        """Set the limit of each group, from the field of monopoles, each softened by the radius of its node.

        `rounding` is the unit round-off divided by the accuracy. It makes `least` of the sum of the strengths of all pulls.
        """
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
            self.least[group] = ti.max(tolerance * rounding * ti.min(strength[0], strength[1]), SMALLEST_PULL)
            self.pending[group] = 1

    @ti.func
    def group_node(self, group):
        """The node that holds the bodies of a group."""
        return self.nodes.level_node[self.first_group + group]

    @ti.func
    def is_far(self, squared, distance, radius, octupole, limit):
        """Whether the multipoles of a node may stand for its bodies; d² is `squared` and ρ is `distance`."""
        far = False
        if squared > radius * radius:
            gap = distance - radius
            far = distance * distance * distance * (gap * gap) * limit > octupole
        return far

    @ti.func
    def variance_of(self, distance, likely_octupole):
        """E² of the pull of one far node; ρ is `distance`."""
        error = likely_octupole / (distance * distance * distance * distance * distance)
        return error * error
