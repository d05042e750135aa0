"""The program's own renderer: shaded spheres and lines, drawn by one Taichi kernel on whatever backend runs.

It needs no graphics driver and no display, works in single precision, and gives the same picture twice: every pixel gathers
from the list of its tile, in one order, and nothing is added atomically.
"""

import logging
import math

import numpy as np
import taichi as ti

from mpp_taichi.scene.spec import ViewSpec
from mpp_taichi.serial_loops import on_cpu
from mpp_taichi.types import Template
from mpp_taichi.views._base import WALL_COLOR, WALL_WIDTH, Frame, Trails, View
from mpp_taichi.views._coverage import Coverage
from mpp_taichi.views._primitives import TILE, Primitives, Screen, at_least_one, bin_into_tiles, lines, spheres
from mpp_taichi.views._sample_hits import SAMPLES, line_hit, sphere_hit
from mpp_taichi.views._surface_shading import (
    AMBIENT,
    DIFFUSE,
    SPECULAR,
    displayed,
    glow,
    highlight,
    shade_surface,
    single,
    surface_at,
)
from mpp_taichi.views.appearance import Appearance
from mpp_taichi.views.camera import Camera
from mpp_taichi.views.caption import draw_caption
from mpp_taichi.views.legend import draw_labels, draw_legend
from mpp_taichi.views.sky import Sky
from mpp_taichi.views.srgb import linear_from_srgb, srgb_from_linear
from mpp_taichi.views.surfaces import Surfaces, SurfaceTables
from mpp_taichi.views.textures import LEVELS

logger = logging.getLogger(__name__)

LIGHT = np.array([-0.45, 0.6, -0.66]) / math.sqrt(0.45**2 + 0.6**2 + 0.66**2)  # from where: upper left, before the scene
TRAIL_WIDTH = 1.5  # pixels
TRAIL_DEPTH = 1.0e-3  # of its distance, that the oldest part of a trail is drawn behind its place
GAMMA_ENTRIES = 4096
LOOP_LIMIT = 65_000  # software Vulkan ends a thread's loop silently at 65,535 iterations


class Renderer(View):
    """Draws frames at a fixed size. `ti.init` has been called; the renderer owns no field, so several may live together."""

    def __init__(self, spec: ViewSpec, size: tuple[int, int], *, dimensions: int = 3) -> None:
        """Set up; the camera is placed by the first frame."""
        self.spec, self.size, self.dimensions = spec, size, dimensions
        self.camera: Camera | None = None
        self.trails = Trails(spec.trails)
        levels = srgb_from_linear(np.linspace(0.0, 1.0, GAMMA_ENTRIES))
        self._gamma = np.rint(255.0 * levels).astype(np.int32)
        self._packed = np.zeros((size[1], size[0]), np.uint32)
        self._appearance, self._surfaces = Appearance(spec, dimensions), Surfaces(spec)
        self._background = linear_from_srgb(np.array(spec.background))
        self._coverage = Coverage()
        self._sky = Sky(spec.sky, size, self._background) if spec.sky is not None else None

    def draw(self, frame: Frame) -> np.ndarray:
        """The picture of a frame, uint8, shape (height, width, 3)."""
        width, height = self.size
        frame = self._appearance.dress(frame)
        if self.camera is None:
            self.camera = Camera(self.spec.camera, frame, aspect=width / height, dimensions=self.dimensions)
        self.trails.add(frame)
        screen = Screen.of(self.camera, width, height)
        primitives, tables = self._primitives(frame, self.camera, screen)
        self._rasterize(primitives, tables, screen)
        picture = np.empty((height, width, 3), np.uint8)
        for k in range(3):  # one color at a time: four times as fast as all
            picture[:, :, k] = self._packed.view(np.uint8).reshape(height, width, 4)[:, :, k]
        draw_labels(picture, self._appearance.labels(), self.camera, self.spec.background)
        if self.spec.caption:
            draw_caption(picture, frame, self.spec.background)
        draw_legend(picture, self._appearance.legend(), self.spec.background)
        return picture

    def see(self, frame: Frame) -> None:
        """Let ranges of colours that the scene does not give take in a frame that is drawn later."""
        self._appearance.dress(frame)

    def close(self) -> None:
        """Nothing is held on the device."""

    def _primitives(self, frame: Frame, camera: Camera, screen: Screen) -> tuple[Primitives, SurfaceTables]:
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
        ends, colors, age = self.trails.segments(np.asarray(frame.color), np.array(spec.background))
        springs = center[np.asarray(frame.between, dtype=np.int64)].reshape(-1, 2, 3)
        walls, added = camera.view(frame.outline), self._appearance.segments(frame, camera)
        # Older parts lie a little farther away: where a path is gone again, its newest part is seen.
        trails, push = camera.view(ends), (1.0 + TRAIL_DEPTH * age)[:, None]
        if camera.orthographic:
            trails[:, :, 2] *= push
        else:
            trails *= push[:, :, None]
        all_ends = np.concatenate([springs, trails, walls, camera.view(added.ends)]) / scale
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

    def _rasterize(self, primitives: Primitives, tables: SurfaceTables, screen: Screen) -> None:
        longest = int(np.diff(primitives.start).max())
        if longest > LOOP_LIMIT and ti.lang.impl.current_cfg().arch == ti.vulkan:
            logger.warning(
                "%d particles share one tile of the picture; software Vulkan draws the nearest %d", longest, LOOP_LIMIT
            )
        assert self.camera is not None
        sky_light = np.zeros((1, 1, 3), np.float32)
        if self._sky is not None:
            sky_light, self._packed[:] = self._sky.pictures(self.camera)
        else:
            red, green, blue = np.rint(255.0 * np.clip(self.spec.background, 0.0, 1.0)).astype(int).tolist()
            self._packed.fill(red | green << 8 | blue << 16)
        by_tile = on_cpu()
        # Most of a picture is empty, unless something glows.
        shows = np.diff(primitives.start) > 0
        tiles = np.flatnonzero(shows if not tables.glow_count else np.ones_like(shows)).astype(np.int32)
        if not len(tiles):
            return
        if by_tile:
            self._coverage.find(tiles, primitives, screen)
        _draw_pixels(
            screen.width,
            screen.height,
            primitives.sphere_count,
            at_least_one(primitives.table),
            primitives.start,
            at_least_one(primitives.entry),
            self._gamma,
            self._packed,
            screen.focal,
            int(screen.orthographic),
            ti.Vector(LIGHT.tolist()),
            ti.Vector(self._background.tolist()),
            bool(self._surfaces),
            self._sky is not None,
            tables.material,
            tables.place,
            tables.texels,
            LEVELS,
            at_least_one(tables.lights),
            at_least_one(tables.casters),
            len(tables.lights),
            tables.glow_count,
            len(tables.casters),
            self.spec.ambient,
            sky_light,
            by_tile,
            tiles,
            self._coverage.depth,
            self._coverage.hit,
        )


