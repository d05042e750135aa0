"""The volume inside a closed skin in space."""

from mpp_taichi.arithmetic.closed_skin import divisions_of, enclosed_volume
from mpp_taichi.component import Particles, component, param
from mpp_taichi.quantities._base import NoResultError, Quantity, RunSample, Setting, of_which
from mpp_taichi.quantities._particles import rows


@component
class EnclosedVolume(Quantity):
    """Volume |Σ x_i·(x_j × x_k)|/6 over the triangles i j k of a closed skin, whose corners are a `shell` [length³]."""

    of: Particles = param(help="the group of the corners, made by `shell`, or four particles")
    dimension = (3, 0, 0)

    def begin(self, setting: Setting) -> None:
        """Refuse a group of which no skin has as many corners.

        Raises:
            NoResultError: it is no shell, and has not four particles.
        """
        if divisions_of(self.of[1]) is None:
            raise NoResultError(f"{self.of[1]} particles are the corners of no closed skin, which has 10 ν² + 2 or four")

    def label(self, setting: Setting) -> str:
        """`volume inside skin`."""
        return of_which("volume inside", setting.name_of(self.of)).replace(" of ", " ", 1)

    def measure(self, sample: RunSample) -> float:
        """The volume."""
        return abs(enclosed_volume(sample.snapshot.position[rows(self.of)]))
