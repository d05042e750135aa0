"""The speed of the fastest particle, which tells whether all particles have come to rest."""

import numpy as np

from mpp_taichi.component import Particles, component, param
from mpp_taichi.quantities._base import Quantity, RunSample, Setting, of_which
from mpp_taichi.quantities._particles import rows


@component
class RestingSpeed(Quantity):
    """Speed of the fastest particle [length / time]; 0 where all particles are at rest."""

    of: Particles = param(None, optional=True, help="a particle or a group; absent: all")
    dimension = (1, -1, 0)

    def label(self, setting: Setting) -> str:
        """`largest speed of pile`."""
        return of_which("largest speed", setting.name_of(self.of))

    def measure(self, sample: RunSample) -> float:
        """The speed."""
        return float(np.linalg.norm(sample.snapshot.velocity[rows(self.of)], axis=1).max())
