"""The number of springs that have broken."""

import numpy as np

from mpp_taichi.component import Particles, component, param
from mpp_taichi.quantities._base import Quantity, RunSample, Setting, of_which
from mpp_taichi.quantities._particles import rows


@component
class BrokenSprings(Quantity):
    """Number of springs that have broken, since they were stretched beyond the strain `breaks_at`."""

    of: Particles = param(None, optional=True, help="a particle or a group, whose springs are counted; absent: all")

    def label(self, setting: Setting) -> str:
        """`broken springs of sheet`."""
        return of_which("broken springs", setting.name_of(self.of))

    def measure(self, sample: RunSample) -> float:
        """The number."""
        springs, ends = sample.snapshot.springs, np.zeros(sample.snapshot.particle_count, bool)
        ends[rows(self.of)] = True
        return float((~springs.whole & ends[springs.between].any(axis=1)).sum())
