"""One spring between two particles."""

from collections.abc import Callable

import numpy as np

from mpp_taichi.component import Color, Pair, component, param
from mpp_taichi.networks._base import Network, NetworkContext, make_springs
from mpp_taichi.snapshot import Springs


@component
class Link(Network):
    """One spring. Two springs between the same particles act side by side: their forces add."""

    between: Pair = param(help="the particles at the two ends, by index or name")
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
    rest_length: float = param(
        None,
        optional=True,
        slider=True,
        minimum=0.0,
        unit="length",
        help="rest length; absent: length as placed, divided by prestretch",
    )
    prestretch: float = param(
        1.0, above=0.0, slider=True, help="length as placed, divided by the rest length; not used beside a rest_length"
    )
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

    def spring_count(self, lattice: Callable) -> int:
        """One."""
        return 1

    def generate(self, context: NetworkContext) -> Springs:
        """Link the two."""
        return make_springs(
            np.array([self.between]),
            context,
            rest_length=self.rest_length,
            stretch=self.prestretch,
            stiffness=self.stiffness,
            damping=self.damping,
            breaks_at=self.breaks_at,
            yields_at=self.yields_at,
            color=self.color,
        )
