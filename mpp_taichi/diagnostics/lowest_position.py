"""Lowest turning point of a coordinate."""

from mpp_taichi.component import Particle, component, param
from mpp_taichi.diagnostics._named import NamedReduction
from mpp_taichi.diagnostics._reductions import Extreme
from mpp_taichi.quantities.position import Position


@component
class LowestPosition(NamedReduction):
    """Smallest value that one coordinate of one particle takes during the run [length]."""

    of: Particle = param(help="the particle")
    axis: str = param("z", choices=("x", "y", "z"), help="the coordinate")

    def reduction(self) -> Extreme:
        """The smallest position."""
        return Extreme(Position(of=(self.of, 1), axis=self.axis), largest=False)
