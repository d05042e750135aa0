"""Speed of a particle."""

import numpy as np

from mpp_taichi.component import Particles, component, param
from mpp_taichi.quantities._base import ManySample, OfEach, RunSample, Setting, of_which
from mpp_taichi.quantities._particles import center_of, component_of, free_rows, lengths


@component
class Speed(OfEach):
    """Speed |v| of a particle or of a group's centre of mass [length / time].

    A histogram shows the speed of each particle that is free along every axis.
    """

    of: Particles = param(None, optional=True, help="a particle or a group; absent: all")
    dimension = (1, -1, 0)
    takes_many = True

    def label(self, setting: Setting) -> str:
        """`speed of planet`."""
        return of_which("speed", setting.name_of(self.of))

    def measure(self, sample: RunSample) -> float:
        """The speed."""
        return component_of(center_of(sample.snapshot.velocity, sample.snapshot, self.of), None)

    def measure_many(self, many: ManySample) -> np.ndarray:
        """The speed in each copy."""
        return lengths(center_of(many.snapshot.velocity, many.snapshot, self.of))

    def each(self, sample: RunSample) -> np.ndarray:
        """The speeds of all free particles of the group."""
        return np.linalg.norm(sample.snapshot.velocity[free_rows(self.of, sample.snapshot)], axis=1)
