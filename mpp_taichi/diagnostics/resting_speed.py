"""Whether everything has come to rest."""

import numpy as np

from mpp_taichi.component import Particles, component, param
from mpp_taichi.diagnostics._base import Diagnostic, NoResultError
from mpp_taichi.snapshot import Snapshot


@component
class RestingSpeed(Diagnostic):
    """Largest speed of any particle at the end of the run [length / time]; 0 where all are at rest."""

    of: Particles = param(None, optional=True, help="a particle or a group; absent: all")
    _value: float | None = None

    def observe(self, time: float, snapshot: Snapshot) -> None:
        """Keep the last look."""
        rows = slice(None) if self.of is None else slice(self.of[0], self.of[0] + self.of[1])
        self._value = float(np.linalg.norm(snapshot.velocity[rows], axis=1).max())

    def result(self) -> float:
        """The speed at the last look."""
        if self._value is None:
            raise NoResultError("the run was never looked at")
        return self._value
