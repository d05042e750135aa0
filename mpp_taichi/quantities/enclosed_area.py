"""The area inside a closed polygon of particles."""

from mpp_taichi.arithmetic.polygon_area import signed_area
from mpp_taichi.component import Particles, component, param
from mpp_taichi.quantities._base import Quantity, RunSample, Setting, of_which
from mpp_taichi.quantities._particles import rows


@component
class EnclosedArea(Quantity):
    """Area ½ |Σ (x_i y_{i+1} − x_{i+1} y_i)| of the polygon in the x–y plane whose corners are a group [length²]."""

    of: Particles = param(help="the group of the corners, in their order")
    dimension = (2, 0, 0)

    def label(self, setting: Setting) -> str:
        """`area inside skin`."""
        return of_which("area inside", setting.name_of(self.of)).replace(" of ", " ", 1)

    def measure(self, sample: RunSample) -> float:
        """The area."""
        return abs(signed_area(sample.snapshot.position[rows(self.of), :2]))
