"""A rack: balls in a triangle, as at the start of a game of billiards."""

import math

import numpy as np

from mpp_taichi.component import Color, Vector, component, param
from mpp_taichi.errors import PlacementError
from mpp_taichi.generators._base import Generator, GeneratorContext, Group, make_group


@component
class Rack(Generator):
    """Equal balls at rest in the rows of a triangle in the x–y plane: one ball at the apex, two balls behind it, and so on.

    Ball 0 is at the apex; the balls of each row are numbered from one side to the other. The two halves are mirror images to
    the last bit where the direction is along x or y and the apex is at 0 on the other axis.
    """

    name: str = param("", help="name of the group; its balls are addressed as name[0], name[1], …")
    rows: int = param(5, minimum=1, maximum=1000, help="number of rows; 5 rows are 15 balls")
    apex: Vector = param(unit="length", help="centre of the ball at the apex")
    direction: Vector = param((1, 0, 0), help="direction from the apex to the last row, in the x–y plane")
    radius: float = param(above=0.0, unit="length", help="radius of each ball")
    gap: float = param(0.0, minimum=0.0, unit="length", help="gap between neighbours; 0: neighbours touch")
    mass: float = param(1.0, minimum=0.0, unit="mass", help="mass of each ball")
    color: Color = param((0.9, 0.3, 0.2), help="red, green, blue in 0…1")

    def particle_count(self) -> int:
        """1 + 2 + … rows."""
        return self.rows * (self.rows + 1) // 2

    def generate(self, context: GeneratorContext) -> Group:
        """Rows √3/2 of a spacing apart; across, multiples of half a spacing to either side."""
        x, y, z = self.direction
        length = math.hypot(x, y)
        if z != 0.0 or not length > 0.0:
            raise PlacementError(f"direction {[x, y, z]} must be along the x–y plane and not zero")
        along = np.array([x / length, y / length, 0.0])
        across = np.array([-along[1], along[0], 0.0])
        row = np.repeat(np.arange(self.rows), np.arange(1, self.rows + 1))
        halves = np.concatenate([np.arange(-k, k + 1, 2) for k in range(self.rows)])  # from −k to k: a half spacing each
        spacing = 2.0 * self.radius + self.gap
        depth, side = row * (math.sqrt(0.75) * spacing), halves * (0.5 * spacing)
        place = np.array(self.apex) + depth[:, None] * along + side[:, None] * across
        return make_group(len(row), position=place, mass=self.mass, radius=self.radius, color=self.color)
