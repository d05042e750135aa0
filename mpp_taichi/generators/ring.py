"""A planetary ring: many small particles on circular orbits around a central one."""

import math

import numpy as np

from mpp_taichi.component import Color, Particle, component, param
from mpp_taichi.errors import PlacementError
from mpp_taichi.generators._base import Center, Generator, GeneratorContext, Group, make_group
from mpp_taichi.generators._elliptic import annulus_pull
from mpp_taichi.wording.told_apart import told_apart


@component
class Ring(Generator):
    """A flat ring of uniform surface density in the x–y plane, on circular orbits that turn from x to y.

    central: v² = k² M r² / (r² + ε²)^(3/2), which is k² M / r without softening; the ring's own pull is left out.
    with_ring: v² = v² of central + r times the pull of the ring as a continuous sharp-edged disc of surface density
    ρ = M_ring / [π (R₂² − R₁²)], in closed form by elliptic integrals. The pull of the disc diverges like a logarithm at the
    two rims, where particles are no continuum: it is evaluated no closer to a rim than one mean spacing √(area / count), and
    without softening.

    Source: T. Müller, arXiv:1403.1695, appendix B, whose ρ = M σ lacks the area of the ring.
    """

    name: str = param("", help="name of the group; its particles are addressed as name[0], name[1], …")
    count: int = param(minimum=1, help="number of particles")
    around: Particle = param(
        None, optional=True, help="central particle, placed before; absent: none, and the ring is around the origin"
    )
    inner_radius: float = param(above=0.0, unit="length", help="inner radius R₁")
    outer_radius: float = param(above=0.0, unit="length", help="outer radius R₂")
    mass: float = param(0.0, minimum=0.0, unit="mass", help="mass of each particle")
    radius: float = param(0.0, minimum=0.0, unit="length", help="radius of each particle, for contacts and the picture")
    color: Color = param((0.8, 0.75, 0.65), help="red, green, blue in 0…1")
    velocity: str = param(
        "central",
        choices=("central", "with_ring", "rest"),
        help="the pull that the orbits balance: of the central particle, with the ring, or none",
    )
    gravitational_strength: float = param(
        None, optional=True, minimum=0.0, help="k²; absent: the strength of newtonian_gravity"
    )
    softening: float = param(
        None, optional=True, minimum=0.0, unit="length", help="ε; absent: the softening of newtonian_gravity"
    )

    def particle_count(self) -> int:
        """The parameter `count`."""
        return self.count

    def generate(self, context: GeneratorContext) -> Group:
        """Draw radius and angle of each particle, uniform in area."""
        if self.inner_radius >= self.outer_radius:
            inner, outer = told_apart(self.inner_radius, self.outer_radius)
            raise PlacementError(f"inner_radius {inner} must be below outer_radius {outer}")
        center = Center(np.zeros(3), np.zeros(3), 0.0) if self.around is None else context.find(self.around)
        area = context.random.uniform(self.inner_radius**2, self.outer_radius**2, self.count)
        r, angle = np.sqrt(area), context.random.uniform(0.0, 2.0 * np.pi, self.count)
        outward = np.stack([np.cos(angle), np.sin(angle), np.zeros(self.count)], axis=1)
        along = np.stack([-np.sin(angle), np.cos(angle), np.zeros(self.count)], axis=1)
        speed = self.circular_speed(r, center.mass, context)
        return make_group(
            self.count,
            position=center.position + r[:, None] * outward,
            velocity=center.velocity + speed[:, None] * along,
            mass=self.mass,
            radius=self.radius,
            color=self.color,
        )

    def circular_speed(self, r: np.ndarray, central_mass: float, context: GeneratorContext) -> np.ndarray:
        """Speed of circular orbits at distance r [length] from the centre."""
        strength = context.strength if self.gravitational_strength is None else self.gravitational_strength
        softening = context.softening if self.softening is None else self.softening
        if self.velocity == "rest":
            return np.zeros_like(r)
        squared = strength * central_mass * r**2 / (r**2 + softening**2) ** 1.5
        if self.velocity == "with_ring":
            area = math.pi * (self.outer_radius**2 - self.inner_radius**2)
            spacing = min(math.sqrt(area / self.count), 0.5 * (self.outer_radius - self.inner_radius))
            inside = np.clip(r, self.inner_radius + spacing, self.outer_radius - spacing)
            density = self.count * self.mass / area
            squared = squared + strength * density * r * annulus_pull(inside, self.inner_radius, self.outer_radius)
        if np.any(squared < 0.0):
            where = r[np.argmin(squared)]
            raise PlacementError(f"no circular orbit at r = {where:g}: the ring pulls outward more than the centre inward")
        return np.sqrt(squared)
