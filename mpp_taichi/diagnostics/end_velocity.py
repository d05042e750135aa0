"""How fast a particle ends."""

from mpp_taichi.component import Particle, component, param
from mpp_taichi.diagnostics._at_end import AtEnd
from mpp_taichi.diagnostics._between_looks import coordinate
from mpp_taichi.snapshot import Snapshot


@component
class EndVelocity(AtEnd):
    """Velocity of one particle along one axis at the end of the run [length / time]."""

    of: Particle = param(help="the particle")
    axis: str = param(choices=("x", "y", "z"), help="the direction")

    def measure(self, snapshot: Snapshot) -> float:
        """The velocity."""
        return coordinate(snapshot, self.of, self.axis)[1]
