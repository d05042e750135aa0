"""Momentum of a particle, a group or all."""

from mpp_taichi.component import Particles, component, param
from mpp_taichi.energy.mechanics import momentum
from mpp_taichi.quantities._base import Look, Quantity, Setting, component_of, of_which, rows


@component
class Momentum(Quantity):
    """Momentum Σ m v, along an axis or its size [mass length / time], of particles that are not held."""

    of: Particles = param(None, optional=True, help="a particle or a group; absent: all")
    axis: str = param(None, optional=True, choices=("x", "y", "z"), help="the component; absent: the size")
    dimension = (1, -1, 1)

    def label(self, setting: Setting) -> str:
        """The component, and of what."""
        return of_which(f"momentum {self.axis}" if self.axis else "momentum", setting.name_of(self.of))

    def measure(self, look: Look) -> float:
        """The momentum."""
        return component_of(momentum(look.snapshot, rows(self.of)), self.axis)
