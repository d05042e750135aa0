"""The position of a particle at the end of the run."""

from mpp_taichi.component import Particle, component, param
from mpp_taichi.diagnostics._named import NamedReduction
from mpp_taichi.diagnostics._reductions import AtEnd
from mpp_taichi.quantities.position import Position


@component
class EndPosition(NamedReduction):
    """One coordinate of one particle at the end of the run [length]."""

    of: Particle = param(help="the particle")
    axis: str = param(choices=("x", "y", "z"), help="the coordinate")

    def reduction(self) -> AtEnd:
        """Position at the end."""
        return AtEnd(Position(of=(self.of, 1), axis=self.axis))
