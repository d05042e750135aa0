"""The deviation of the particles from mirror symmetry."""

import numpy as np

from mpp_taichi.component import component, param
from mpp_taichi.quantities._base import Quantity, RunSample, Setting
from mpp_taichi.quantities._particles import AXES


@component
class MirrorError(Quantity):
    """Largest distance of a particle from the nearest mirror image of any particle [length].

    It is 0 for particles that are symmetric about the plane across `axis` at `at`, in whatever order they are numbered.
    """

    axis: str = param("y", choices=("x", "y", "z"), help="axis perpendicular to the mirror")
    at: float = param(0.0, unit="length", help="coordinate of the mirror on this axis")
    dimension = (1, 0, 0)

    def label(self, setting: Setting) -> str:
        """`mirror error across y`."""
        return f"mirror error across {self.axis}"

    def measure(self, sample: RunSample) -> float:
        """The distance."""
        places = sample.snapshot.position[sample.snapshot.present]
        image = places.copy()
        column = AXES.index(self.axis)
        image[:, column] = 2.0 * self.at - image[:, column]
        return max(float(np.min(np.linalg.norm(image - place, axis=1))) for place in places)
