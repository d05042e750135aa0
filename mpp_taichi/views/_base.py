"""The interface of every view: it takes a `Frame` and gives a picture or a window."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from mpp_taichi.snapshot import Snapshot
from mpp_taichi.views.wall_outline import Outline

WALL_COLOR = (0.45, 0.47, 0.55)
WALL_WIDTH = 1.5  # pixels of a picture of 720 rows


@dataclass(frozen=True, eq=False)
class Frame:
    """One moment of a scene as a view draws it; plain host arrays, so that no view knows a simulation or a device.

    position     [length], shape (particle_count, 3); NaN for a particle that has merged into another
    radius       [length], shape (particle_count,)
    color        red, green, blue in 0…1 as displayed (sRGB), shape (particle_count, 3)
    between      particle indices of the two ends of each spring, and after them of each rod, shape (spring_count, 2)
    spring_color as `color`, shape (spring_count, 3)
    center       point at which a camera without a target is directed [length]; the middle of the bounding box when None
    velocity     [length / time], shape (particle_count, 3); shows a camera without a position in which plane particles move
    ahead        time by which the positions are later than the velocities [time]
    path_index, path_time, path   moments of some particles since the last frame, for trails: indices (count,), times
                 (moments,), positions and velocities (moments, count, 6); None where the frames themselves are enough
    collides     whether velocities may jump between two frames, as in collisions
    period       of a box that repeats along each axis [length], 0 where it does not
    motion       places of all particles during the whole run, with their radii, (moments · particle_count, 4), which a camera
                 without a position frames; None where they are unknown
    acceleration [length / time²], shape (particle_count, 3); None where no view asks for it
    clock        the time as the caption shows it, `19.3 d`; empty for the bare number
    units        names of the units of length, time and mass; None where the scene has none
    extra        one more line of caption, such as the energy error
    dimmed       drawn with less contrast, as positions have lost their meaning
    outline      segments of walls [length], shape (count, 2, 3)
    mass, charge, name   of the particles, shape (particle_count,); None, or no names, where they are unknown
    rest_length, stiffness   of the springs, of a rod its length and infinity; shape (spring_count,), None where unknown
    """

    position: np.ndarray
    radius: np.ndarray
    color: np.ndarray
    between: np.ndarray = field(default_factory=lambda: np.zeros((0, 2), np.int32))
    spring_color: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    time: float = 0.0
    title: str = ""
    clock: str = ""
    units: Mapping[str, str] | None = None
    extra: str = ""
    dimmed: bool = False
    center: tuple[float, float, float] | None = None
    velocity: np.ndarray | None = None
    ahead: float = 0.0
    path_index: np.ndarray | None = None
    path_time: np.ndarray | None = None
    path: np.ndarray | None = None
    collides: bool = False
    period: tuple[float, float, float] = (0.0, 0.0, 0.0)
    motion: np.ndarray | None = None
    acceleration: np.ndarray | None = None
    outline: np.ndarray = field(default_factory=lambda: np.zeros((0, 2, 3)))
    mass: np.ndarray | None = None
    charge: np.ndarray | None = None
    rest_length: np.ndarray | None = None
    stiffness: np.ndarray | None = None
    name: tuple[str, ...] = ()

    @staticmethod
    def of(
        snapshot: Snapshot,
        *,
        title: str = "",
        clock: str = "",
        units: Mapping[str, str] | None = None,
        extra: str = "",
        walls: Outline | None = None,
        collides: bool = False,
        acceleration: np.ndarray | None = None,
    ) -> "Frame":
        """The frame of a snapshot; its center is the center of mass, which orbits stay around."""
        mass = np.maximum(snapshot.mass, 0.0)
        center = None
        if mass.sum() > 0.0:
            x, y, z = mass @ snapshot.position / mass.sum()
            center = (float(x), float(y), float(z))
        springs, rods = snapshot.springs, snapshot.rods
        springs = springs.chosen(springs.whole) if springs.have_limits else springs
        place = snapshot.position if walls is None else walls.inside(snapshot.position)
        if not snapshot.present.all():
            place = np.where(snapshot.present[:, None], place, np.nan)
        return Frame(
            position=place,
            radius=snapshot.radius,
            color=snapshot.color,
            between=np.concatenate([springs.between, rods.between]) if len(rods) else springs.between,
            spring_color=np.concatenate([springs.color, rods.color]) if len(rods) else springs.color,
            time=snapshot.time,
            title=title,
            clock=clock,
            units=units,
            extra=extra,
            center=center,
            velocity=snapshot.velocity,
            collides=collides or (walls is not None and len(walls.segments) > 0),
            period=(0.0, 0.0, 0.0) if walls is None else walls.repeating.period,
            acceleration=acceleration,
            outline=np.zeros((0, 2, 3)) if walls is None else walls.at(snapshot.time),
            mass=snapshot.mass,
            charge=snapshot.charge,
            rest_length=np.concatenate([springs.rest_length, rods.length]) if len(rods) else springs.rest_length,
            stiffness=np.concatenate([springs.stiffness, np.full(len(rods), np.inf)]) if len(rods) else springs.stiffness,
            name=snapshot.name,
        )


class View(ABC):
    """Draws frames into pictures. The one interface a replacement of GGUI has to meet."""

    @abstractmethod
    def draw(self, frame: Frame) -> np.ndarray:
        """The picture of a frame: red, green, blue as uint8, shape (height, width, 3), first row on top."""

    @abstractmethod
    def close(self) -> None:
        """Release the resources of the view; harmless when called twice."""
