"""The program's own renderer: shaded spheres and lines, drawn by one Taichi kernel on whatever backend runs.

It needs no graphics driver and no display, works in single precision, and repeats a picture to the bit: every pixel
gathers from the list of its tile in a fixed order, and no number is added atomically.
"""

import logging
import math

import numpy as np
import taichi as ti

from mpp_taichi.device.fast_taichi.serial_loops import on_cpu
from mpp_taichi.scene.spec import ViewSpec
from mpp_taichi.views._base import WALL_COLOR, WALL_WIDTH, Frame, View
from mpp_taichi.views._display import CURVE
from mpp_taichi.views._pixels import draw_pixels
from mpp_taichi.views._primitives import Primitives, Screen, at_least_one, bin_into_tiles, lines, spheres
from mpp_taichi.views.appearance import Appearance
from mpp_taichi.views.camera import Camera
from mpp_taichi.views.caption import draw_caption
from mpp_taichi.views.dimming import dim
from mpp_taichi.views.legend import draw_labels, draw_legend
from mpp_taichi.views.overlay import draw_overlay
from mpp_taichi.views.rings import tiles_with_rings
from mpp_taichi.views.sky import Sky
from mpp_taichi.views.srgb import linear_from_srgb
from mpp_taichi.views.surfaces import Surfaces, SurfaceTables
from mpp_taichi.views.textures import LEVELS
from mpp_taichi.views.trails import DrawnTrails, Trails

logger = logging.getLogger(__name__)

LIGHT = np.array([-0.45, 0.6, -0.66]) / math.sqrt(0.45**2 + 0.6**2 + 0.66**2)  # to the light: upper left, in front
TRAIL_WIDTH = 1.5  # pixels
TRAIL_TOLERANCE = 0.2  # pixels between a trail and the curve that it follows
TRAIL_DEPTH = 1.0e-3  # share of its distance by which the oldest part of a trail is drawn behind its place
LOOP_LIMIT = 65_000  # software Vulkan ends a thread's loop silently at 65,535 iterations


