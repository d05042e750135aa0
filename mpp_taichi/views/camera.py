"""Orbit camera: where the picture is taken from, and how a mouse moves it. NumPy only, float64."""

import math
from collections.abc import Sequence

import numpy as np

from mpp_taichi.scene.spec import CameraSpec
from mpp_taichi.views._base import Frame

MARGIN = 1.12  # room left around the scene when it is framed
FLAT = 1.0e-3  # an axis whose extent is below this share of the largest one counts as flat
HORIZON = 1.0e100  # scene lengths; a particle farther away, or at NaN, is lost
POLE = math.radians(89.0)  # a turntable never quite looks along its own axis
AXIS_VIEWS = {
    "x": ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
    "y": ((0.0, -1.0, 0.0), (0.0, 0.0, 1.0)),
    "z": ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0)),
}
"""For each axis view: the direction from the target to the camera, and the direction that is up."""
THREE_QUARTER_VIEW = ((0.55, -0.75, 0.45), (0.0, 0.0, 1.0))


class Camera:
    """A turntable around `target`: `backward` points from the target to the camera, `axis` is the axis of rotation.

    Camera coordinates are (right, up, depth), the depth growing away from the viewer [length].
    """

    def __init__(self, spec: CameraSpec, frame: Frame, *, aspect: float, dimensions: int = 3) -> None:
        """Take the settings of the spec, and choose the others so that every particle of the frame is in view."""
        self.field_of_view = spec.field_of_view
        self.orthographic = spec.projection == "orthographic"
        backward, axis = default_view(frame, dimensions)
        center, _ = bounds(frame)
        self.target = np.array(center if spec.look_at is None else spec.look_at, dtype=float)
        self.distance = 1.0
        self.height = 1.0
        if spec.position is not None:
            offset = np.array(spec.position, dtype=float) - self.target
            self.distance = float(np.linalg.norm(offset)) or 1.0
            backward = tuple(offset / self.distance) if offset.any() else backward
        self.turn_to(backward, axis if spec.up is None else spec.up)
        if spec.position is None:
            self._fit(frame, aspect)
        else:
            self.height = 2.0 * self.distance * math.tan(math.radians(self.field_of_view) / 2.0)
        if spec.height is not None:
            self.height = spec.height
        self._start = (self.target.copy(), self.backward, self.axis, self.distance, self.height)

    @property
    def position(self) -> np.ndarray:
        """Position of the camera [length], shape (3,)."""
        return self.target + self.distance * self.backward

    @property
    def right(self) -> np.ndarray:
        """Unit vector to the right of the picture."""
        right = _cross(self.axis, self.backward)
        return right / np.linalg.norm(right)

    @property
    def up(self) -> np.ndarray:
        """Unit vector to the top of the picture."""
        return _cross(self.backward, self.right)

    @property
    def visible_height(self) -> float:
        """Height of the picture at the depth of the target [length]."""
        if self.orthographic:
            return self.height
        return 2.0 * self.distance * math.tan(math.radians(self.field_of_view) / 2.0)

    def view(self, points: np.ndarray) -> np.ndarray:
        """Camera coordinates (right, up, depth) of points of shape (…, 3)."""
        offset = np.asarray(points, dtype=float) - self.target
        with np.errstate(over="ignore", invalid="ignore"):  # of a run that blew up, particles that are not finite are not drawn
            turned = offset @ np.stack([self.right, self.up, -self.backward], axis=1)
        turned[..., 2] += self.distance
        return turned

    def length_per_pixel(self, depth: np.ndarray, rows: int) -> np.ndarray:
        """Length that one pixel of a picture with this number of rows covers at a depth [length]."""
        if self.orthographic:
            return np.full_like(depth, self.height / rows)
        return np.maximum(depth, 0.0) * (2.0 * math.tan(math.radians(self.field_of_view) / 2.0) / rows)

    def drawn_radius(
        self, radius: np.ndarray, depth: np.ndarray, rows: int, *, scale: float, minimum_pixels: float
    ) -> np.ndarray:
        """Radius at which a sphere is drawn [length]: scaled, and at least the given number of pixels."""
        return np.maximum(radius * scale, minimum_pixels * self.length_per_pixel(depth, rows))

    def turn_to(self, backward: tuple[float, ...] | np.ndarray, axis: tuple[float, ...] | np.ndarray) -> None:
        """Look from `backward` with `axis` up; an axis along the line of sight is replaced by another."""
        self.backward = np.array(backward, dtype=float) / np.linalg.norm(backward)
        for candidate in (axis, (0.0, 0.0, 1.0), (0.0, 1.0, 0.0)):
            length = np.linalg.norm(candidate)
            if length > 0.0 and np.linalg.norm(_cross(candidate, self.backward)) > 1.0e-3 * length:
                self.axis = np.array(candidate, dtype=float) / length
                return

    def rotate(self, right: float, up: float) -> None:
        """Drag by shares of the picture's height: the scene follows the hand, half a turn per height."""
        azimuth = -math.pi * right
        cosine, sine = math.cos(azimuth), math.sin(azimuth)
        along = self.axis * (self.axis @ self.backward)
        backward = along + cosine * (self.backward - along) + sine * _cross(self.axis, self.backward)
        level = backward - along
        level /= np.linalg.norm(level)
        elevation = math.asin(float(np.clip(self.axis @ backward, -1.0, 1.0))) - math.pi * up
        elevation = min(max(elevation, -POLE), POLE)
        self.backward = math.cos(elevation) * level + math.sin(elevation) * self.axis

    def pan(self, right: float, up: float) -> None:
        """Drag by shares of the picture's height: the point under the hand at the target's depth stays under it."""
        self.target = self.target - self.visible_height * (right * self.right + up * self.up)

    def zoom(self, factor: float) -> None:
        """Make the picture larger by a factor."""
        self.distance /= factor
        self.height /= factor

    def turn_projection(self) -> None:
        """Change between perspective and orthographic; a length at the target's depth keeps its size in the picture."""
        if self.orthographic:
            self.distance = self.height / (2.0 * math.tan(math.radians(self.field_of_view) / 2.0))
        else:
            self.height = self.visible_height
        self.orthographic = not self.orthographic

    def reset(self) -> None:
        """Return the camera to its first position."""
        target, self.backward, self.axis, self.distance, self.height = self._start
        self.target = target.copy()

    def look_along(self, axis: str) -> None:
        """Look along the axis `x`, `y` or `z` from the same distance."""
        self.turn_to(*AXIS_VIEWS[axis])

    def frame_all(self, frame: Frame, aspect: float) -> None:
        """Aim at the middle of the scene and step back until every particle is in view."""
        self.target = bounds(frame)[0]
        self._fit(frame, aspect)

    def _fit(self, frame: Frame, aspect: float) -> None:
        if len(frame.outline):
            self._fit_walls(frame.outline.reshape(-1, 3), aspect)
            return
        center, reach = bounds(frame)
        reach = MARGIN * (reach + float(np.linalg.norm(center - self.target)))
        half_angle = math.radians(self.field_of_view) / 2.0
        narrow = min(half_angle, math.atan(aspect * math.tan(half_angle)))
        self.distance = reach / math.sin(narrow)
        self.height = 2.0 * reach / min(aspect, 1.0)

    def _fit_walls(self, corners: np.ndarray, aspect: float) -> None:
        """Walls keep the particles inside: no room is left around them, and the walls fill the picture."""
        offset = corners - self.target
        wide, high = np.abs(offset @ self.right) / aspect, np.abs(offset @ self.up)
        needed = MARGIN * np.maximum(wide, high)
        slope = math.tan(math.radians(self.field_of_view) / 2.0)
        self.distance = max(float((needed / slope + offset @ self.backward).max()), 1e-3 * float(np.abs(offset).max())) or 1.0
        self.height = 2.0 * float(needed.max()) or 1.0

    def as_yaml(self) -> str:
        """The `view:` entry of a scene that puts a camera at the present position."""

        def numbers(vector: np.ndarray) -> str:
            return "[" + ", ".join(f"{value:.6g}" for value in vector) + "]"

        lines = ["view:", "  camera:", f"    position: {numbers(self.position)}", f"    look_at: {numbers(self.target)}"]
        lines.append(f"    up: {numbers(self.axis)}")
        lines.append(f"    field_of_view: {self.field_of_view:.6g}")
        if self.orthographic:
            lines += ["    projection: orthographic", f"    height: {self.height:.6g}"]
        return "\n".join(lines) + "\n"


