"""What a wall is: surfaces that spheres bounce off, or a box that repeats. Pure Python; `_geometry.py` has the formulas."""

from dataclasses import dataclass
from typing import Literal

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
    label        what messages and reports call it, "walls[0].box, lower x"
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
    """All walls of a scene: surfaces, and the box that repeats, if any.

    period   edge lengths of the periodic box along x, y, z; 0 along an axis that does not repeat [length]
    origin   its lower corner; positions along a repeating axis are wrapped to origin … origin + period when they are shown
    """

    surfaces: tuple[Surface, ...] = ()
    period: Vector = (0.0, 0.0, 0.0)
    origin: Vector = (0.0, 0.0, 0.0)

    @property
    def repeats(self) -> tuple[bool, bool, bool]:
        """Along which axes it repeats."""
        return (self.period[0] > 0.0, self.period[1] > 0.0, self.period[2] > 0.0)


class Wall:
    """A kind of wall: parameters → surfaces or a period."""

    def enclosure(self, dimensions: int, label: str) -> Enclosure:
        """What it adds; `label` is what the scene calls it."""
        raise NotImplementedError
