"""Marks: arrows of velocities, axes and a grid, as lines and letters in the scene. NumPy only."""

import math
from dataclasses import dataclass

import numpy as np

from mpp_taichi.scene.view_spec import ViewSpec
from mpp_taichi.views._base import Frame
from mpp_taichi.views.camera import Camera
from mpp_taichi.views.caption import is_light

ARROW_SHARE = 0.14  # of the picture's height: the longest arrow of the first picture
HEAD_SHARE, HEAD_LIMIT = 0.3, 0.02  # of the arrow, and at most of the picture's height
HEAD_SLOPE = 0.45  # half the width of a head over its length
GRID_SHARE = 0.125  # of the picture's height: the spacing of a grid, before it is rounded
AXIS_SHARE = 0.3
AXIS_WIDTH, GRID_WIDTH = 2.0, 1.0  # pixels of a picture of 720 rows
AXIS_COLORS = np.array([[0.90, 0.35, 0.30], [0.35, 0.75, 0.40], [0.40, 0.60, 0.95]])
GRID_LIGHTNESS = 0.25  # how far the grid's colour is from the background to white, or to black on a light one


Label = tuple[str, np.ndarray, np.ndarray]
"""A text in the scene, its place [length] and its colour in 0…1."""


@dataclass(frozen=True, eq=False)
class Segments:
    """Lines: ends [length], shape (count, 2, 3); colours as displayed, (count, 3); widths in pixels at 720 rows, (count,)."""

    ends: np.ndarray
    color: np.ndarray
    width: np.ndarray

    @staticmethod
    def of(ends: np.ndarray, color: object, width: float) -> "Segments":
        """Lines of one width."""
        count = len(ends)
        return Segments(ends, np.broadcast_to(np.asarray(color, dtype=float), (count, 3)), np.full(count, width))

    @staticmethod
    def joined(parts: "list[Segments]") -> "Segments":
        """All lines of the parts."""
        parts = [Segments.of(np.zeros((0, 2, 3)), (1.0, 1.0, 1.0), 1.0), *parts]
        return Segments(*(np.concatenate([getattr(part, key) for part in parts]) for key in ("ends", "color", "width")))


class Marks:
    """The marks of one view; lengths that the scene leaves open are chosen for the first picture and then kept."""

    def __init__(self, spec: ViewSpec, dimensions: int) -> None:
        """Nothing is chosen yet."""
        self.spec, self.dimensions = spec, dimensions
        self.labels: list[Label] = []
        self._arrow_time = spec.arrows.time if spec.arrows is not None else None
        self._spacing = spec.grid.spacing if spec.grid is not None else None
        self._axis = spec.axes.length if spec.axes is not None else None
        self._middle: np.ndarray | None = None

    def segments(self, frame: Frame, camera: Camera) -> Segments:
        """The lines for a dressed frame; sets `labels`."""
        self.labels = []
        parts = []
        if self.spec.grid is not None:
            parts.append(self._grid(camera))
        if self.spec.axes is not None:
            parts.append(self._axes(camera))
        if self.spec.arrows is not None and frame.velocity is not None:
            parts.append(self._arrows(frame, camera))
        return Segments.joined(parts)

    def lines(self) -> list[str]:
        """What the legend says of lengths."""
        told = []
        if self.spec.arrows is not None and self._arrow_time is not None:
            told.append(f"arrows: velocity × {self._arrow_time:g}")
        if self.spec.grid is not None and self._spacing is not None:
            told.append(f"grid: {self._spacing:g}")
        return told

    def _arrows(self, frame: Frame, camera: Camera) -> Segments:
        spec, velocity = self.spec.arrows, np.asarray(frame.velocity, dtype=float)
        assert spec is not None
        chosen = np.zeros(len(velocity), dtype=bool)
        for first, count in spec.of if spec.of is not None else ((0, len(velocity)),):
            chosen[first : first + count] = True
        chosen &= np.isfinite(velocity).all(axis=1) & np.isfinite(frame.position).all(axis=1)
        start, velocity = frame.position[chosen], velocity[chosen]
        speed = np.linalg.norm(velocity, axis=1)
        if self._arrow_time is None:
            fastest = float(speed.max()) if len(speed) else 0.0
            if fastest == 0.0:
                return Segments.joined([])
            self._arrow_time = round_number(ARROW_SHARE * camera.visible_height / fastest)
        way = self._arrow_time * velocity
        moving = speed > 0.0
        start, way, length = start[moving], way[moving], self._arrow_time * speed[moving]
        along = way / length[:, None]
        head = np.minimum(HEAD_SHARE * length, HEAD_LIMIT * camera.visible_height)[:, None]
        aside = np.cross(along, camera.backward)
        aside /= np.maximum(np.linalg.norm(aside, axis=1), 1e-12)[:, None]
        tip = start + way
        barbs = [tip - head * (along + side * HEAD_SLOPE * aside) for side in (-1.0, 1.0)]
        ends = np.stack([np.stack([start, tip], axis=1), *(np.stack([tip, barb], axis=1) for barb in barbs)])
        return Segments.of(ends.reshape(-1, 2, 3), spec.color, spec.width)

    def _axes(self, camera: Camera) -> Segments:
        spec = self.spec.axes
        assert spec is not None
        if self._axis is None:
            self._axis = round_number(AXIS_SHARE * camera.visible_height)
        origin = np.array(spec.origin, dtype=float)
        count = self.dimensions
        tips = origin + self._axis * np.eye(3)[:count]
        self.labels = [
            (letter, origin + 1.06 * (tip - origin), color) for letter, tip, color in zip("xyz", tips, AXIS_COLORS[:count])
        ]
        ends = np.stack([np.broadcast_to(origin, (count, 3)), tips], axis=1)
        return Segments(ends, AXIS_COLORS[:count], np.full(count, AXIS_WIDTH))

    def _grid(self, camera: Camera) -> Segments:
        spec = self.spec.grid
        assert spec is not None
        if self._spacing is None:
            self._spacing = round_number(GRID_SHARE * camera.visible_height)
        first, second = ("xyz".index(letter) for letter in spec.plane)
        if self._middle is None:  # on the grid, near what the camera looks at
            self._middle = np.round(camera.target / self._spacing) * self._spacing
            self._middle[3 - first - second] = spec.at
        offset = self._spacing * np.arange(-spec.lines, spec.lines + 1)
        ends = np.tile(self._middle, (2, len(offset), 2, 1))
        for lines, across, along in ((ends[0], first, second), (ends[1], second, first)):
            lines[:, :, across] += offset[:, None]
            lines[:, :, along] += self._spacing * spec.lines * np.array([-1.0, 1.0])
        background, goal = np.array(self.spec.background), 0.0 if is_light(self.spec.background) else 1.0
        return Segments.of(ends.reshape(-1, 2, 3), background + GRID_LIGHTNESS * (goal - background), GRID_WIDTH)


def round_number(value: float) -> float:
    """The nearest of 1, 2, 5 times a power of ten, for a value above 0."""
    power = 10.0 ** math.floor(math.log10(value))
    return min((1.0, 2.0, 5.0, 10.0), key=lambda digit: abs(math.log(value / (digit * power)))) * power
