"""Whether everything has come to rest."""

import numpy as np

from mpp_taichi.component import Particles, component, param
from mpp_taichi.diagnostics._at_end import AtEnd, rows
from mpp_taichi.snapshot import Snapshot


@component
class RestingSpeed(AtEnd):
    """Largest speed of any particle at the end of the run [length / time]; 0 where all are at rest."""

    of: Particles = param(None, optional=True, help="a particle or a group; absent: all")

    def measure(self, snapshot: Snapshot) -> float:
        """The speed."""
        return float(np.linalg.norm(snapshot.velocity[rows(self.of)], axis=1).max())
