"""Marks: arrows of velocities, accelerations and forces, axes and a grid, as lines and letters in the scene. NumPy only."""

import math
from dataclasses import dataclass

import numpy as np

from mpp_taichi.scene.human_units import symbol
from mpp_taichi.scene.view_spec import ViewSpec
from mpp_taichi.views._base import Frame
from mpp_taichi.views.camera import Camera
from mpp_taichi.views.caption import is_light
from mpp_taichi.views.coloring import GroupKey

ARROW_SHARE = 0.14  # of the picture's height: the longest arrow of the first picture
HEAD_SHARE, HEAD_LIMIT = 0.3, 0.02  # of the arrow, and at most of the picture's height
ARROW_COLORS = {"velocity": (0.95, 0.95, 0.95), "acceleration": (1.0, 0.62, 0.2), "force": (1.0, 0.35, 0.3)}
HEAD_SLOPE = 0.45  # half the width of a head over its length
ARROWS = "arrows"
GRID_SHARE = 0.125  # of the picture's height: the spacing of a grid, before it is rounded
AXIS_SHARE = 0.3
AXIS_WIDTH, GRID_WIDTH = 2.0, 1.0  # pixels of a picture of 720 rows
AXIS_COLORS = np.array([[0.90, 0.35, 0.30], [0.35, 0.75, 0.40], [0.40, 0.60, 0.95]])
GRID_LIGHTNESS = 0.25  # share of white in the grid's colour, or of black on a light background


Label = tuple[str, np.ndarray, np.ndarray]
"""A text in the scene with its place [length] and its colour in 0…1."""


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

    MADE_ANEW = ("labels", "_unit")  # for `archive.object_state`: they are of the last picture

    def __init__(self, spec: ViewSpec, dimensions: int) -> None:
        """No length is chosen yet."""
        self.spec, self.dimensions = spec, dimensions
        self.labels: list[Label] = []
        self._scales = [arrows.length_per_quantity for arrows in spec.arrows]
        self._spacing = spec.grid.spacing if spec.grid is not None else None
        self._axis = spec.axes.length if spec.axes is not None else None
        self._unit = ""  # of lengths
        self._middle: np.ndarray | None = None

    def segments(self, frame: Frame, camera: Camera) -> Segments:
        """The lines for a prepared frame; sets `labels`."""
        self.labels = []
        self._unit = f" {symbol(frame.units['length'])}" if frame.units else ""
        parts = []
        if self.spec.grid is not None:
            parts.append(self._grid(camera))
        if self.spec.axes is not None:
            parts.append(self._axes(camera))
        for number, arrows in enumerate(self.spec.arrows):
            if (vectors := _vectors(arrows.quantity, frame)) is not None:
                parts.append(self._arrows(number, frame, vectors, camera))
        return Segments.joined(parts)

    def lines(self) -> list[str]:
        """Lines of the legend about lengths."""
        told = [f"arrows: {text}" for text, _ in self._told_arrows()] if len(self.spec.arrows) == 1 else []
        if self.spec.grid is not None and self._spacing is not None:
            told.append(f"grid: {self._spacing:g}{self._unit}")
        return told

    def arrow_key(self) -> GroupKey | None:
        """The colours of several kinds of arrows, once their scales are known; None for a single kind."""
        told = self._told_arrows()
        if len(self.spec.arrows) < 2 or not told:
            return None
        return GroupKey(tuple(text for text, _ in told), np.array([color for _, color in told]), ARROWS)

    def _told_arrows(self) -> list[tuple[str, tuple[float, float, float]]]:
        """The text of each kind of arrows with its colour."""
        return [
            (f"{arrows.quantity} × {scale:g}", arrows.color or ARROW_COLORS[arrows.quantity])
            for arrows, scale in zip(self.spec.arrows, self._scales, strict=True)
            if scale is not None
        ]

    def _arrows(self, number: int, frame: Frame, vectors: np.ndarray, camera: Camera) -> Segments:
        spec = self.spec.arrows[number]
        chosen = np.zeros(len(vectors), dtype=bool)
        for first, count in spec.of if spec.of is not None else ((0, len(vectors)),):
            chosen[first : first + count] = True
        chosen &= np.isfinite(vectors).all(axis=1) & np.isfinite(frame.position).all(axis=1)
        start, vectors = frame.position[chosen], vectors[chosen]
        size = np.linalg.norm(vectors, axis=1)
        scale = self._scales[number]
        if scale is None:
            largest = float(size.max()) if len(size) else 0.0
            if largest == 0.0:
                return Segments.joined([])
            scale = self._scales[number] = round_number(ARROW_SHARE * camera.visible_height / largest)
        there = size > 0.0
        start, way, length = start[there], scale * vectors[there], scale * size[there]
        along = way / length[:, None]
        head = np.minimum(HEAD_SHARE * length, HEAD_LIMIT * camera.visible_height)[:, None]
        aside = np.cross(along, camera.backward)
        aside /= np.maximum(np.linalg.norm(aside, axis=1), 1e-12)[:, None]
        tip = start + way
        barbs = [tip - head * (along + side * HEAD_SLOPE * aside) for side in (-1.0, 1.0)]
        ends = np.stack([np.stack([start, tip], axis=1), *(np.stack([tip, barb], axis=1) for barb in barbs)])
        return Segments.of(ends.reshape(-1, 2, 3), spec.color or ARROW_COLORS[spec.quantity], spec.width)

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
        if self._middle is None:  # on the grid, near the camera's target
            self._middle = np.round(camera.target / self._spacing) * self._spacing
            self._middle[3 - first - second] = spec.at
        offset = self._spacing * np.arange(-spec.lines, spec.lines + 1)
        ends = np.tile(self._middle, (2, len(offset), 2, 1))
        for lines, across, along in ((ends[0], first, second), (ends[1], second, first)):
            lines[:, :, across] += offset[:, None]
            lines[:, :, along] += self._spacing * spec.lines * np.array([-1.0, 1.0])
        background, goal = np.array(self.spec.background), 0.0 if is_light(self.spec.background) else 1.0
        return Segments.of(ends.reshape(-1, 2, 3), background + GRID_LIGHTNESS * (goal - background), GRID_WIDTH)


def _vectors(quantity: str, frame: Frame) -> np.ndarray | None:
    """The vectors that arrows show, shape (particle_count, 3); None where the frame does not hold them."""
    found = frame.velocity if quantity == "velocity" else frame.acceleration
    if found is None or (quantity == "force" and frame.mass is None):
        return None
    found = np.asarray(found, dtype=float)
    return np.asarray(frame.mass)[:, None] * found if quantity == "force" else found


def round_number(value: float) -> float:
    """The nearest of 1, 2, 5 times a power of ten, for a value above 0."""
    power = 10.0 ** math.floor(math.log10(value))
    return min((1.0, 2.0, 5.0, 10.0), key=lambda digit: abs(math.log(value / (digit * power)))) * power
