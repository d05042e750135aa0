"""How fast a particle moves."""

import numpy as np

from mpp_taichi.component import Particles, component, param
from mpp_taichi.diagnostics._gas import rows_of
from mpp_taichi.quantities._base import Look, OfEach, Setting, center_of, component_of, of_which


@component
class Speed(OfEach):
    """Size of a particle's velocity |v| [length / time]; of a group that of its centre of mass, in a histogram that of each
    particle that is free along every axis.
    """

    of: Particles = param(None, optional=True, help="a particle or a group; absent: all")
    dimension = (1, -1, 0)

    def label(self, setting: Setting) -> str:
        """Of what."""
        return of_which("speed", setting.name_of(self.of))

    def measure(self, look: Look) -> float:
        """The speed."""
        return component_of(center_of(look.snapshot.velocity, look.snapshot, self.of), None)

    def each(self, look: Look) -> np.ndarray:
        """The speeds."""
        return np.linalg.norm(look.snapshot.velocity[rows_of(self.of, look.snapshot)], axis=1)
