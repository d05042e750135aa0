"""Momentum of a group of particles."""

from mpp_taichi.component import Particles, component, param
from mpp_taichi.diagnostics._named import NamedReduction
from mpp_taichi.diagnostics._reductions import AtEnd
from mpp_taichi.quantities.momentum import Momentum


@component
class GroupMomentum(NamedReduction):
    """Σ m v along one axis at the end of the run [mass length / time], of particles that are not held."""

    of: Particles = param(help="a particle or a group")
    axis: str = param("x", choices=("x", "y", "z"), help="the direction")

    def reduction(self) -> AtEnd:
        """Momentum at the end."""
        return AtEnd(Momentum(of=self.of, axis=self.axis))
