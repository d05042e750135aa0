"""How far from their start the particles end."""

import numpy as np

from mpp_taichi.component import component
from mpp_taichi.diagnostics._base import Diagnostic, NoResultError
from mpp_taichi.snapshot import Snapshot


@component
class ReturnError(Diagnostic):
    """Largest distance of any particle from where it started, at the end of the run [length].

    After one period of a periodic orbit this is the error of the whole computation.
    """

    _start: np.ndarray | None = None
    _distance: float | None = None

    def observe(self, time: float, snapshot: Snapshot) -> None:
        """Compare with the first look."""
        if self._start is None:
            self._start = snapshot.position.copy()
        self._distance = float(np.linalg.norm(snapshot.position - self._start, axis=1)[snapshot.present].max())

    def result(self) -> float:
        """The distance at the last look."""
        if self._distance is None:
            raise NoResultError("the run was never looked at")
        return self._distance
