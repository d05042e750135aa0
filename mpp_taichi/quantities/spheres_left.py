"""The number of particles that have not merged."""

from mpp_taichi.component import Particles, component, param
from mpp_taichi.quantities._base import Quantity, RunSample, Setting, of_which
from mpp_taichi.quantities._particles import rows


@component
class SpheresLeft(Quantity):
    """Number of particles that have not merged into another particle."""

    of: Particles = param(None, optional=True, help="a particle or a group; absent: all")

    def label(self, setting: Setting) -> str:
        """`spheres left of disk`."""
        return of_which("spheres left", setting.name_of(self.of))

    def measure(self, sample: RunSample) -> float:
        """The number."""
        return float(sample.snapshot.present[rows(self.of)].sum())
