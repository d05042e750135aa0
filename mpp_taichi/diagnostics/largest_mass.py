"""The mass of the heaviest particle."""

from mpp_taichi.component import Particles, component, param
from mpp_taichi.diagnostics._base import Diagnostic, NoResultError
from mpp_taichi.snapshot import Snapshot


@component
class LargestMass(Diagnostic):
    """Mass of the heaviest particle at the end of the run [mass], grown by what has merged into it."""

    of: Particles = param(None, optional=True, help="a particle or a group; absent: all")
    _value: float | None = None

    def observe(self, time: float, snapshot: Snapshot) -> None:
        """Keep the last look."""
        rows = slice(None) if self.of is None else slice(self.of[0], self.of[0] + self.of[1])
        self._value = float(snapshot.mass[rows].max())

    def result(self) -> float:
        """The mass at the last look."""
        if self._value is None:
            raise NoResultError("the run was never looked at")
        return self._value