class Renderer(View):
    """Draws frames at a fixed size. `ti.init` has been called; the renderer owns no field, so several may live together."""

    MADE_ANEW = ("_plain",)  # for `archive.object_state`

    def __init__(
        self, spec: ViewSpec, size: tuple[int, int], *, dimensions: int = 3, appearance: Appearance | None = None
    ) -> None:
        """Set up the renderer; the first frame places the camera. An `appearance` may be shared with other views."""
        self.spec, self.dimensions = spec, dimensions
        self.camera: Camera | None = None
        self.trails = Trails(spec.trails)
        self._appearance, self._surfaces = appearance or Appearance(spec, dimensions), Surfaces(spec)
        self._take_size(size)

    def _take_size(self, size: tuple[int, int]) -> None:
        spec, self.size = self.spec, size
        self._plain = np.tile(np.rint(255.0 * np.clip(spec.background, 0.0, 1.0)).astype(np.uint8), (size[1], size[0], 1))
        self._sky = Sky(spec.sky, size, linear_from_srgb(np.array(spec.background))) if spec.sky is not None else None

    def draw(self, frame: Frame) -> np.ndarray:
        """The picture of a frame, uint8, shape (height, width, 3)."""
        frame = self._appearance.dress(frame)
        if self.camera is None:
            self.camera = Camera(self.spec.camera, frame, aspect=self.size[0] / self.size[1], dimensions=self.dimensions)
        self.trails.add(self._appearance.with_drawn_velocity(frame))
        return self.picture_of(frame, self.trails)

    def resize(self, size: tuple[int, int]) -> None:
        """Draw pictures of another size from now on."""
        if size != self.size:
            self._take_size(size)

    def picture_of(self, frame: Frame, trails: DrawnTrails) -> np.ndarray:
        """The picture of a prepared frame with trails that it is in already, where the camera has its place."""
        assert self.camera is not None
        width, height = self.size
        screen = Screen.of(self.camera, width, height)
        primitives, tables = self._primitives(frame, self.camera, screen, trails)
        picture = self._rasterize(primitives, tables, screen)
        draw_labels(picture, self._appearance.labels(), self.camera, self.spec.background)
        draw_overlay(picture, frame, self.spec, self.camera)
        if frame.dimmed:
            dim(picture, self.spec.background)
        if self.spec.caption:
            draw_caption(picture, frame, self.spec.background)
        draw_legend(picture, self._appearance.legend(), self.spec.background)
        return picture

    def see(self, frame: Frame) -> None:
        """Extend the ranges of colours that the scene does not give to a frame that is drawn later."""
        self._appearance.dress(frame)

    def lead_trails_through(self, frame: Frame) -> None:
        """Let the trails pass through a frame that is not drawn."""
        self.trails.add(self._appearance.with_drawn_velocity(self._appearance.dress(frame)))

    def close(self) -> None:
        """Do nothing: the renderer holds no memory of the device."""

    def _primitives(
        self, frame: Frame, camera: Camera, screen: Screen, trails: DrawnTrails
    ) -> tuple[Primitives, SurfaceTables]:
        scale, spec = camera.distance, self.spec
        center = camera.view(frame.position)
        radius = camera.drawn_radius(
            frame.radius, center[:, 2], screen.height, scale=spec.radius_scale, minimum_pixels=spec.minimum_pixels
        )
        tables = SurfaceTables.none()
        if self._surfaces:
            size = np.asarray(frame.radius) * spec.radius_scale / scale
            tables = self._surfaces.tables(frame, camera, center / scale, size, radius / scale, screen.height)
        marks = tables.marks if self._surfaces else None
        drawn = spheres(center / scale, radius / scale, linear_from_srgb(frame.color), screen, marks=marks)
        tolerance = TRAIL_TOLERANCE * camera.visible_height / screen.height
        ends, colors, age = trails.segments(np.asarray(frame.color), np.array(spec.background), tolerance)
        springs = center[np.asarray(frame.between, dtype=np.int64)].reshape(-1, 2, 3)
        walls, added = camera.view(frame.outline), self._appearance.segments(frame, camera)
        # Older parts lie a little farther away: where a path overlaps itself, its newest part is visible.
        paths, push = camera.view(ends), (1.0 + TRAIL_DEPTH * age)[:, None]
        if camera.orthographic:
            paths[:, :, 2] *= push
        else:
            paths *= push[:, :, None]
        all_ends = np.concatenate([springs, paths, walls, camera.view(added.ends)]) / scale
        color = linear_from_srgb(
            np.concatenate([frame.spring_color, colors.mean(axis=1), np.tile(WALL_COLOR, (len(walls), 1)), added.color])
        )
        thickness = np.concatenate(
            [
                np.full(len(springs), spec.spring_width),
                TRAIL_WIDTH * (1.0 - 0.5 * age),
                np.full(len(walls), WALL_WIDTH),
                added.width,
            ]
        )
        return bin_into_tiles(drawn, lines(all_ends, color, thickness * screen.height / 720.0, screen), screen), tables

    def _rasterize(self, primitives: Primitives, tables: SurfaceTables, screen: Screen) -> np.ndarray:
        longest = int(np.diff(primitives.start).max())
        if longest > LOOP_LIMIT and ti.lang.impl.current_cfg().arch == ti.vulkan:
            logger.warning(
                "%d particles share one tile of the picture; software Vulkan draws the nearest %d", longest, LOOP_LIMIT
            )
        assert self.camera is not None
        behind = self._plain if self._sky is None else self._sky.picture(self.camera)
        # Most tiles of a picture are empty, unless a body glows.
        shows = np.diff(primitives.start) > 0
        if len(tables.rings):
            shows |= tiles_with_rings(tables.rings, screen)
        tiles = np.flatnonzero(shows if not tables.glow_count else np.ones_like(shows)).astype(np.int32)
        if not len(tiles):
            return behind.copy()
        by_row = on_cpu()
        # Graphics cards may have no type for bytes.
        canvas = behind.copy() if by_row else _packed(behind)
        draw_pixels(
            tiles,
            np.zeros(1, np.int32),
            by_row,
            screen.width,
            screen.height,
            1.0 / screen.focal,
            int(screen.orthographic),
            at_least_one(primitives.table),
            primitives.sphere_count,
            primitives.start,
            at_least_one(primitives.entry),
            canvas,
            CURVE,
            ti.Vector(LIGHT.tolist()),
            self._surfaces.parts,
            tables.material,
            tables.place,
            tables.texels,
            LEVELS,
            at_least_one(tables.lights),
            len(tables.lights),
            tables.glow_count,
            at_least_one(tables.casters),
            len(tables.casters),
            at_least_one(tables.rings),
            len(tables.rings),
            self.spec.ambient,
        )
        return canvas if by_row else _unpacked(canvas)


def _packed(picture: np.ndarray) -> np.ndarray:
    """Red | green << 8 | blue << 16 of every pixel."""
    packed = np.zeros((*picture.shape[:2], 4), np.uint8)
    for k in range(3):  # one colour at a time is four times as fast as all colours together
        packed[:, :, k] = picture[:, :, k]
    return packed.view(np.uint32)[:, :, 0]


def _unpacked(packed: np.ndarray) -> np.ndarray:
    picture = np.empty((*packed.shape, 3), np.uint8)
    for k in range(3):
        picture[:, :, k] = packed.view(np.uint8).reshape(*packed.shape, 4)[:, :, k]
    return picture
