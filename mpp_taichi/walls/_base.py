"""A wall: surfaces that spheres bounce off, or a periodic box. Pure Python; `_geometry.py` has the formulas."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from mpp_taichi.errors import PlacementError

Vector = tuple[float, float, float]


@dataclass(frozen=True)
class Surface:
    """A surface that may move: a smooth surface with particles on one side of it, or a segment.

    kind         "plane" through `point`; "cylinder" around the line through `point` along `direction`; "sphere" around `point`;
                 "segment" from `point` to `end` in the x–y plane, in three dimensions a strip that is infinite along z
    direction    unit vector: of a plane the normal, into the free side; of a cylinder the axis; of a segment from `point` to
                 `end`; of a sphere unused
    radius       of cylinder or sphere [length]; of a plane and a segment unused
    inside       of cylinder or sphere: whether the particles are inside it; a segment has particles on both sides
    velocity     of the surface [length / time]; it is at `point` when the time is 0
    motion       in place of a velocity: the displacement from `point` as a PathLaw; None where there is none
    restitution  e of a bounce off it
    label        its text in messages and reports, "walls[0].box, lower x"
    end          of a segment
    wall         the text under which the impulse on it is reported; empty: its label
    temperature  k T of a wall that gives every sphere that meets it a velocity of this temperature [energy]; None: a mirror
    seed         number that chooses these velocities
    """

    kind: Literal["plane", "cylinder", "sphere", "segment"]
    point: Vector
    direction: Vector
    radius: float
    inside: bool
    velocity: Vector
    restitution: float
    label: str
    end: Vector = (0.0, 0.0, 0.0)
    wall: str = ""
    temperature: float | None = None
    seed: int = 1
    motion: Any = None

    @property
    def has_motion(self) -> bool:
        """Whether the surface moves as a formula says."""
        return self.motion is not None

    @property
    def moves(self) -> bool:
        """Whether the surface moves at some time."""
        return any(self.velocity) or self.motion is not None

    def shift_at(self, time: float) -> np.ndarray:
        """How far the surface is from `point` at a time, (3,) [length]."""
        found = np.multiply(self.velocity, time)
        return found if self.motion is None else found + self.motion.at(time)[0]

    def speed_at(self, time: float) -> float:
        """The speed of the surface at a time [length / time]."""
        return float(np.linalg.norm(self.velocity if self.motion is None else self.motion.at(time)[1]))

    @property
    def is_thermal(self) -> bool:
        """Whether the surface has a temperature."""
        return self.temperature is not None


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
    def segments(self) -> tuple[Surface, ...]:
        """The segments, which are the last of the surfaces."""
        return tuple(surface for surface in self.surfaces if surface.kind == "segment")

    @property
    def accounts(self) -> tuple[str, ...]:
        """The walls for which an impulse is reported: a surface by itself, or all segments of a polygon together."""
        return tuple(dict.fromkeys(surface.wall or surface.label for surface in self.surfaces))

    @property
    def account_of(self) -> tuple[int, ...]:
        """The number of the account of each surface."""
        numbers = {account: number for number, account in enumerate(self.accounts)}
        return tuple(numbers[surface.wall or surface.label] for surface in self.surfaces)

    @property
    def repeats(self) -> tuple[bool, bool, bool]:
        """Whether the walls repeat along each axis."""
        return (self.period[0] > 0.0, self.period[1] > 0.0, self.period[2] > 0.0)

    def inside(self, position: np.ndarray) -> np.ndarray:
        """The copies of particles that lie in the box that repeats; `position` is (n, 3)."""
        period = np.array(self.period)
        boxes = np.floor((position - self.origin) / np.where(period > 0.0, period, np.inf))
        return position - boxes * period


class Wall:
    """A kind of wall: parameters → surfaces or a period."""

    repeats = False  # True: the wall is a periodic box; scenes are checked by this literal value

    def enclosure(self, dimensions: int, label: str) -> Enclosure:
        """The surfaces or the period of this wall; `label` is its name in the scene."""
        raise NotImplementedError


def motion_law(texts: Any) -> Any:
    """The law of a displacement from its formulas (FormulaText); None where there are none."""
    if texts is None:
        return None
    from mpp_taichi.scene.formulas.path_law import path_law  # with SymPy, only where a wall has a motion

    return path_law(texts)


def unit_vector(vector: Vector, name: str) -> Vector:
    """The direction of a vector; PlacementError where it has none."""
    largest = max(map(abs, vector))
    if not largest > 0.0:
        raise PlacementError(f"{name} must not be [0, 0, 0]")
    scaled = [component / largest for component in vector]  # squares of tiny or huge components stay numbers
    length = math.hypot(*scaled)
    return (scaled[0] / length, scaled[1] / length, scaled[2] / length)


def segment(begin: Vector, end: Vector, *, velocity: Vector, restitution: float, label: str, wall: str = "") -> Surface:
    """The segment between two points of the x–y plane; PlacementError where they are one point."""
    way = (end[0] - begin[0], end[1] - begin[1], 0.0)
    if not any(way):
        raise PlacementError(f"begins and ends at one place, [{begin[0]:g}, {begin[1]:g}]")
    return Surface(
        kind="segment",
        point=(begin[0], begin[1], 0.0),
        direction=unit_vector(way, "way"),
        radius=0.0,
        inside=False,
        velocity=velocity,
        restitution=restitution,
        label=label,
        end=(end[0], end[1], 0.0),
        wall=wall,
    )


def joined(parts: Iterable[Enclosure]) -> Enclosure:
    """All walls together, segments last; PlacementError where two of them repeat, or segments are in a box that repeats."""
    surfaces: tuple[Surface, ...] = ()
    periodic = Enclosure()
    for part in parts:
        surfaces += part.surfaces
        if any(part.period):
            if any(periodic.period):
                raise PlacementError("there is a periodic_box already, allowed: one")
            periodic = part
    made = Enclosure(tuple(sorted(surfaces, key=lambda surface: surface.kind == "segment")), periodic.period, periodic.origin)
    if made.segments and any(made.repeats[:2]):
        raise PlacementError("segments and polygons have no copies in a periodic_box that repeats along x or y; use planes")
    return made
