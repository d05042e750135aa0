"""Where a particle ends."""

from mpp_taichi.component import Particle, component, param
from mpp_taichi.diagnostics._at_end import AtEnd
from mpp_taichi.diagnostics._between_looks import coordinate
from mpp_taichi.snapshot import Snapshot


@component
class EndPosition(AtEnd):
    """One coordinate of one particle at the end of the run [length]."""

    of: Particle = param(help="the particle")
    axis: str = param(choices=("x", "y", "z"), help="the coordinate")

    def measure(self, snapshot: Snapshot) -> float:
        """The coordinate."""
        return coordinate(snapshot, self.of, self.axis)[0]
