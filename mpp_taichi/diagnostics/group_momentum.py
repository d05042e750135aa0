"""Momentum of a group of particles."""

from mpp_taichi.component import Particles, component, param
from mpp_taichi.diagnostics._base import Diagnostic, NoResultError
from mpp_taichi.diagnostics._between_looks import AXES
from mpp_taichi.snapshot import Snapshot


@component
class GroupMomentum(Diagnostic):
    """Σ m v along one axis at the end of the run [mass length / time]."""

    of: Particles = param(help="a particle or a group")
    axis: str = param("x", choices=("x", "y", "z"), help="the direction")
    _value: float | None = None

    def observe(self, time: float, snapshot: Snapshot) -> None:
        """Keep the last look."""
        rows = slice(self.of[0], self.of[0] + self.of[1])
        self._value = float(snapshot.mass[rows] @ snapshot.velocity[rows, AXES.index(self.axis)])

    def result(self) -> float:
        """The momentum at the last look."""
        if self._value is None:
            raise NoResultError("the run was never looked at")
        return self._value
