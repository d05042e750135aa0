"""The mass of all particles."""

from mpp_taichi.component import component
from mpp_taichi.diagnostics._named import NamedReduction
from mpp_taichi.diagnostics._reductions import AtEnd
from mpp_taichi.quantities.mass import Mass


@component
class TotalMass(NamedReduction):
    """Σ m at the end of the run [mass]: spheres that merge keep it."""

    def reduction(self) -> AtEnd:
        """Mass at the end."""
        return AtEnd(Mass())
