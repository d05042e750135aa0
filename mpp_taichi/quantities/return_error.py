"""The distance of the particles from their places in the first sample."""

import numpy as np

from mpp_taichi.component import component
from mpp_taichi.quantities._base import Quantity, RunSample, Setting


@component
class ReturnError(Quantity):
    """Largest distance of any particle from its place at the start [length].

    After one period of a periodic orbit this is the error of the whole computation.
    """

    dimension = (1, 0, 0)
    remembers = True
    _start: np.ndarray | None = None

    def restart(self) -> None:
        """Forget the places at the start."""
        self._start = None

    def label(self, setting: Setting) -> str:
        """Return error."""
        return "largest distance from the start"

    def measure(self, sample: RunSample) -> float:
        """The distance from the places in the first sample."""
        snapshot = sample.snapshot
        if self._start is None:
            self._start = snapshot.position.copy()
        return float(np.linalg.norm(snapshot.position - self._start, axis=1)[snapshot.present].max())
