"""Springs between the particles of a lattice: one kind of neighbours for each entry."""

import math
from collections.abc import Callable, Iterator

import numpy as np

from mpp_taichi.component import Color, component, param
from mpp_taichi.networks._base import Network, NetworkContext, make_springs
from mpp_taichi.snapshot import Springs


@component
class LatticeLinks(Network):
    """Springs between neighbours in a lattice; each kind of neighbours is an entry of its own, with its own stiffness.

    nearest: every particle is linked to the next particle along each axis, 112 springs in a sheet of 8 × 8. diagonal: both
    diagonals of every square cell are springs; without diagonals a lattice with free corners shears without any force. bending:
    every particle is linked to the next but one along each axis, so that a bend costs energy.

    Without prestretch a flat sheet has no linear restoring force across itself: a displacement z stretches a spring of length d
    only by z²/2d, so that the force goes as z³ and the frequency as the amplitude. A prestretch s, rest length d/s, gives
    the tension T = D d (1 − 1/s) and with it the modes of a membrane.
    """

    of: str = param(help="name of the lattice")
    neighbors: str = param("nearest", choices=("nearest", "diagonal", "bending"), help="kind of neighbours that are linked")
    type: str = param("", help="name of an entry of spring_types:, which gives the parameters that are not given here")
    stiffness: float = param(
        None,
        optional=True,
        slider=True,
        minimum=0.0,
        unit="force length⁻¹",
        help="stiffness D; given here or in the spring type",
    )
    damping: float = param(0.0, slider=True, minimum=0.0, unit="force time length⁻¹", help="damping c")
    prestretch: float = param(1.0, above=0.0, slider=True, help="length as placed, divided by the rest length")
    breaks_at: float = param(
        None, optional=True, above=0.0, help="strain (l − L)/L at which a spring breaks; absent: it never breaks"
    )
    yields_at: float = param(
        None,
        optional=True,
        above=0.0,
        help="elastic strain, of a longer or a shorter spring, beyond which the rest length follows; absent: none",
    )
    color: Color = param((0.4, 0.4, 1.0), help="red, green, blue in 0…1")
    links_lattice = True

    def spring_count(self, lattice: Callable[[str], tuple[int, tuple[int, int, int]]]) -> int:
        """For every direction of links, one spring for each particle with a partner in this direction."""
        counts = lattice(self.of)[1]
        return sum(
            math.prod(max(count - abs(along), 0) for count, along in zip(counts, step, strict=True)) for step in self._steps()
        )

    def generate(self, context: NetworkContext) -> Springs:
        """Link neighbours, step by step."""
        first, counts = context.lattice(self.of)
        index = first + np.arange(math.prod(counts)).reshape(counts[::-1])  # last axis of the array is x
        pairs = [np.zeros((0, 2), dtype=int)]
        for step in self._steps():
            near, far = zip(*(_ends(count, along) for count, along in zip(index.shape, step[::-1], strict=True)), strict=True)
            pairs.append(np.stack([index[near].ravel(), index[far].ravel()], axis=1))
        return make_springs(
            np.concatenate(pairs),
            context,
            rest_length=None,
            stretch=self.prestretch,
            stiffness=self.stiffness,
            damping=self.damping,
            breaks_at=self.breaks_at,
            yields_at=self.yields_at,
            color=self.color,
        )

    def _steps(self) -> Iterator[tuple[int, int, int]]:
        """The directions of links from a particle to its partners, as offsets along the three axes."""
        for axis in range(3):
            for lengths in {"nearest": [(1, 0)], "bending": [(2, 0)], "diagonal": [(1, 1), (1, -1)]}[self.neighbors]:
                along = dict(zip((axis, (axis + 1) % 3, (axis + 2) % 3), (*lengths, 0), strict=True))
                yield (along[0], along[1], along[2])


def _ends(count: int, along: int) -> tuple[slice, slice]:
    """The places of the first and the second ends of the springs along an axis."""
    low, high = slice(0, max(count - abs(along), 0)), slice(abs(along), None)
    return (low, high) if along >= 0 else (high, low)
