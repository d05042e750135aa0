"""What springs pull at a particle or a group with."""

import math

import numpy as np

from mpp_taichi.component import Particles, component, param
from mpp_taichi.diagnostics._at_end import AtEnd, rows
from mpp_taichi.diagnostics._base import NoResultError
from mpp_taichi.diagnostics._between_looks import AXES
from mpp_taichi.snapshot import Snapshot


@component
class SpringForce(AtEnd):
    """Σ D (|d| − L) d/|d| over the springs that end at a particle or in a group, at the end of the run [force].

    Springs within the group add up to nothing; friction is left out. At rest they pull at what is held with the weight of all
    that hangs on it, whatever its shape.
    """

    of: Particles = param(help="a particle or a group")
    axis: str = param(choices=("x", "y", "z"), help="the component")

    def measure(self, snapshot: Snapshot) -> float:
        """The component of the sum.

        Raises:
            NoResultError: there are no springs.
        """
        springs = snapshot.springs
        if len(springs) == 0:
            raise NoResultError("the scene has no springs")
        inside = np.zeros(snapshot.particle_count, bool)
        inside[rows(self.of)] = True
        # +1 where the group is the first end alone, and is pulled along d; −1 where it is the second alone.
        sign = inside[springs.between[:, 0]].astype(float) - inside[springs.between[:, 1]]
        crossing = sign != 0.0
        first, second = springs.between[crossing].T
        separation = snapshot.position[second] - snapshot.position[first]
        length = np.linalg.norm(separation, axis=1)
        stretch = springs.stiffness[crossing] * (length - springs.rest_length[crossing])
        direction = separation[:, AXES.index(self.axis)] / np.where(length > 0.0, length, 1.0)
        return math.fsum(sign[crossing] * stretch * direction)
