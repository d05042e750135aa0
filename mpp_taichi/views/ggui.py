"""Drawing with GGUI, Taichi's Vulkan window system: into a window, or into a picture without one.

GGUI needs a Vulkan driver whatever backend computes (Mesa's lavapipe, in software, will do), and for a window a display.
`ggui_probe` says whether it works.
"""

from collections.abc import Callable

import numpy as np
import taichi as ti

from mpp_taichi.scene.spec import ViewSpec
from mpp_taichi.views._base import WALL_COLOR, WALL_WIDTH, Frame, View
from mpp_taichi.views.appearance import Appearance
from mpp_taichi.views.camera import Camera
from mpp_taichi.views.caption import draw_caption
from mpp_taichi.views.dimming import dim
from mpp_taichi.views.ggui_folder import ggui_folder
from mpp_taichi.views.ggui_probe import require_ggui
from mpp_taichi.views.legend import draw_labels, draw_legend
from mpp_taichi.views.overlay import draw_overlay
from mpp_taichi.views.trails import DrawnTrails, Trails

LIGHT = (-0.75, 1.0, 1.1)  # right, up, towards the viewer, in camera distances from the target
NEAR, FAR = 1.0e-3, 1.0e3  # in camera distances
TRAIL_WIDTH = 1.5  # pixels
TRAIL_TOLERANCE = 0.25  # pixels between a trail and the curve that it follows
THINNEST = 1.0  # pixels; GGUI does not smooth edges, and draws only some pixels of a thinner line


class GguiScene:
    """Puts frames into the scene of one GGUI window. It holds fields, so it is valid until the next `ti.init`.

    Everything is handed over relative to the camera's target and in camera distances, which keeps single precision enough
    at any place and scale.
    """

    def __init__(self, window: "ti.ui.Window", spec: ViewSpec, *, dimensions: int = 3) -> None:
        """Make the objects of GGUI that need no frame."""
        ti.set_logging_level(ti.ERROR)  # GGUI logs every picture read back, and warns of its own kernels under f64
        self._window, self._spec = window, spec
        self._canvas, self._scene = window.get_canvas(), window.get_scene()
        self._camera = ti.ui.Camera()
        self._particles = _PointBuffer(with_radius=True)
        self._lines: dict[float, _PointBuffer] = {}
        self.appearance = Appearance(spec, dimensions)
        self.shift = (0.0, 0.0)  # of the picture to the right and up, in halves of its height
        self._canvas.set_background_color(tuple(spec.background))

    def draw(self, frame: Frame, camera: Camera, trails: DrawnTrails | None) -> None:
        """Draw a prepared frame on the window's canvas; the caller shows the canvas or reads it back."""
        width, height = self._window.get_window_shape()
        self._place(camera, width / height)
        light = LIGHT[0] * camera.right + LIGHT[1] * camera.up + LIGHT[2] * camera.backward
        self._scene.ambient_light((0.25, 0.25, 0.25))
        self._scene.point_light(tuple(light.tolist()), (0.85, 0.85, 0.85))
        count = self._particles.put(
            self._placed(frame.position, camera), frame.color, self._point_size(frame, camera, width, height)
        )
        if count > 0:
            points = self._particles
            self._scene.particles(
                points.position, radius=1.0, per_vertex_color=points.color, per_vertex_radius=points.radius, index_count=count
            )
        thickness = height / 720.0
        springs = np.asarray(frame.position)[np.asarray(frame.between, dtype=np.int64)].reshape(-1, 3)
        self._draw_lines(springs, np.repeat(frame.spring_color, 2, axis=0), self._spec.spring_width * thickness, camera)
        walls = frame.outline.reshape(-1, 3)
        self._draw_lines(walls, np.tile(WALL_COLOR, (len(walls), 1)), WALL_WIDTH * thickness, camera)
        if trails is not None:
            tolerance = TRAIL_TOLERANCE * camera.visible_height / height
            ends, colors, _ = trails.segments(np.asarray(frame.color), np.array(self._spec.background), tolerance)
            self._draw_lines(ends.reshape(-1, 3), colors.reshape(-1, 3), TRAIL_WIDTH * thickness, camera)
        added = self.appearance.segments(frame, camera)
        for width in np.unique(added.width):
            chosen = added.width == width
            ends, colors = added.ends[chosen].reshape(-1, 3), np.repeat(added.color[chosen], 2, axis=0)
            self._draw_lines(ends, colors, float(width) * thickness, camera)
        self._canvas.scene(self._scene)

    def _placed(self, points: np.ndarray, camera: Camera) -> np.ndarray:
        """Points relative to the camera's target, in camera distances.

        GGUI's pictures have the target in their middle; they are shifted by shearing space along the line of sight, which moves
        every point by the same part of the picture and hides nothing else.
        """
        offset = points - camera.target
        if any(self.shift):
            slope = np.tan(np.radians(camera.field_of_view) / 2.0)
            half = 0.5 * camera.height if camera.orthographic else slope * (camera.distance - offset @ camera.backward)[:, None]
            offset = offset + half * (self.shift[0] * camera.right + self.shift[1] * camera.up)
        return offset / camera.distance

    def _place(self, camera: Camera, aspect: float) -> None:
        self._camera.position(*camera.backward.tolist())
        self._camera.lookat(0.0, 0.0, 0.0)
        self._camera.up(*camera.up.tolist())
        self._camera.fov(camera.field_of_view)
        self._camera.z_near(NEAR)
        self._camera.z_far(FAR)
        if camera.orthographic:
            half = camera.height / camera.distance / 2.0
            self._camera.projection_mode(ti.ui.ProjectionMode.Orthogonal)
            self._camera.left(-half * aspect)
            self._camera.right(half * aspect)
            self._camera.top(-half)  # GGUI's parallel projection is upside down
            self._camera.bottom(half)
        self._scene.set_camera(self._camera)

    def _point_size(self, frame: Frame, camera: Camera, width: int, height: int) -> np.ndarray:
        """The radius to ask GGUI for so that a sphere appears at its true size.

        GGUI 1.7.4 draws a sphere of radius r at distance s with r/s · focal length · width/height pixels, even in parallel
        projection: too large by the aspect ratio, as measured.
        """
        seen = camera.view(frame.position)
        spec = self._spec
        radius = camera.drawn_radius(
            frame.radius, seen[:, 2], height, scale=spec.radius_scale, minimum_pixels=spec.minimum_pixels
        )
        focal = height / 2.0 / np.tan(np.radians(camera.field_of_view) / 2.0)
        with np.errstate(divide="ignore", invalid="ignore"):
            pixels = radius / camera.length_per_pixel(seen[:, 2], height)
        distance = np.linalg.norm(self._placed(frame.position, camera) - camera.backward, axis=1)
        return np.where(seen[:, 2] > 0.0, pixels * distance / focal * height / width, 0.0)

    def _draw_lines(self, ends: np.ndarray, color: np.ndarray, width: float, camera: Camera) -> None:
        points = self._lines.setdefault(width, _PointBuffer(with_radius=False))
        count = points.put(self._placed(ends, camera), color, None)
        if count > 0:
            thick = max(width, THINNEST)
            self._scene.lines(points.position, width=thick, per_vertex_color=points.color, vertex_count=count)


