"""The mass of all particles."""

from mpp_taichi.component import component
from mpp_taichi.diagnostics._at_end import AtEnd
from mpp_taichi.snapshot import Snapshot


@component
class TotalMass(AtEnd):
    """Σ m at the end of the run [mass]: spheres that merge keep it."""

    def measure(self, snapshot: Snapshot) -> float:
        """The mass."""
        return float(snapshot.mass.sum())
