"""Springs between the neighbours of a closed skin in space."""

from collections.abc import Callable

from mpp_taichi.arithmetic.closed_skin import divisions_of, edge_count, edges
from mpp_taichi.component import Color, Particles, component, param
from mpp_taichi.errors import PlacementError
from mpp_taichi.networks._base import Network, NetworkContext, make_springs
from mpp_taichi.snapshot import Springs


@component
class ShellLinks(Network):
    """A spring along each edge of a closed skin of triangles, 30 ν² for a `shell` of ν divisions, 6 for four particles."""

    of: Particles = param(help="the group whose particles are the corners of the skin, made by `shell`, or four particles")
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
        """The number of edges."""
        return edge_count(self._count())

    def generate(self, context: NetworkContext) -> Springs:
        """Link neighbours."""
        return make_springs(
            self.of[0] + edges(self._count()),
            context,
            rest_length=self.rest_length,
            stretch=self.prestretch,
            stiffness=self.stiffness,
            damping=self.damping,
            breaks_at=self.breaks_at,
            yields_at=self.yields_at,
            color=self.color,
        )

    def _count(self) -> int:
        count = self.of[1]
        if divisions_of(count) is None:
            raise PlacementError(f"has {count} particles, must be a shell, of 10 ν² + 2 particles, or four particles")
        return count