class _PointBuffer:
    """Fields of one size that grows; GGUI compiles its copies anew for every field, so they are kept."""

    def __init__(self, *, with_radius: bool) -> None:
        self._capacity = 0
        self._with_radius = with_radius
        self.position = self.color = self.radius = None

    def put(self, position: np.ndarray, color: np.ndarray, radius: np.ndarray | None) -> int:
        """Copy points to the device and return their number; points that are not finite are moved out of sight."""
        count = len(position)
        if count > self._capacity:
            self._capacity = max(count, 2 * self._capacity)
            self.position = ti.Vector.field(3, ti.f32, self._capacity)
            self.color = ti.Vector.field(3, ti.f32, self._capacity)
            self.radius = ti.field(ti.f32, self._capacity) if self._with_radius else None
        if count == 0:
            return 0
        self._fill(self.position, np.where(np.isfinite(position).all(axis=1)[:, None], position, 2.0 * FAR))
        self._fill(self.color, np.clip(color, 0.0, 1.0))
        if radius is not None:
            self._fill(self.radius, np.nan_to_num(radius, nan=0.0, posinf=0.0))
        return count

    def _fill(self, field: "ti.Field", values: np.ndarray) -> None:
        padded = np.zeros((self._capacity, *values.shape[1:]), np.float32)
        padded[: len(values)] = np.clip(values, -1.0e18, 1.0e18)
        field.from_numpy(padded)


class GguiView(View):
    """Pictures by GGUI without a window.

    `window.show()` must never be called here: without a window it ends the process.
    """

    MADE_ANEW = ("_window", "_scene", "_end")  # for `archive.object_state`

    def __init__(self, spec: ViewSpec, size: tuple[int, int], *, dimensions: int = 3) -> None:
        """Open the device.

        Raises:
            BackendError: GGUI does not work here.
        """
        require_ggui()
        self.spec, self.size, self.dimensions = spec, size, dimensions
        self.camera: Camera | None = None
        self.trails = Trails(spec.trails)
        with ggui_folder():
            self._window = ti.ui.Window("offscreen", size, show_window=False)
        self._scene = GguiScene(self._window, spec, dimensions=dimensions)
        self._appearance = self._scene.appearance
        self._end: Callable[[], None] = self._window.destroy

    def draw(self, frame: Frame) -> np.ndarray:
        """The picture of a frame, uint8, shape (height, width, 3)."""
        appearance = self._appearance
        frame = appearance.dress(frame)
        if self.camera is None:
            self.camera = Camera(self.spec.camera, frame, aspect=self.size[0] / self.size[1], dimensions=self.dimensions)
        self.trails.add(appearance.with_drawn_velocity(frame))
        self._scene.draw(frame, self.camera, self.trails)
        picture = read_back(self._window)
        draw_labels(picture, appearance.labels(), self.camera, self.spec.background)
        draw_overlay(picture, frame, self.spec, self.camera)
        if frame.dimmed:
            dim(picture, self.spec.background)
        if self.spec.caption:
            draw_caption(picture, frame, self.spec.background)
        draw_legend(picture, appearance.legend(), self.spec.background)
        return picture

    def close(self) -> None:
        """Close the device's side of it."""
        with ggui_folder():
            self._end()
        self._end = _nothing


def read_back(window: "ti.ui.Window") -> np.ndarray:
    """The picture in a window, uint8, shape (height, width, 3), first row on top.

    GGUI gives (width, height, 4) floats from the lower left corner, at the size of the real frame buffer.
    """
    with ggui_folder():
        pixels = window.get_image_buffer_as_numpy()[:, ::-1, :3]
    return np.ascontiguousarray(np.rint(255.0 * pixels).astype(np.uint8).swapaxes(0, 1))


def _nothing() -> None:
    """Do nothing: closing a closed view is harmless."""
