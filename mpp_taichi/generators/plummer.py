"""A star cluster: particles of equal mass in Plummer's sphere, which is in equilibrium."""

import numpy as np

from mpp_taichi.component import Color, Vector, component, param
from mpp_taichi.errors import PlacementError
from mpp_taichi.generators._base import Generator, GeneratorContext, Group, make_group

FASTEST_SHARE = 0.1  # above the greatest value 0.0923 of q² (1 − q²)^(7/2), at q = √2/3


@component
class Plummer(Generator):
    """Plummer's sphere in equilibrium: density ρ ∝ (1 + r²/a²)^(−5/2), potential −G M / √(r² + a²).

    A share X of the mass lies within r = a / √(X^(−2/3) − 1); speeds are shares q of the escape speed at r, with the
    distribution q² (1 − q²)^(7/2). Radii beyond `extent` are drawn again. The cluster as a whole is at rest at its center. Up
    to the random error of `count` particles it has the virial ratio and the energy −3π/64 G M²/a of the model. The softening of
    the scene's gravity is not taken into account.
    Source: Aarseth, Hénon & Wielen, Astron. Astrophys. 37 (1974) 183.
    """

    name: str = param("", help="name of the group; its particles are addressed as name[0], name[1], …")
    count: int = param(minimum=1, help="number of particles")
    scale_radius: float = param(1.0, above=0.0, unit="length", help="scale radius a; half of the mass lies within 1.305 a")
    extent: float = param(10.0, above=0.0, unit="length", help="largest distance from the center at which a particle begins")
    total_mass: float = param(1.0, above=0.0, unit="mass", help="mass M of all particles together")
    center: Vector = param((0, 0, 0), unit="length", help="position of the center of mass")
    drift: Vector = param((0, 0, 0), unit="length time⁻¹", help="velocity of the center of mass")
    radius: float = param(0.0, minimum=0.0, unit="length", help="radius of each particle, for contacts and the picture")
    color: Color = param((1.0, 0.95, 0.8), help="red, green, blue in 0…1")

    def particle_count(self) -> int:
        """The parameter `count`."""
        return self.count

    def generate(self, context: GeneratorContext) -> Group:
        """Draw distances, directions and velocities, in this order."""
        if context.dimensions != 3:
            raise PlacementError("a Plummer sphere has three dimensions")
        random, a = context.random, self.scale_radius
        inside = self.extent**3 / (self.extent**2 + a**2) ** 1.5  # share of the mass within the extent
        share = random.uniform(0.0, inside, self.count)
        distance = a / np.sqrt(np.maximum(share, np.finfo(float).tiny) ** (-2.0 / 3.0) - 1.0)
        position = distance[:, None] * _directions(random, self.count)
        escape = np.sqrt(2.0 * context.strength * self.total_mass) * (distance**2 + a**2) ** -0.25
        velocity = (_shares_of_escape(random, self.count) * escape)[:, None] * _directions(random, self.count)
        return make_group(
            self.count,
            position=position - position.mean(axis=0) + np.array(self.center),
            velocity=velocity - velocity.mean(axis=0) + np.array(self.drift),
            mass=self.total_mass / self.count,
            radius=self.radius,
            color=self.color,
        )


def _directions(random: np.random.Generator, count: int) -> np.ndarray:
    """Unit vectors, every direction as likely as any other, shape (count, 3)."""
    vectors = random.normal(size=(count, 3))
    return np.asarray(vectors / np.linalg.norm(vectors, axis=1)[:, None])


def _shares_of_escape(random: np.random.Generator, count: int) -> np.ndarray:
    """Speeds q of the frequency q² (1 − q²)^(7/2), by rejection."""
    kept = np.empty(0)
    while len(kept) < count:
        q, height = random.uniform(size=(2, 4 * count + 16))
        kept = np.concatenate([kept, q[height * FASTEST_SHARE < q**2 * (1.0 - q**2) ** 3.5]])
    return kept[:count]
