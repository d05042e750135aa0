"""One hinge with bending stiffness between two links."""

from collections.abc import Callable

import numpy as np

from mpp_taichi.component import Color, Pair, Particle, component, param
from mpp_taichi.errors import PlacementError
from mpp_taichi.networks._base import Network, NetworkContext
from mpp_taichi.networks._hinges import hinge_springs
from mpp_taichi.snapshot import Springs


@component
class Hinge(Network):
    """One hinge: the links from a particle to two others resist a bend between them.

    The energy is ½ B κ² times half of the length of both links, with the curvature κ, and 0 where the three particles are in
    line. It is made of three springs without a rest length, of which one has a negative stiffness. The links themselves are
    springs or rods of other entries. At the clamped end of a beam the hinge belongs to half of a cell: it needs 2 B.
    """

    at: Particle = param(help="the particle at the bend")
    between: Pair = param(help="the particles at the other ends of the two links")
    bending_stiffness: float = param(
        minimum=0.0,
        slider=True,
        unit="force length²",
        help="bending stiffness B, of a beam E I: Young's modulus times area moment",
    )
    color: Color = param((0.4, 0.4, 1.0), help="red, green, blue in 0…1")
    bends = True

    def spring_count(self, lattice: Callable) -> int:
        """Three."""
        return 3

    def generate(self, context: NetworkContext) -> Springs:
        """Make the three springs.

        Raises:
            PlacementError: the particle at the bend is one of the others.
        """
        first, last = self.between
        if self.at in (first, last):
            raise PlacementError("at: is one of the particles of between:, must be a third")
        rows = np.array([[first, self.at, last]])
        return hinge_springs(rows, context, bending_stiffness=self.bending_stiffness, color=self.color)
