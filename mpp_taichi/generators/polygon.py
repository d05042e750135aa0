"""A polygon: equal bodies, one behind the other, on a circle on which their own attraction keeps them."""

import math

import numpy as np

from mpp_taichi.component import Color, Particle, Vector, component, param
from mpp_taichi.generators._base import Center, Generator, GeneratorContext, Group, make_group


@component
class Polygon(Generator):
    """Equal particles at the corners of a regular polygon in the x–y plane, on one circular orbit that turns from x to y.

    With d_j = 2 R sin(π j/N) the distance to the j-th neighbour and M the mass of the central particle,
    v² = k² [Σ_j m d_j² / 2 (d_j² + ε²)^(3/2) + M R² / (R² + ε²)^(3/2)], which is k² m / 4R Σ_j 1/sin(π j/N) without softening
    and central particle. The orbit is exact. Without a heavy central particle it is unstable: a small displacement grows a
    hundredfold and more in each turn.

    Source: T. Müller, arXiv:1403.1695, eq. (16), with d = 2 R sin(ψ/2); J. C. Maxwell, On the Stability of the Motion of
    Saturn's Rings (1859).
    """

    name: str = param("", help="name of the group; its particles are addressed as name[0], name[1], …")
    count: int = param(minimum=2, maximum=1000, help="number N of particles")
    circumradius: float = param(1.0, above=0.0, unit="length", help="radius R of the circle")
    around: Particle = param(None, optional=True, help="central particle, placed before; absent: no central particle")
    center: Vector = param((0, 0, 0), unit="length", help="center of the circle, where there is no central particle")
    mass: float = param(1.0, minimum=0.0, unit="mass", help="mass of each particle")
    radius: float = param(0.0, minimum=0.0, unit="length", help="radius of each particle, for contacts and the picture")
    color: Color = param((0.9, 0.9, 0.9), help="red, green, blue in 0…1")

    def particle_count(self) -> int:
        """The parameter `count`."""
        return self.count

    def generate(self, context: GeneratorContext) -> Group:
        """The first particle lies along x from the centre."""
        center = Center(np.array(self.center), np.zeros(3), 0.0) if self.around is None else context.find(self.around)
        angle = 2.0 * np.pi * np.arange(self.count) / self.count
        outward = np.stack([np.cos(angle), np.sin(angle), np.zeros(self.count)], axis=1)
        along = np.stack([-outward[:, 1], outward[:, 0], outward[:, 2]], axis=1)
        speed = self.circular_speed(center.mass, context)
        return make_group(
            self.count,
            position=center.position + self.circumradius * outward,
            velocity=center.velocity + speed * along,
            mass=self.mass,
            radius=self.radius,
            color=self.color,
        )

    def circular_speed(self, central_mass: float, context: GeneratorContext) -> float:
        """The speed on the orbit [length / time]."""
        softened = context.softening**2
        squared = (2.0 * self.circumradius * np.sin(np.pi * np.arange(1, self.count) / self.count)) ** 2
        others = self.mass * float(np.sum(0.5 * squared / (squared + softened) ** 1.5))
        center = central_mass * self.circumradius**2 / (self.circumradius**2 + softened) ** 1.5
        return math.sqrt(context.strength * (others + center))
