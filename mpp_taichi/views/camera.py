"""Orbit camera: where the picture is taken from, and how a mouse moves it. NumPy only, float64."""

import math
from collections.abc import Sequence

import numpy as np

from mpp_taichi.scene.spec import CameraSpec
from mpp_taichi.views._base import Frame

MARGIN = 1.12  # room left around the scene when it is framed
AIMS = 6  # corrections of the target: each leaves a small part of the error, which a perspective makes
FAR_OUT = 3.0  # times the reach of nine tenths of the particles: a particle that goes farther is not framed
MANY = 10  # particles, from which on a few of them may leave the picture
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
            self._fit(frame, aspect, aims=spec.look_at is None)
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

    def _fit(self, frame: Frame, aspect: float, *, aims: bool = False) -> None:
        """Step back until all is in view; `aims` moves the target to the middle of a motion as well."""
        if len(frame.outline):
            self._fit_walls(frame.outline.reshape(-1, 3), aspect)
            return
        if frame.motion is not None and len(places := _framed(frame.motion, len(frame.position))):
            self._fit_motion(places, aspect, aims=aims)
            return
        center, reach = bounds(frame)
        reach = MARGIN * (reach + float(np.linalg.norm(center - self.target)))
        half_angle = math.radians(self.field_of_view) / 2.0
        narrow = min(half_angle, math.atan(aspect * math.tan(half_angle)))
        self.distance = reach / math.sin(narrow)
        self.height = 2.0 * reach / min(aspect, 1.0)

    def _fit_motion(self, places: np.ndarray, aspect: float, *, aims: bool) -> None:
        """Fill the picture with spheres of given centres and radii, (count, 4)."""
        slope = math.tan(math.radians(self.field_of_view) / 2.0)
        for _ in range(AIMS if aims else 1):
            offset, room = places[:, :3] - self.target, places[:, 3]
            wide, high, near = offset @ self.right, offset @ self.up, offset @ self.backward
            needed = MARGIN * np.maximum((np.abs(wide) + room) / aspect, np.abs(high) + room)
            self.distance = float(np.max(needed / slope + near + room)) or 1.0
            self.height = 2.0 * float(needed.max()) or 1.0
            if aims:
                scale = 1.0 if self.orthographic else self.distance / (self.distance - near)
                middle = [0.5 * (np.max(scale * (way + room)) + np.min(scale * (way - room))) for way in (wide, high)]
                self.target = self.target + middle[0] * self.right + middle[1] * self.up

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


def _framed(motion: np.ndarray, count: int) -> np.ndarray:
    """The places of a motion that a picture shall show, (places, 4); of many particles without the few that fly far away."""
    with np.errstate(invalid="ignore"):
        seen = (np.abs(motion[:, :3]) < HORIZON).all(axis=1)
    if count >= MANY and len(motion) % count == 0 and seen.any():
        middle = np.median(motion[seen, :3], axis=0)
        away = np.where(seen, np.linalg.norm(np.where(seen[:, None], motion[:, :3], middle) - middle, axis=1), 0.0)
        farthest = away.reshape(-1, count).max(axis=0)
        seen &= np.tile(farthest <= FAR_OUT * np.quantile(farthest, 0.9), len(motion) // count)
    return motion[seen]


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
