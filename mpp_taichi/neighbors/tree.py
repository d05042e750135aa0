"""Tree gravity: the sum of Newtonian gravity over a tree, to a tolerance of the relative error, in O(N log N)."""

from functools import partial
from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.arithmetic.round_off import round_off
from mpp_taichi.device.fast_taichi import series_walk
from mpp_taichi.neighbors.tree_check import TreeCheck
from mpp_taichi.neighbors.tree_estimate import GROUP, TreeEstimate
from mpp_taichi.neighbors.tree_gather import TreeGather
from mpp_taichi.neighbors.tree_nodes import TreeNodes
from mpp_taichi.neighbors.tree_order import TreeOrder
from mpp_taichi.neighbors.tree_series import TreeSeries
from mpp_taichi.neighbors.tree_walk import TreeWalk
from mpp_taichi.scene.tree_checks import DEFAULT_ACCURACY
from mpp_taichi.types import Template

NODE_TOLERANCE = {2: 200.0, 3: 500.0}
NODE_EXPONENT = 1.5
"""The tolerance of the error of one node is `NODE_TOLERANCE` · (accuracy / levels of the tree)^`NODE_EXPONENT`. With tolerance
t, a node acts on bodies at distances that go with t^(-1/5), so some t^(-3/5) nodes of each level act on a body, and their
errors, of both signs, add up to t t^(-3/10). So theory asks for an exponent of 10/7. Exponent and factor are calibrated, so
that 99 % of the bodies keep the accuracy in spheres, discs, rings and clumps of 10⁴ to 10⁶ bodies. In a plane the near bodies
pull as much as all distant bodies, and for one body in a hundred both pulls nearly cancel."""


@ti.data_oriented
class TreeSum:
    """The accelerations of one `newtonian_gravity` with `solver: tree`, and their potential.

    Forces are a function only of the positions, with the same bits for any number of threads. Forces between two bodies are
    not exactly opposite, so momentum is conserved to the accuracy only. Where a position is not finite all accelerations are
    NaN, as in the direct sum.
    """

    sets_directly = False
    in_tiles = False

    def __init__(self, force: Any, particle_count: int, dimensions: int) -> None:
        """Allocate; needs a started Taichi."""
        self.force = force
        self.accuracy = DEFAULT_ACCURACY if force.accuracy is None else force.accuracy
        self.particle_count = particle_count
        self.dimensions = dimensions
        config = ti.lang.impl.current_cfg()
        on_cpu = config.arch == ti.cpu
        self.rounding = round_off()
        padded = -(-particle_count // GROUP) * GROUP
        self.order = TreeOrder(particle_count, padded, dimensions, on_cpu=on_cpu)
        self.nodes = TreeNodes(self.order)
        self.estimate = TreeEstimate(self.order, self.nodes)
        walk: Any = TreeWalk if on_cpu else TreeGather
        if on_cpu and dimensions == 3 and series_walk.can_sum():
            walk = TreeSeries
        self.walk = walk(self.order, self.nodes, self.estimate)
        self.check = TreeCheck(self.order, self.estimate, self.walk.total)
        self.longest_loop = self.nodes.node_count + padded  # steps of a walk that opens each node

    def is_symmetric(self, state: Any) -> bool:
        """No: a walk sums the pulls on one group of bodies at a time."""
        return False

    def loops(self, state: Any) -> int:
        """Number of parallel loops that the plan counts for one sum: the walk."""
        return 1

    def destroy(self) -> None:
        """Free the memory."""
        for part in (self.walk, self.estimate, self.nodes, self.order):
            part.destroy()

    def add_accelerations(self, state: Any) -> None:
        """Add all accelerations, in launches of its own."""
        if self._sum(state, potential=False):
            self._add(state, self.force.strength * self.order.mass_unit / self.order.length**2)
        else:
            state.acceleration.fill(np.nan)

    def potential_terms(self, state: Any) -> np.ndarray:
        """Half of the potential energy of each body with all others, (particle_count,); their sum is the potential energy.

        Unlike other potentials, the terms are in the precision of the run and have the accuracy of the tree.
        """
        if not self._sum(state, potential=True):
            return np.full(self.particle_count, np.nan)
        terms = np.empty(self.particle_count)
        terms[self.order.order.to_numpy()] = self.walk.well.to_numpy()[: self.particle_count]
        scale = self.force.strength * self.order.mass_unit / self.order.length
        return -0.5 * scale * terms * state.mass.to_numpy()[: self.particle_count].astype(float)

    def _sum(self, state: Any, *, potential: bool) -> bool:
        if not self.order.build(state.position, state.mass):
            return False
        self.nodes.build()
        softening = self.force.softening / self.order.length
        tolerance = NODE_TOLERANCE[self.dimensions] * (self.accuracy / self.nodes.depth) ** NODE_EXPONENT
        self.estimate.estimate(softening * softening, tolerance, self.rounding / self.accuracy)
        self.walk.begin(self.accuracy, tolerance)
        walk = partial(self.walk.run, softening, potential=potential)
        walk()
        self.check.repeat(walk, self.accuracy)
        return True

    @ti.kernel
    def _add(self, state: Template, scale: float):
        for slot in range(self.particle_count):
            i = self.order.order[slot]
            for axis in ti.static(range(self.dimensions)):
                addend = scale * self.walk.total[axis * self.order.padded_count + slot]
                state.acceleration[i][axis] = state.acceleration[i][axis] + addend
