"""Momentum of a particle, a group or all."""

from mpp_taichi.component import Particles, component, param
from mpp_taichi.energy.mechanics import momentum
from mpp_taichi.quantities._base import Quantity, RunSample, Setting, of_which
from mpp_taichi.quantities._particles import component_of, rows


@component
class Momentum(Quantity):
    """Momentum Σ m v, along an axis or its size [mass length / time], of particles that are not held."""

    of: Particles = param(None, optional=True, help="a particle or a group; absent: all")
    axis: str = param(None, optional=True, choices=("x", "y", "z"), help="the component; absent: the size")
    dimension = (1, -1, 1)

    def label(self, setting: Setting) -> str:
        """`momentum z of planet`."""
        return of_which(f"momentum {self.axis}" if self.axis else "momentum", setting.name_of(self.of))

    def measure(self, sample: RunSample) -> float:
        """The momentum."""
        return component_of(momentum(sample.snapshot, rows(self.of)), self.axis)
