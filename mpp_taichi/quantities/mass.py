"""The mass of a particle or a group."""

from mpp_taichi.component import Particles, component, param
from mpp_taichi.quantities._base import Quantity, RunSample, Setting, of_which
from mpp_taichi.quantities._particles import rows


@component
class Mass(Quantity):
    """Mass of a particle or a group [mass]: it changes where spheres merge, and with a timeline."""

    of: Particles = param(None, optional=True, help="a particle or a group; absent: all")
    dimension = (0, 0, 1)

    def label(self, setting: Setting) -> str:
        """`mass of planet`."""
        return of_which("mass", setting.name_of(self.of))

    def measure(self, sample: RunSample) -> float:
        """The sum."""
        return float(sample.snapshot.mass[rows(self.of)].sum())
