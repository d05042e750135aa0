"""The mean square of the distances that particles have wandered."""

import math

import numpy as np

from mpp_taichi.component import Particles, component, param
from mpp_taichi.diagnostics._base import Diagnostic
from mpp_taichi.quantities._base import NoResultError, RunSample, Setting
from mpp_taichi.quantities._particles import free_rows
from mpp_taichi.start.contact_setup import enclosure_of

SAMPLE_SHARE = 0.1  # of the shortest period that the fastest particle may fly between two samples


@component
class MeanSquareDisplacement(Diagnostic):
    """⟨|x(t) − x(0)|²⟩ at the end of the run [length²].

    In a box that repeats, paths are followed through its sides: the displacement between two samples is the shortest of all
    that differ by whole boxes, so that no particle may fly half a box between two samples. Diffusion has 2 d D t
    (`kinetic_theory.transport`).
    """

    of: Particles = param(None, optional=True, help="a particle or a group; absent: all particles that are free")
    after: float = param(0.0, minimum=0.0, unit="time", help="time of the first sample, from which displacements are measured")
    _way: np.ndarray | None = None
    _last: np.ndarray
    _present: np.ndarray
    _interval: float = math.inf

    def begin(self, setting: Setting) -> None:
        """Keep the period, and which particles."""
        self._period, self._rows = np.array(enclosure_of(setting.spec).period), free_rows(self.of, setting.start)
        if len(self._rows) == 0:
            raise NoResultError("there is no free particle to wander")

    def observe(self, sample: RunSample) -> None:
        """Add the step since the sample before."""
        snapshot = sample.snapshot
        position = snapshot.position[self._rows]
        if sample.time >= self.after:
            way = np.zeros_like(position) if self._way is None else self._way + shortest(position - self._last, self._period)
            self._way, self._last, self._present = way, position.copy(), snapshot.present[self._rows]
        fastest = float(np.linalg.norm(snapshot.velocity, axis=1).max())
        shortest_period = min([period for period in self._period if period > 0.0], default=math.inf)
        self._interval = SAMPLE_SHARE * shortest_period / fastest if fastest > 0.0 else math.inf

    @property
    def interval(self) -> float:
        """Often enough to follow a particle through the sides of the box."""
        return self._interval

    def result(self) -> float:
        """The mean square in the last sample."""
        if self._way is None:
            raise NoResultError(f"the run ended before `after`, {self.after:g}")
        if not self._present.any():
            raise NoResultError("all particles have merged into others")
        return float(np.mean(np.sum(self._way[self._present] ** 2, axis=1)))


def shortest(step: np.ndarray, period: np.ndarray) -> np.ndarray:
    """The shortest of all steps that differ by whole periods, shape (n, 3); a period of 0 is none."""
    repeats = np.where(period > 0.0, period, 1.0)
    return step - np.where(period > 0.0, np.round(step / repeats) * repeats, 0.0)
