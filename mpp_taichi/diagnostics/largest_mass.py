"""The mass of the heaviest particle."""

from mpp_taichi.component import Particles, component, param
from mpp_taichi.diagnostics._at_end import AtEnd, rows
from mpp_taichi.snapshot import Snapshot


@component
class LargestMass(AtEnd):
    """Mass of the heaviest particle at the end of the run [mass], grown by what has merged into it."""

    of: Particles = param(None, optional=True, help="a particle or a group; absent: all")

    def measure(self, snapshot: Snapshot) -> float:
        """The mass."""
        return float(snapshot.mass[rows(self.of)].max())
