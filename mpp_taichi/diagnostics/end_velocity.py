"""How fast a particle ends."""

from mpp_taichi.component import Particle, component, param
from mpp_taichi.diagnostics._base import Diagnostic, NoResultError
from mpp_taichi.diagnostics._between_looks import coordinate
from mpp_taichi.snapshot import Snapshot


@component
class EndVelocity(Diagnostic):
    """Velocity of one particle along one axis at the end of the run [length / time]."""

    of: Particle = param(help="the particle")
    axis: str = param(choices=("x", "y", "z"), help="the direction")
    _value: float | None = None

    def observe(self, time: float, snapshot: Snapshot) -> None:
        """Keep the last look."""
        self._value = coordinate(snapshot, self.of, self.axis)[1]

    def result(self) -> float:
        """The velocity at the last look."""
        if self._value is None:
            raise NoResultError("the run was never looked at")
        return self._value
