"""The distance that a particle flies between two collisions."""

import numpy as np

from mpp_taichi.component import component, param
from mpp_taichi.contacts._report import ContactReport
from mpp_taichi.diagnostics._gas import OfContacts, require_no_merging
from mpp_taichi.quantities._base import NoResultError, RunSample, Setting


@component
class MeanFreePath(OfContacts):
    """Mean speed over collision rate, ⟨v⟩ / Γ [length]; bounces off walls do not end a path.

    The mean speed is taken over all particles in all samples.
    """

    after: float = param(0.0, minimum=0.0, unit="time", help="time of the first sample")

    def prepare(self, setting: Setting) -> None:
        """Keep the number of particles."""
        require_no_merging(setting.spec)
        self._count = setting.start.particle_count
        self._speeds: list[float] = []

    def counted(self, report: ContactReport) -> float:
        """Two particles for every pair."""
        return 2.0 * report.pair_count / self._count

    def take(self, sample: RunSample) -> None:
        """Keep the mean speed."""
        self._speeds.append(float(np.linalg.norm(sample.snapshot.velocity, axis=1).mean()))

    def result(self) -> float:
        """λ."""
        rate = self._total.rate()
        if not rate > 0.0:
            raise NoResultError("no two particles met")
        return float(np.mean(self._speeds)) / rate
