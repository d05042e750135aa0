"""Where a particle is."""

import numpy as np

from mpp_taichi.component import Particles, component, param
from mpp_taichi.quantities._base import Look, OfEach, Setting, center_of, component_of, of_which, rows


@component
class Position(OfEach):
    """A coordinate of a particle [length]; of a group that of its centre of mass, in a histogram that of each particle."""

    of: Particles = param(None, optional=True, help="a particle or a group; absent: all")
    axis: str = param(choices=("x", "y", "z"), help="the coordinate")
    dimension = (1, 0, 0)

    def label(self, setting: Setting) -> str:
        """The axis, and of what."""
        return of_which(self.axis, setting.name_of(self.of))

    def measure(self, look: Look) -> float:
        """The coordinate."""
        return component_of(center_of(look.snapshot.position, look.snapshot, self.of), self.axis)

    def each(self, look: Look) -> np.ndarray:
        """The coordinates."""
        return look.snapshot.position[rows(self.of), "xyz".index(self.axis)]
