"""How many particles there are."""

from mpp_taichi.component import Particles, component, param
from mpp_taichi.diagnostics._at_end import AtEnd, rows
from mpp_taichi.snapshot import Snapshot


@component
class SpheresLeft(AtEnd):
    """Number of particles at the end of the run that have not merged into another."""

    of: Particles = param(None, optional=True, help="a particle or a group; absent: all")

    def measure(self, snapshot: Snapshot) -> float:
        """The number."""
        return float(snapshot.present[rows(self.of)].sum())
