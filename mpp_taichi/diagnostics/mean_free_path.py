"""How far a particle flies between two collisions."""

import numpy as np

from mpp_taichi.component import component, param
from mpp_taichi.contacts._report import ContactReport
from mpp_taichi.diagnostics._base import NoResultError
from mpp_taichi.diagnostics._gas import OfContacts, require_no_merging
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.snapshot import Snapshot


@component
class MeanFreePath(OfContacts):
    """Mean speed over collision rate, ⟨v⟩ / Γ [length]; bounces off walls do not end a way.

    The mean speed is that of all particles at all looks.
    """

    after: float = param(0.0, minimum=0.0, unit="time", help="look from this time on")

    def begin(self, spec: SceneSpec, start: Snapshot) -> None:
        """Keep how many particles there are."""
        super().begin(spec, start)
        require_no_merging(spec)
        self._count = start.particle_count
        self._speeds: list[float] = []

    def counted(self, report: ContactReport) -> float:
        """Two particles for every pair."""
        return 2.0 * report.pair_count / self._count

    def observe(self, time: float, snapshot: Snapshot) -> None:
        """Take the mean speed."""
        if time >= self.after:
            self._speeds.append(float(np.linalg.norm(snapshot.velocity, axis=1).mean()))

    def result(self) -> float:
        """λ."""
        rate = self._total.rate()
        if not rate > 0.0:
            raise NoResultError("no two particles met")
        return float(np.mean(self._speeds)) / rate
