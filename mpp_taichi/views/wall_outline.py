"""Outlines of walls, for pictures: segments, which follow moving walls. NumPy on the host."""

from dataclasses import dataclass, field

import numpy as np

from mpp_taichi import component
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.walls._base import Enclosure, Surface

CIRCLE = 72  # segments of a circle
TICKS = 12  # marks inside a circle that turns, without which its turning could not be seen
FULL_TURN = np.linspace(0.0, 2.0 * np.pi, CIRCLE + 1)


@dataclass(frozen=True, eq=False)
class Outline:
    """Segments at time 0, (m, 2, 3) [length], the velocity of each segment, (m, 3) [length / time], and the periodic box.

    `movers` are surfaces that move as formulas say, each with the first of the segments that it moves, and their number.
    """

    segments: np.ndarray
    velocity: np.ndarray
    repeating: Enclosure = field(default_factory=Enclosure)
    movers: tuple[tuple[Surface, int, int], ...] = ()

    def at(self, time: float) -> np.ndarray:
        """The segments at a time."""
        found = self.segments + time * self.velocity[:, None, :]
        for surface, first, count in self.movers:
            found[first : first + count] = surface.carried(self.segments[first : first + count], time)
        return found

    def inside(self, position: np.ndarray) -> np.ndarray:
        """Positions as they are drawn: of all periodic copies of a particle the copy within the box."""
        if not any(self.repeating.period):
            return position
        period, origin = np.array(self.repeating.period), np.array(self.repeating.origin)
        whole = np.where(period > 0.0, period, 1.0)
        return np.where(period > 0.0, origin + np.mod(position - origin, whole), position)


def outline_of(spec: SceneSpec, position: np.ndarray) -> Outline:
    """The outline of a checked scene; an infinite wall reaches as far as the particles' first places and the closed walls."""
    enclosures = [
        component.build("walls", wall.name, wall.parameters).enclosure(spec.dimensions, wall.name) for wall in spec.walls
    ]
    center, reach = _extent(enclosures, position)
    parts: list[tuple[np.ndarray, Surface | None]] = []
    for wall, enclosure in zip(spec.walls, enclosures, strict=True):
        if "lower" in wall.parameters:
            edges = _box(wall.parameters["lower"], wall.parameters["upper"], spec.dimensions)
            parts.append((edges, enclosure.surfaces[0] if enclosure.surfaces else None))
        else:
            parts += [(_surface(each, center, reach, spec.dimensions), each) for each in enclosure.surfaces]
    segments = [part for part, _ in parts]
    firsts = np.cumsum([0, *(len(part) for part in segments)])
    movers = [
        (surface, int(first), len(part))
        for (part, surface), first in zip(parts, firsts)
        if surface is not None and (surface.has_motion or surface.has_turning)
    ]
    still = (0.0, 0.0, 0.0)
    velocity = [np.tile(still if surface is None else surface.velocity, (len(part), 1)) for part, surface in parts]
    repeating = next((each for each in enclosures if any(each.period)), Enclosure())
    lines, speeds = np.concatenate([np.zeros((0, 2, 3)), *segments]), np.concatenate([np.zeros((0, 3)), *velocity])
    return Outline(lines, speeds, repeating, tuple(movers))


def _extent(enclosures: list[Enclosure], position: np.ndarray) -> tuple[np.ndarray, float]:
    """Middle of the scene, and its half extent along each axis."""
    corners = [position]
    for enclosure in enclosures:
        for surface in enclosure.surfaces:
            if surface.kind == "plane":
                corners.append(np.array([surface.point]))
            elif surface.kind == "segment":
                corners.append(np.array([surface.point, surface.end]))
            elif surface.inside:
                corners += [np.add(surface.point, [surface.radius]), np.subtract(surface.point, [surface.radius])]
    points = np.concatenate([np.atleast_2d(each) for each in corners])
    low, high = points.min(axis=0), points.max(axis=0)
    return (low + high) / 2.0, float(np.linalg.norm(high - low)) / 2.0 or 1.0


def _box(lower: tuple[float, ...], upper: tuple[float, ...], dimensions: int) -> np.ndarray:
    """Twelve edges; four in the plane."""
    corner = np.array([lower, upper])
    edges = []
    for axis in range(dimensions):
        others = [k for k in range(dimensions) if k != axis]
        for choice in np.ndindex(*(2,) * len(others)):
            edge = np.tile(corner[0], (2, 1))
            edge[:, axis] = corner[:, axis]
            for k, side in zip(others, choice, strict=True):
                edge[:, k] = corner[side, k]
            edges.append(edge)
    return np.array(edges)


def _surface(surface: Surface, center: np.ndarray, reach: float, dimensions: int) -> np.ndarray:
    point, direction = np.array(surface.point), np.array(surface.direction)
    if surface.kind == "plane":
        foot = center - ((center - point) @ direction) * direction
        if dimensions == 2:
            along = reach * np.array([-direction[1], direction[0], 0.0])
            return np.array([[foot - along, foot + along]])
        first, second = _across(direction)
        corners = np.array([foot + reach * (a * first + b * second) for a, b in ((1, 1), (1, -1), (-1, -1), (-1, 1), (1, 1))])
        return np.stack([corners[:-1], corners[1:]], axis=1)
    if surface.kind == "segment":
        return _strip(np.array([surface.point, surface.end]), center, reach, dimensions)
    if dimensions == 2:
        return _circle(point, np.eye(3)[0], np.eye(3)[1], surface.radius, ticks=surface.has_turning)
    if surface.kind == "sphere":
        rings = [(0, 1), (1, 2), (2, 0)]
        ticks = surface.has_turning
        return np.concatenate([_circle(point, np.eye(3)[a], np.eye(3)[b], surface.radius, ticks=ticks) for a, b in rings])
    first, second = _across(direction)
    middle = point + ((center - point) @ direction) * direction
    ends = [middle + side * reach * direction for side in (-1.0, 1.0)]
    rims = [surface.radius * each for each in (first, second, -first, -second)]
    sides = np.array([[ends[0] + rim, ends[1] + rim] for rim in rims])
    circles = (_circle(end, first, second, surface.radius, ticks=surface.has_turning) for end in ends)
    return np.concatenate([*circles, sides])


def _strip(ends: np.ndarray, center: np.ndarray, reach: float, dimensions: int) -> np.ndarray:
    """A segment; in space the four sides of a strip along z that is as high as the scene."""
    if dimensions == 2:
        return ends[None]
    low, high = (ends + np.array([0.0, 0.0, center[2] + side * reach]) for side in (-1.0, 1.0))
    corners = np.array([low[0], low[1], high[1], high[0], low[0]])
    return np.stack([corners[:-1], corners[1:]], axis=1)


def _circle(center: np.ndarray, first: np.ndarray, second: np.ndarray, radius: float, *, ticks: bool) -> np.ndarray:
    points = center + radius * (np.outer(np.cos(FULL_TURN), first) + np.outer(np.sin(FULL_TURN), second))
    edges = np.stack([points[:-1], points[1:]], axis=1)
    if not ticks:
        return edges
    rim = points[: -1 : CIRCLE // TICKS]
    return np.concatenate([edges, np.stack([center + 0.94 * (rim - center), rim], axis=1)])


def _across(direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors at right angles to a direction and to each other."""
    first = np.cross(direction, np.eye(3)[int(np.argmin(np.abs(direction)))])
    first /= np.linalg.norm(first)
    return first, np.cross(direction, first)
