"""The mass of the heaviest particle."""

from mpp_taichi.component import Particles, component, param
from mpp_taichi.quantities._base import Quantity, RunSample, Setting, of_which
from mpp_taichi.quantities._particles import rows


@component
class LargestMass(Quantity):
    """Mass of the heaviest particle [mass], grown by all particles that have merged into it."""

    of: Particles = param(None, optional=True, help="a particle or a group; absent: all")
    dimension = (0, 0, 1)

    def label(self, setting: Setting) -> str:
        """`largest mass of disk`."""
        return of_which("largest mass", setting.name_of(self.of))

    def measure(self, sample: RunSample) -> float:
        """The mass."""
        return float(sample.snapshot.mass[rows(self.of)].max())
