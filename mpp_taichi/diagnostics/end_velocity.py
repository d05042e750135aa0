"""The velocity of a particle at the end."""

from mpp_taichi.component import Particle, component, param
from mpp_taichi.diagnostics._named import NamedReduction
from mpp_taichi.diagnostics._reductions import AtEnd
from mpp_taichi.quantities.velocity import Velocity


@component
class EndVelocity(NamedReduction):
    """Velocity of one particle along one axis at the end of the run [length / time]."""

    of: Particle = param(help="the particle")
    axis: str = param(choices=("x", "y", "z"), help="the direction")

    def reduction(self) -> AtEnd:
        """Velocity at the end."""
        return AtEnd(Velocity(of=(self.of, 1), axis=self.axis))
