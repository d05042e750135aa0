"""Momentum of a group of particles."""

from mpp_taichi.component import Particles, component, param
from mpp_taichi.diagnostics._at_end import AtEnd, rows
from mpp_taichi.diagnostics._between_looks import AXES
from mpp_taichi.snapshot import Snapshot


@component
class GroupMomentum(AtEnd):
    """Σ m v along one axis at the end of the run [mass length / time]."""

    of: Particles = param(help="a particle or a group")
    axis: str = param("x", choices=("x", "y", "z"), help="the direction")

    def measure(self, snapshot: Snapshot) -> float:
        """The momentum."""
        chosen = rows(self.of)
        return float(snapshot.mass[chosen] @ snapshot.velocity[chosen, AXES.index(self.axis)])
