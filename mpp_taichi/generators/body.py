"""One particle, every property given."""

import numpy as np

from mpp_taichi.component import Axes, Color, Vector, component, param
from mpp_taichi.generators._base import Generator, GeneratorContext, Group, make_group


@component
class Body(Generator):
    """One particle."""

    name: str = param("", help="to refer to it by; otherwise it has its index")
    mass: float = param(unit="mass")
    position: Vector = param(unit="length", help="with a displacement: that of rest")
    displacement: Vector = param((0.0, 0.0, 0.0), unit="length", help="from rest, at the start; springs stretch by it")
    velocity: Vector = param((0.0, 0.0, 0.0), unit="length time⁻¹")
    radius: float = param(0.0, unit="length", help="for contacts and the picture")
    charge: float = param(0.0, unit="charge")
    color: Color = param((0.9, 0.9, 0.9), help="red, green, blue in 0…1")
    free: Axes = param((True, True, True), help="false where an axis is held fixed; a velocity along it is ignored")

    def particle_count(self) -> int:
        """One."""
        return 1

    def generate(self, context: GeneratorContext) -> Group:
        """Put the particle where it is said to be."""
        return make_group(
            1,
            position=np.add(self.position, self.displacement),
            rest_position=self.position,
            velocity=self.velocity,
            mass=self.mass,
            radius=self.radius,
            charge=self.charge,
            color=self.color,
            free=self.free,
            name=(self.name,),
        )
