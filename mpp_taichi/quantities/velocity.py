"""How fast a particle moves along an axis."""

import numpy as np

from mpp_taichi.component import Particles, component, param
from mpp_taichi.diagnostics._gas import rows_of
from mpp_taichi.quantities._base import Look, OfEach, Setting, center_of, component_of, of_which


@component
class Velocity(OfEach):
    """A component of a particle's velocity [length / time]; of a group that of its centre of mass, in a histogram that of
    each particle that is free along every axis.
    """

    of: Particles = param(None, optional=True, help="a particle or a group; absent: all")
    axis: str = param(choices=("x", "y", "z"), help="the component")
    dimension = (1, -1, 0)

    def label(self, setting: Setting) -> str:
        """The component, and of what."""
        return of_which(f"velocity {self.axis}", setting.name_of(self.of))

    def measure(self, look: Look) -> float:
        """The component."""
        return component_of(center_of(look.snapshot.velocity, look.snapshot, self.of), self.axis)

    def each(self, look: Look) -> np.ndarray:
        """The components."""
        return look.snapshot.velocity[rows_of(self.of, look.snapshot), "xyz".index(self.axis)]
