"""Whether the two halves of a scene are still mirror images."""

import numpy as np

from mpp_taichi.component import component, param
from mpp_taichi.diagnostics._at_end import AtEnd
from mpp_taichi.diagnostics._between_looks import AXES
from mpp_taichi.snapshot import Snapshot


@component
class MirrorError(AtEnd):
    """Largest distance of a particle from the nearest mirror image of any, at the end of the run [length].

    0 for what is symmetric about the plane across `axis` at `at`, whatever the numbering.
    """

    axis: str = param("y", choices=("x", "y", "z"), help="across the mirror")
    at: float = param(0.0, unit="length", help="where the mirror stands")

    def measure(self, snapshot: Snapshot) -> float:
        """The distance."""
        places = snapshot.position[snapshot.present]
        image = places.copy()
        column = AXES.index(self.axis)
        image[:, column] = 2.0 * self.at - image[:, column]
        return max(float(np.min(np.linalg.norm(image - place, axis=1))) for place in places)
