"""A wall: surfaces that spheres bounce off, or a periodic box. Pure Python; `_geometry.py` has the formulas."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from mpp_taichi.errors import PlacementError
from mpp_taichi.walls._turning_law import TurningLaw

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
    turning      the surface turns about an axis, which moves along with it (TurningLaw); None where it does not
    friction     μ: a sphere that slides along the surface gets up to μ times the impulse along the normal against its sliding
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
    turning: TurningLaw | None = None
    friction: float = 0.0

    @property
    def laws(self) -> tuple[Any, ...]:
        """The laws (PathLaw) by which the surface moves and turns."""
        found = (self.motion, None if self.turning is None else self.turning.angle)
        return tuple(law for law in found if law is not None)

    @property
    def has_motion(self) -> bool:
        """Whether the surface moves as a formula says."""
        return self.motion is not None

    @property
    def moves(self) -> bool:
        """Whether the surface moves at some time."""
        return any(self.velocity) or self.motion is not None or self.turning is not None

    @property
    def has_turning(self) -> bool:
        """Whether the surface turns."""
        return self.turning is not None

    @property
    def is_carried(self) -> bool:
        """Whether turning moves the surface to another place, as it does unless the surface looks the same from its axis."""
        if self.turning is None:
            return False
        small, axis = 1e-12, self.turning.axis
        is_parallel = float(np.linalg.norm(np.cross(axis, self.direction))) <= small
        is_centered = float(self.turning.distance(np.array(self.point))) <= small * (self.radius or 1.0)
        looks_same = {"plane": is_parallel, "cylinder": is_parallel and is_centered, "sphere": is_centered, "segment": False}
        return not looks_same[self.kind]

    def shift_at(self, time: float) -> np.ndarray:
        """How far the surface is from `point` at a time, (3,) [length]."""
        found = np.multiply(self.velocity, time)
        return found if self.motion is None else found + self.motion.at(time)[0]

    def carried(self, points: np.ndarray, time: float) -> np.ndarray:
        """Where points of the surface, given when the time is 0, are at a time, (…, 3) [length]."""
        if self.turning is None:
            return points + self.shift_at(time)
        about = np.asarray(self.turning.about)
        return about + (points - about) @ self.turning.matrix(time).T + self.shift_at(time)

    def brought_back(self, places: np.ndarray, time: float) -> np.ndarray:
        """The points that `carried` brings to these places at a time, (…, 3) [length]."""
        if self.turning is None:
            return places - self.shift_at(time)
        about = np.asarray(self.turning.about)
        return about + (places - about - self.shift_at(time)) @ self.turning.matrix(time)

    def speed_at(self, time: float, places: np.ndarray) -> np.ndarray:
        """At most so fast is the part of the surface beside each of some places (n, 3) at a time, (n,) [length / time]."""
        speed = float(np.linalg.norm(self.velocity if self.motion is None else self.motion.at(time)[1]))
        if self.turning is None:
            return np.full(len(places), speed)
        return speed + abs(self.turning.rate(time)) * self.turning.distance(places - self.shift_at(time))

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


def turning_law(given: Any) -> TurningLaw | None:
    """The law of a turning as a scene gives it (Turning); None where there is none."""
    if given is None:
        return None
    from mpp_taichi.scene.formulas.path_law import path_law  # with SymPy, only where a wall turns

    return TurningLaw(path_law((given.angle,)), given.about, unit_vector(given.axis, "axis of turning"))


def unit_vector(vector: Vector, name: str) -> Vector:
    """The direction of a vector; PlacementError where it has none."""
    largest = max(map(abs, vector))
    if not largest > 0.0:
        raise PlacementError(f"{name} must not be [0, 0, 0]")
    scaled = [component / largest for component in vector]  # squares of tiny or huge components stay numbers
    length = math.hypot(*scaled)
    return (scaled[0] / length, scaled[1] / length, scaled[2] / length)


def segment(begin: Vector, end: Vector, *, velocity: Vector, restitution: float, label: str, **more: Any) -> Surface:
    """The segment between two points of the x–y plane; PlacementError where they are one point. `more`: see Surface."""
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
        **more,
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


def check_surfaces(surfaces: Sequence[Surface]) -> None:
    """PlacementError where a turning or a friction has no meaning for the surfaces of a wall."""
    if any(surface.friction > 0.0 and surface.is_thermal for surface in surfaces):
        raise PlacementError("has a friction beside a temperature, leave one of them out: the temperature draws the velocity")
    turning = [surface for surface in surfaces if surface.turning is not None]
    if any(surface.kind == "segment" and surface.turning and any(surface.turning.axis[:2]) for surface in turning):
        told = "turns about an axis that is not along z, but it is a strip along z"
        raise PlacementError(f"{told}: only axis: [0, 0, 1] is allowed")
    if turning and not any(surface.is_carried or surface.friction > 0.0 for surface in turning):
        told = "looks the same from the axis about which it turns, and without a friction nothing feels the turning"
        raise PlacementError(f"{told}: give it a friction, or leave turning out")
