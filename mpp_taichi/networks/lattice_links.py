"""Springs between the nearest neighbours of a lattice."""

from collections.abc import Callable

import numpy as np

from mpp_taichi.component import Color, component, param
from mpp_taichi.networks._base import Network, NetworkContext, make_springs
from mpp_taichi.snapshot import Springs


@component
class LatticeLinks(Network):
    """A spring from every particle of a lattice to the next along each axis: 112 of them in a sheet of 8 × 8.

    Without prestretch a flat sheet has no linear restoring force across itself: a displacement z stretches a spring of length d
    only by z²/2d, so that the force goes as z³ and the frequency as the amplitude. A prestretch s, rest length d/s, gives
    the tension T = D d (1 − 1/s) and with it the modes of a membrane.
    """

    of: str = param(help="name of the lattice")
    stiffness: float = param(minimum=0.0, unit="force length⁻¹", help="D")
    damping: float = param(0.0, minimum=0.0, unit="force time length⁻¹", help="c")
    prestretch: float = param(1.0, above=0.0, help="placed length over rest length")
    color: Color = param((0.4, 0.4, 1.0), help="red, green, blue in 0…1")

    def spring_count(self, lattice: Callable[[str], tuple[int, tuple[int, int, int]]]) -> int:
        """Along each axis one less than there are particles."""
        counts = lattice(self.of)[1]
        total = counts[0] * counts[1] * counts[2]
        return sum(total // count * (count - 1) for count in counts)

    def generate(self, context: NetworkContext) -> Springs:
        """Link neighbours, axis by axis."""
        first, counts = context.lattice(self.of)
        index = first + np.arange(counts[0] * counts[1] * counts[2]).reshape(counts[::-1])  # last axis of the array is x
        pairs = []
        for axis in (2, 1, 0):
            length = index.shape[axis]
            near, far = np.take(index, range(length - 1), axis), np.take(index, range(1, length), axis)
            pairs.append(np.stack([near.ravel(), far.ravel()], axis=1))
        between = np.concatenate(pairs)
        return make_springs(
            between,
            context,
            rest_length=None,
            stretch=self.prestretch,
            stiffness=self.stiffness,
            damping=self.damping,
            color=self.color,
        )
