"""Velocity of a particle along an axis."""

import numpy as np

from mpp_taichi.component import Particles, component, param
from mpp_taichi.quantities._base import OfEach, RunSample, Setting, of_which
from mpp_taichi.quantities._particles import AXES, center_of, component_of, free_rows


@component
class Velocity(OfEach):
    """A component of the velocity of a particle or of a group's centre of mass [length / time].

    A histogram shows the component of each particle that is free along every axis.
    """

    of: Particles = param(None, optional=True, help="a particle or a group; absent: all")
    axis: str = param(choices=("x", "y", "z"), help="the component")
    dimension = (1, -1, 0)

    def label(self, setting: Setting) -> str:
        """`velocity z of planet`."""
        return of_which(f"velocity {self.axis}", setting.name_of(self.of))

    def measure(self, sample: RunSample) -> float:
        """The component."""
        return component_of(center_of(sample.snapshot.velocity, sample.snapshot, self.of), self.axis)

    def each(self, sample: RunSample) -> np.ndarray:
        """The components of all free particles of the group."""
        return sample.snapshot.velocity[free_rows(self.of, sample.snapshot), AXES.index(self.axis)]