def bounds(frame: Frame) -> tuple[np.ndarray, float]:
    """Center and radius [length] of a sphere that holds every particle; lost particles do not count."""
    seen = (np.abs(frame.position) < HORIZON).all(axis=1)
    position, radius = np.asarray(frame.position)[seen], np.asarray(frame.radius)[seen]
    if len(frame.outline):
        corners = frame.outline.reshape(-1, 3)
        position, radius = np.concatenate([position, corners]), np.concatenate([radius, np.zeros(len(corners))])
    if len(position) == 0:
        return np.zeros(3), 1.0
    center = (position.min(axis=0) + position.max(axis=0)) / 2.0
    if frame.center is not None and not len(frame.outline) and np.isfinite(frame.center).all():
        center = np.array(frame.center, dtype=float)
    reach = float((np.linalg.norm(position - center, axis=1) + radius).max())
    if reach <= 2.0 * float(radius.max()):
        reach *= 3.0  # a single body: leave it room to move
    return center, reach or 1.0


def default_view(frame: Frame, dimensions: int) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Directions to the camera and up: face on when all particles lie and move in one plane, else from above at an angle."""
    flat = _flat(frame.position)
    if frame.velocity is not None:
        flat &= _flat(np.concatenate([frame.velocity, np.zeros((1, 3))]))
    if dimensions == 2 or flat[2]:
        return AXIS_VIEWS["z"]
    if flat[1]:
        return AXIS_VIEWS["y"]
    if flat[0]:
        return AXIS_VIEWS["x"]
    return THREE_QUARTER_VIEW


def _flat(vectors: np.ndarray) -> np.ndarray:
    """Along which axes the vectors do not differ, next to the axis along which they differ most; shape (3,)."""
    vectors = np.asarray(vectors)[np.isfinite(vectors).all(axis=1)]
    extent = np.ptp(vectors, axis=0) if len(vectors) else np.zeros(3)
    return np.asarray(extent <= FLAT * extent.max())


def _cross(a: Sequence[float] | np.ndarray, b: np.ndarray) -> np.ndarray:
    """a × b of two vectors; NumPy's function, made for any shape, takes 40 µs."""
    (a0, a1, a2), (b0, b1, b2) = map(float, a), b.tolist()
    return np.array([a1 * b2 - a2 * b1, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0])
