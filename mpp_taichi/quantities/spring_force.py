"""The force of the springs on a particle or a group."""

import math

import numpy as np

from mpp_taichi.component import Particles, component, param
from mpp_taichi.quantities._base import NoResultError, Quantity, RunSample, Setting, of_which
from mpp_taichi.quantities._particles import AXES, rows


@component
class SpringForce(Quantity):
    """Σ D (|d| − L) d/|d| over the springs that end at a particle or in a group [force].

    Springs within the group add up to nothing; friction is left out. At rest they pull at a held particle with the weight of
    all particles that hang on it, whatever the shape of the network.
    """

    of: Particles = param(help="a particle or a group")
    axis: str = param(choices=("x", "y", "z"), help="the component")
    dimension = (1, -2, 1)

    def label(self, setting: Setting) -> str:
        """`spring force z of hook`."""
        return of_which(f"spring force {self.axis}", setting.name_of(self.of))

    def measure(self, sample: RunSample) -> float:
        """The component of the sum.

        Raises:
            NoResultError: there are no springs.
        """
        snapshot, springs = sample.snapshot, sample.snapshot.springs
        if len(springs) == 0:
            raise NoResultError("the scene has no springs")
        inside = np.zeros(snapshot.particle_count, bool)
        inside[rows(self.of)] = True
        # +1 where only the first end is in the group, which is pulled along d; −1 where only the second end is in the group.
        sign = inside[springs.between[:, 0]].astype(float) - inside[springs.between[:, 1]]
        crossing = sign != 0.0
        first, second = springs.between[crossing].T
        separation = snapshot.position[second] - snapshot.position[first]
        length = np.linalg.norm(separation, axis=1)
        stretch = springs.stiffness[crossing] * (length - springs.rest_length[crossing])
        direction = separation[:, AXES.index(self.axis)] / np.where(length > 0.0, length, 1.0)
        return math.fsum(sign[crossing] * stretch * direction)