@ti.func
def _shade(table: Template, p, sphere_count, x, y, depth, orthographic, light):
    """Light that reaches the eye from primitive p: ambient, diffuse and a highlight on spheres, flat on lines."""
    color = ti.Vector([table[p, 13], table[p, 14], table[p, 15]])
    if p < sphere_count:
        albedo = ti.Vector([table[p, 9], table[p, 10], table[p, 11]])
        ray, _, normal = surface_at(table, p, x, y, depth, orthographic)
        diffuse = ti.max(normal.dot(light), single(0.0))
        color = albedo * (single(AMBIENT) + single(DIFFUSE) * diffuse) + single(SPECULAR) * highlight(normal, ray, light)
    return color


@ti.func
def _sees_nothing(tile_hit: Template, slot, first_sample):
    most = -1
    for s in ti.static(range(4)):
        most = ti.max(most, tile_hit[slot, first_sample + s])
    return most < 0


@ti.kernel
def _draw_pixels(
    width: ti.i32,
    height: ti.i32,
    sphere_count: ti.i32,
    table: ti.types.ndarray(ti.f32, ndim=2),
    start: ti.types.ndarray(ti.i32, ndim=1),
    entry: ti.types.ndarray(ti.i32, ndim=1),
    gamma: ti.types.ndarray(ti.i32, ndim=1),
    packed: ti.types.ndarray(ti.u32, ndim=2),
    focal: ti.f32,
    orthographic: ti.i32,
    light: ti.types.vector(3, ti.f32),
    background: ti.types.vector(3, ti.f32),
    surfaces: Template,
    sky: Template,
    material: ti.types.ndarray(ti.f32, ndim=2),
    place: ti.types.ndarray(ti.i32, ndim=2),
    texels: ti.types.ndarray(ti.u32, ndim=1),
    levels: ti.types.ndarray(ti.f32, ndim=1),
    lights: ti.types.ndarray(ti.f32, ndim=2),
    casters: ti.types.ndarray(ti.f32, ndim=2),
    light_count: ti.i32,
    glow_count: ti.i32,
    caster_count: ti.i32,
    ambient: ti.f32,
    sky_light: ti.types.ndarray(ti.f32, ndim=3),
    covered: Template,
    tiles: ti.types.ndarray(ti.i32, ndim=1),
    tile_depth: ti.types.ndarray(ti.f32, ndim=2),
    tile_hit: ti.types.ndarray(ti.i32, ndim=2),
):
    for q in range(tiles.shape[0] * TILE * TILE):
        slot, inside = q // (TILE * TILE), q % (TILE * TILE)
        tile = tiles[slot]
        across = (width + TILE - 1) // TILE
        row, column = tile // across * TILE + inside // TILE, tile % across * TILE + inside % TILE
        shows = 0
        if row < height and column < width:
            shows = 1
            if ti.static(covered):
                if glow_count == 0 and _sees_nothing(tile_hit, slot, 4 * inside):
                    shows = 0  # as most pixels of a tile do
        if shows == 1:
            color = packed[row, column]  # what lies behind all
            k, end = start[tile], start[tile + 1]
            behind = background
            if ti.static(sky):
                behind = ti.Vector([sky_light[row, column, 0], sky_light[row, column, 1], sky_light[row, column, 2]])
            # The samples on the screen [pixels] and, below, as rays.
            sx, sy = ti.Vector([single(0)] * 4), ti.Vector([single(0)] * 4)
            depth, hit = ti.Vector([single(3.0e38)] * 4), ti.Vector([-1] * 4)
            for s in ti.static(range(4)):
                sx[s] = ti.cast(column, ti.f32) + single(0.5 + SAMPLES[s][0])
                sy[s] = ti.cast(row, ti.f32) + single(0.5 + SAMPLES[s][1])
            rx, ry = (sx - single(0.5) * width) / focal, (single(0.5) * height - sy) / focal
            if ti.static(covered):
                k = end
                for s in ti.static(range(4)):
                    depth[s], hit[s] = tile_depth[slot, 4 * inside + s], tile_hit[slot, 4 * inside + s]
            while k < end:
                p = entry[k]
                k += 1
                if table[p, 4] > depth.max():
                    k = end  # nearest first: nothing behind can be seen in any sample
                elif table[p, 0] < column + 1 and table[p, 1] > column and table[p, 2] < row + 1 and table[p, 3] > row:
                    for s in ti.static(range(4)):
                        found = single(-1)
                        if p < sphere_count:
                            found = sphere_hit(table, p, rx[s], ry[s], orthographic)
                        else:
                            found = line_hit(table, p, sx[s], sy[s], orthographic)
                        if found > 0 and found < depth[s]:
                            depth[s] = found
                            hit[s] = p
            if ti.static(surfaces):
                if glow_count > 0 and hit.max() < 0:  # one sample will do where there are no edges
                    halo = glow(lights, glow_count, rx[0], ry[0], single(3.0e38), orthographic)
                    if halo.max() > 0:
                        color = displayed(ti.min(behind + halo, ti.Vector([single(1)] * 3)), row, column)
            if hit.max() >= 0:
                total = ti.Vector([single(0), single(0), single(0)])
                if ti.static(surfaces):
                    for s in range(4):  # not unrolled: the compiler would take four times as long
                        # Once for all samples of one primitive, in their middle, which a sphere and a line cover too.
                        shared, first = 0, 1
                        x, y = single(0), single(0)
                        for other in ti.static(range(4)):
                            if hit[other] == hit[s]:
                                shared += 1
                                x, y = x + rx[other], y + ry[other]
                                if other < s:
                                    first = 0
                        if first == 1:
                            x, y = x / shared, y / shared
                            light_seen, seen = behind, depth[s]
                            if hit[s] >= sphere_count:
                                light_seen = ti.Vector([table[hit[s], 13], table[hit[s], 14], table[hit[s], 15]])
                            elif hit[s] >= 0:
                                middle = sphere_hit(table, hit[s], x, y, orthographic)
                                if middle > 0:  # not so where rounding takes it off the rim
                                    seen = middle
                                light_seen = shade_surface(
                                    table,
                                    material,
                                    place,
                                    texels,
                                    levels,
                                    lights,
                                    casters,
                                    light_count,
                                    caster_count,
                                    ambient,
                                    hit[s],
                                    x,
                                    y,
                                    seen,
                                    orthographic,
                                    light,
                                )
                            light_seen += glow(lights, glow_count, x, y, seen, orthographic)
                            total += shared * ti.min(light_seen, ti.Vector([single(1)] * 3))
                else:
                    for s in ti.static(range(4)):
                        light_seen = behind
                        if hit[s] >= 0:
                            light_seen = _shade(table, hit[s], sphere_count, rx[s], ry[s], depth[s], orthographic, light)
                        total += ti.min(light_seen, ti.Vector([single(1)] * 3))
                if ti.static(surfaces or sky):
                    color = displayed(total * single(0.25), row, column)
                else:
                    level = ti.cast(total * single((GAMMA_ENTRIES - 1) / 4) + single(0.5), ti.i32)
                    color = ti.cast(gamma[level[0]] | gamma[level[1]] << 8 | gamma[level[2]] << 16, ti.u32)
            packed[row, column] = color
