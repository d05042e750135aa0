"""Temperature of a gas at the end, from its velocities."""

from mpp_taichi.component import Particles, component, param
from mpp_taichi.diagnostics._named import NamedReduction
from mpp_taichi.diagnostics._reductions import AtEnd
from mpp_taichi.quantities.temperature import Temperature


@component
class KineticTemperature(NamedReduction):
    """k T = Σ m v² / (d N) at the end of the run [energy], of particles that are free along every axis."""

    of: Particles = param(None, optional=True, help="a particle or a group; absent: all")
    drift: bool = param(False, help="whether v is relative to the common motion; d N then becomes d (N − 1)")

    def reduction(self) -> AtEnd:
        """Temperature at the end."""
        return AtEnd(Temperature(of=self.of, drift=self.drift))
