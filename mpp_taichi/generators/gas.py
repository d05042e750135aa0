"""A gas: many spheres in a box, without overlaps, with random velocities."""

import math

import numpy as np

from mpp_taichi.component import Color, Vector, component, param
from mpp_taichi.errors import PlacementError
from mpp_taichi.generators._base import Generator, GeneratorContext, Group, make_group
from mpp_taichi.generators._crowd import PlacedSpheres, at_random, on_lattice
from mpp_taichi.wording.told_apart import told_apart

RANDOM_PACKING = {2: 0.36, 3: 0.2}  # random addition cannot continue beyond 0.547 and 0.38, and is slow long before
CLOSEST_PACKING = {2: math.pi / math.sqrt(12.0), 3: math.pi / math.sqrt(18.0)}


@component
class Gas(Generator):
    """Spheres completely inside a box, without overlaps with each other or with particles placed before them.

    Positions are random while there is room. A denser gas begins on a stretched and shaken lattice with random vacancies, whose
    order is lost after some collisions per particle. Disks can fill up to 0.8 of a flat box, and spheres half of a box and
    more; a mixture of different radii fills less, since each place of the lattice has room for the largest sphere.

    Velocities have one speed and random directions, or the Maxwell–Boltzmann distribution of a temperature; two particles and
    more then have exactly the mean energy d/2 k T. Without a speed and a temperature the gas is at rest.
    """

    name: str = param("", help="name of the group; its particles are addressed as name[0], name[1], …")
    count: int = param(minimum=1, help="number of particles")
    lower: Vector = param(unit="length", help="corner of the box where every coordinate is least")
    upper: Vector = param(unit="length", help="corner of the box where every coordinate is greatest")
    radius: float = param(minimum=0.0, unit="length", help="radius of each sphere, or mean radius")
    radius_spread: float = param(
        0.0, minimum=0.0, maximum=0.99, help="radii are uniformly distributed within radius · (1 ± radius_spread)"
    )
    mass: float = param(1.0, minimum=0.0, unit="mass", help="mass of each particle")
    speed: float = param(0.0, minimum=0.0, unit="length time⁻¹", help="speed of every particle relative to the drift")
    temperature: float = param(None, optional=True, minimum=0.0, unit="energy", help="temperature k T, instead of a speed")
    drift: Vector = param((0, 0, 0), unit="length time⁻¹", help="common velocity, added to the random velocities")
    zero_momentum: bool = param(
        False, help="whether the random velocities add up to zero; particles of one speed then move in opposite pairs"
    )
    color: Color = param((0.6, 0.8, 1.0), help="red, green, blue in 0…1")

    def particle_count(self) -> int:
        """The parameter `count`."""
        return self.count

    def generate(self, context: GeneratorContext) -> Group:
        """Draw radii, places and velocities, in this order."""
        random, dimensions = context.random, context.dimensions
        radius = self.radius * (1.0 + self.radius_spread * random.uniform(-1.0, 1.0, self.count))
        obstacles = [PlacedSpheres(group.position, group.radius) for group in context.placed]
        position = self._places(random, radius, obstacles, dimensions)
        return make_group(
            self.count,
            position=position,
            velocity=self._velocities(random, dimensions) + np.array(self.drift),
            mass=self.mass,
            radius=radius,
            color=self.color,
        )

    def _places(
        self, random: np.random.Generator, radius: np.ndarray, obstacles: list[PlacedSpheres], dimensions: int
    ) -> np.ndarray:
        lower, upper = np.array(self.lower, dtype=float), np.array(self.upper, dtype=float)
        extent, largest = (upper - lower)[:dimensions], float(radius.max())
        if not np.all(extent >= 2.0 * largest):
            sides = " × ".join(f"{side:g}" for side in extent)
            raise PlacementError(f"a sphere of radius {largest:g} does not fit into the box from lower to upper, {sides}")
        if dimensions == 2:  # a box without depth
            lower[2] = upper[2] = 0.0
        taken = np.sum(math.pi * radius**2 if dimensions == 2 else 4.0 / 3.0 * math.pi * radius**3)
        packing = float(taken / np.prod(extent)) if np.all(extent > 0.0) else math.inf
        found = None
        if packing <= RANDOM_PACKING[dimensions]:
            found = at_random(random, lower, upper, radius, obstacles)
        if found is None and packing <= CLOSEST_PACKING[dimensions]:
            found = on_lattice(random, lower, upper, radius, obstacles)
        if found is None:
            size = f"radius {self.radius:g}" if self.radius_spread == 0.0 else f"radii up to {largest:g}"
            beside = " beside the particles placed before" if any(len(each.radius) for each in obstacles) else ""
            share, most = told_apart(packing, CLOSEST_PACKING[dimensions], digits=3)
            raise PlacementError(
                f"there is no room for {self.count:,} spheres of {size}{beside}: they would fill {share} of the box from "
                f"lower to upper, where the closest packing fills {most} of unlimited space"
            )
        return found

    def _velocities(self, random: np.random.Generator, dimensions: int) -> np.ndarray:
        if self.temperature is not None and self.speed > 0.0:
            raise PlacementError(f"speed {self.speed:g} and temperature {self.temperature:g} exclude one another, give one")
        moves = self.speed > 0.0 or bool(self.temperature)
        if moves and self.zero_momentum and self.count == 1:
            raise PlacementError("zero_momentum: one particle that moves has a momentum, give count 2 or more")
        if self.temperature is None:
            return self.speed * (_balanced_directions if self.zero_momentum else _directions)(random, self.count, dimensions)
        return self._thermal(random, dimensions)

    def _thermal(self, random: np.random.Generator, dimensions: int) -> np.ndarray:
        """Normal components; for two particles and more scaled to the energy of the temperature."""
        if not self.mass > 0.0:
            raise PlacementError(f"mass {self.mass:g} has no thermal velocity, must be above 0")
        velocity = np.zeros((self.count, 3))
        velocity[:, :dimensions] = random.normal(size=(self.count, dimensions))
        if self.zero_momentum:
            velocity -= velocity.mean(axis=0)
        mean_square = float(np.mean(velocity**2)) * 3.0 / dimensions if self.count > 1 else 1.0
        return velocity * math.sqrt(self.temperature / (self.mass * mean_square))


def _directions(random: np.random.Generator, count: int, dimensions: int) -> np.ndarray:
    """Unit vectors, every direction as likely as any other, shape (count, 3)."""
    if dimensions == 2:
        angle = random.uniform(0.0, 2.0 * np.pi, count)
        return np.stack([np.cos(angle), np.sin(angle), np.zeros(count)], axis=1)
    height, angle = random.uniform(-1.0, 1.0, count), random.uniform(0.0, 2.0 * np.pi, count)
    across = np.sqrt(1.0 - height**2)
    return np.stack([across * np.cos(angle), across * np.sin(angle), height], axis=1)


def _balanced_directions(random: np.random.Generator, count: int, dimensions: int) -> np.ndarray:
    """Unit vectors that add up to zero: in opposite pairs, three of an odd count at 120°, handed out in random order."""
    half = _directions(random, count // 2, dimensions)
    vectors = np.concatenate([half, -half])
    if count % 2:
        first = half[0]
        across = np.cross(first, _directions(random, 1, 3)[0] if dimensions == 3 else np.array([0.0, 0.0, 1.0]))
        across *= math.sqrt(0.75) / np.linalg.norm(across)
        vectors = np.concatenate([half[1:], -half[1:], [first, -0.5 * first + across, -0.5 * first - across]])
    return random.permutation(vectors)
