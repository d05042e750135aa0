"""The mass of all particles."""

from mpp_taichi.component import component
from mpp_taichi.diagnostics._base import Diagnostic, NoResultError
from mpp_taichi.snapshot import Snapshot


@component
class TotalMass(Diagnostic):
    """Σ m at the end of the run [mass]: spheres that merge keep it."""

    _value: float | None = None

    def observe(self, time: float, snapshot: Snapshot) -> None:
        """Keep the last look."""
        self._value = float(snapshot.mass.sum())

    def result(self) -> float:
        """The mass at the last look."""
        if self._value is None:
            raise NoResultError("the run was never looked at")
        return self._value
