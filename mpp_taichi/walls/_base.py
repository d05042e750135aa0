"""A wall: surfaces that spheres bounce off, or a periodic box. Pure Python; `_geometry.py` has the formulas."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

from mpp_taichi.errors import PlacementError

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Surface:
    """A smooth surface with particles on one side of it; it may move at a constant velocity.

    kind         "plane" through `point`; "cylinder" around the line through `point` along `direction`; "sphere" around `point`
    direction    unit vector: of a plane the normal, into the free side; of a cylinder the axis; of a sphere unused
    radius       of cylinder or sphere [length]; of a plane unused
    inside       of cylinder or sphere: whether the particles are inside it
    velocity     of the surface [length / time]; it is at `point` when the time is 0
    restitution  e of a bounce off it
    label        its text in messages and reports, "walls[0].box, lower x"
    """

    kind: Literal["plane", "cylinder", "sphere"]
    point: Vector
    direction: Vector
    radius: float
    inside: bool
    velocity: Vector
    restitution: float
    label: str


@dataclass(frozen=True)
class Enclosure:
    """All walls of a scene: surfaces, and a periodic box, if the scene has one.

    period   edge lengths of the periodic box along x, y, z; 0 along an axis that does not repeat [length]
    origin   its lower corner; the position of a sphere that leaves the box is not reduced, pictures show the copy in the box
    """

    surfaces: tuple[Surface, ...] = ()
    period: Vector = (0.0, 0.0, 0.0)
    origin: Vector = (0.0, 0.0, 0.0)

    @property
    def repeats(self) -> tuple[bool, bool, bool]:
        """Whether the walls repeat along each axis."""
        return (self.period[0] > 0.0, self.period[1] > 0.0, self.period[2] > 0.0)


class Wall:
    """A kind of wall: parameters → surfaces or a period."""

    repeats = False  # True: the wall is a periodic box; scenes are checked by this literal value

    def enclosure(self, dimensions: int, label: str) -> Enclosure:
        """The surfaces or the period of this wall; `label` is its name in the scene."""
        raise NotImplementedError


def unit_vector(vector: Vector, name: str) -> Vector:
    """The direction of a vector; PlacementError where it has none."""
    largest = max(map(abs, vector))
    if not largest > 0.0:
        raise PlacementError(f"{name} must not be [0, 0, 0]")
    scaled = [component / largest for component in vector]  # squares of tiny or huge components stay numbers
    length = math.hypot(*scaled)
    return (scaled[0] / length, scaled[1] / length, scaled[2] / length)


def joined(parts: Iterable[Enclosure]) -> Enclosure:
    """All walls together; PlacementError where two of them repeat."""
    surfaces: tuple[Surface, ...] = ()
    periodic = Enclosure()
    for part in parts:
        surfaces += part.surfaces
        if any(part.period):
            if any(periodic.period):
                raise PlacementError("there is a periodic_box already, allowed: one")
            periodic = part
    return Enclosure(surfaces, periodic.period, periodic.origin)
