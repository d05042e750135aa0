"""Angular momentum of a particle, a group or all."""

from mpp_taichi.component import Particles, component, param
from mpp_taichi.energy.mechanics import angular_momentum
from mpp_taichi.quantities._base import Quantity, RunSample, Setting, of_which
from mpp_taichi.quantities._particles import component_of, rows


@component
class AngularMomentum(Quantity):
    """Angular momentum Σ m x × v about the origin, along an axis or its size [mass length² / time], of particles that are
    not held.
    """

    of: Particles = param(None, optional=True, help="a particle or a group; absent: all")
    axis: str = param(None, optional=True, choices=("x", "y", "z"), help="the component; absent: the size")
    dimension = (2, -1, 1)

    def label(self, setting: Setting) -> str:
        """`angular momentum z of planet`."""
        return of_which(f"angular momentum {self.axis}" if self.axis else "angular momentum", setting.name_of(self.of))

    def measure(self, sample: RunSample) -> float:
        """The angular momentum."""
        return component_of(angular_momentum(sample.snapshot, rows(self.of)), self.axis)
