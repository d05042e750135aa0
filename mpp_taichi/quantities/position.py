"""Position of a particle."""

import numpy as np

from mpp_taichi.component import Particles, component, param
from mpp_taichi.quantities._base import ManySample, OfEach, RunSample, Setting, of_which
from mpp_taichi.quantities._particles import AXES, center_of, component_of, components_of, rows


@component
class Position(OfEach):
    """A coordinate of a particle or of a group's centre of mass [length]; a histogram shows the coordinate of each particle."""

    of: Particles = param(None, optional=True, help="a particle or a group; absent: all")
    axis: str = param(choices=("x", "y", "z"), help="the coordinate")
    dimension = (1, 0, 0)
    has_rate = True
    takes_many = True

    def label(self, setting: Setting) -> str:
        """`z of planet`."""
        return of_which(self.axis, setting.name_of(self.of))

    def measure(self, sample: RunSample) -> float:
        """The coordinate."""
        return component_of(center_of(sample.snapshot.position, sample.snapshot, self.of), self.axis)

    def rate(self, sample: RunSample) -> float:
        """The velocity along the axis."""
        return component_of(center_of(sample.snapshot.velocity, sample.snapshot, self.of), self.axis)

    def measure_many(self, many: ManySample) -> np.ndarray:
        """The coordinate in each copy."""
        return components_of(center_of(many.snapshot.position, many.snapshot, self.of), self.axis)

    def rate_many(self, many: ManySample) -> np.ndarray:
        """The velocity along the axis in each copy."""
        return components_of(center_of(many.snapshot.velocity, many.snapshot, self.of), self.axis)

    def each(self, sample: RunSample) -> np.ndarray:
        """The coordinates of all particles of the group."""
        return sample.snapshot.position[rows(self.of), AXES.index(self.axis)]
