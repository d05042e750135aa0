"""Bending stiffness along the rows of a lattice: a beam, or a plate of beams."""

import math
from collections.abc import Callable

import numpy as np

from mpp_taichi.component import Color, component, param
from mpp_taichi.networks._base import Network, NetworkContext
from mpp_taichi.networks._hinges import hinge_springs
from mpp_taichi.snapshot import Springs


@component
class LatticeHinges(Network):
    """A hinge at every particle of a lattice that has neighbours on both sides along an axis.

    A chain with links by `lattice_links` and these hinges is a beam of the bending stiffness B: for small bends its sag and its
    frequencies are those of Euler and Bernoulli, with an error of the square of the distance of two particles. For large bends
    it is the elastica, as long as the links keep their lengths. In a sheet each row is such a beam, and a twist of the
    sheet costs no energy. See `hinge` for the energy, and for the end of a beam that is clamped.
    Source: L. Euler, Methodus inveniendi (1744), additamentum I.
    """

    of: str = param(help="name of the lattice")
    bending_stiffness: float = param(
        minimum=0.0, slider=True, unit="force length²", help="bending stiffness B of each row of the lattice"
    )
    color: Color = param((0.4, 0.4, 1.0), help="red, green, blue in 0…1")
    bends = True

    def spring_count(self, lattice: Callable[[str], tuple[int, tuple[int, int, int]]]) -> int:
        """Along every axis with three particles or more, one for each two next and each two next but one neighbours."""
        counts = lattice(self.of)[1]
        total = math.prod(counts)
        return sum(total // count * (2 * count - 3) for count in counts if count > 2)

    def generate(self, context: NetworkContext) -> Springs:
        """Make the hinges, axis by axis."""
        first, counts = context.lattice(self.of)
        index = first + np.arange(math.prod(counts)).reshape(counts[::-1])  # last axis of the array is x
        rows = [np.zeros((0, 3), dtype=int)]
        for axis, count in enumerate(index.shape):
            if count > 2:
                along = [np.moveaxis(index, axis, -1)[..., shift : count - 2 + shift] for shift in range(3)]
                rows.append(np.stack([each.ravel() for each in along], axis=1))
        return hinge_springs(np.concatenate(rows), context, bending_stiffness=self.bending_stiffness, color=self.color)
