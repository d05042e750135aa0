"""The kernel that draws a picture: the pixels of some tiles."""

import taichi as ti

from mpp_taichi.device.heavy_loops import is_heavy, loop_grain
from mpp_taichi.types import Template
from mpp_taichi.views._coverage import cover_pixel, cover_row
from mpp_taichi.views._display import displayed, dither
from mpp_taichi.views._drawing import Drawing
from mpp_taichi.views._pixel_light import pixel_light
from mpp_taichi.views._primitives import TILE
from mpp_taichi.views._sample_hits import NOWHERE
from mpp_taichi.views._single import single
from mpp_taichi.views._texels import packed_light
from mpp_taichi.views.surface_parts import RINGS


@ti.kernel
def draw_pixels(
    tiles: ti.types.ndarray(ti.i32, ndim=1),
    taken: ti.types.ndarray(ti.i32, ndim=1),
    by_row: Template,
    width: ti.i32,
    height: ti.i32,
    per_pixel: ti.f32,
    orthographic: ti.i32,
    table: ti.types.ndarray(ti.f32, ndim=2),
    sphere_count: ti.i32,
    start: ti.types.ndarray(ti.i32, ndim=1),
    entry: ti.types.ndarray(ti.i32, ndim=1),
    picture: ti.types.ndarray(),
    curve: ti.types.ndarray(ti.f32, ndim=1),
    light: ti.types.vector(3, ti.f32),
    surfaces: Template,
    material: ti.types.ndarray(ti.f32, ndim=2),
    place: ti.types.ndarray(ti.i32, ndim=2),
    texels: ti.types.ndarray(ti.u32, ndim=1),
    levels: ti.types.ndarray(ti.f32, ndim=1),
    lights: ti.types.ndarray(ti.f32, ndim=2),
    light_count: ti.i32,
    glow_count: ti.i32,
    casters: ti.types.ndarray(ti.f32, ndim=2),
    caster_count: ti.i32,
    rings: ti.types.ndarray(ti.f32, ndim=2),
    ring_count: ti.i32,
    ambient: ti.f32,
):
    """Draw the primitives of these tiles over the background.

    The picture is bytes, (height, width, 3), for CPUs, which go `by_row`, and red | green << 8 | blue << 16, (height, width),
    for GPUs, which may not know bytes. `taken` is one 0.
    """
    drawing = ti.static(
        Drawing(
            width,
            height,
            per_pixel,
            orthographic,
            table,
            sphere_count,
            start,
            entry,
            picture,
            curve,
            light,
            surfaces,
            material,
            place,
            texels,
            levels,
            lights,
            light_count,
            glow_count,
            casters,
            caster_count,
            rings,
            ring_count,
            ambient,
        )
    )
    if ti.static(by_row):
        # Tiles need different times, and other programs use the cores too: each thread takes the next free tile.
        grain, threads = ti.static(loop_grain(), ti.lang.impl.current_cfg().cpu_max_num_threads)
        for q in range(threads * grain):
            if is_heavy(q, grain):
                turn = ti.atomic_add(taken[0], 1)
                while turn < tiles.shape[0]:
                    top, left = corner(drawing, tiles[turn])
                    for row in range(top, ti.min(top + TILE, height)):
                        draw_run(drawing, by_row, tiles[turn], row, left)
                    turn = ti.atomic_add(taken[0], 1)
    else:
        for q in range(tiles.shape[0] * TILE * TILE):
            tile, inside = tiles[q // (TILE * TILE)], q % (TILE * TILE)
            top, left = corner(drawing, tile)
            row, column = top + inside // TILE, left + inside % TILE
            if row < height and column < width:
                draw_run(drawing, by_row, tile, row, column)


@ti.func
def corner(drawing: Template, tile):
    """First row and column of a tile."""
    across = (drawing.width + TILE - 1) // TILE
    return tile // across * TILE, tile % across * TILE


@ti.func
def draw_run(drawing: Template, by_row: Template, tile, row, left):
    """Draw the pixels of one row of a tile, or one pixel."""
    run, cover = ti.static((TILE, cover_row) if by_row else (1, cover_pixel))
    depths, hits = ti.Vector([single(NOWHERE)] * (4 * run)), ti.Vector([-1] * (4 * run))
    some, end = cover(drawing, tile, row, left, depths, hits), left
    everywhere = drawing.glow_count > 0
    if ti.static(drawing.surfaces & RINGS):
        everywhere = everywhere or drawing.ring_count > 0
    if some > 0 or everywhere:
        end = ti.min(left + run, drawing.width)
    for column in range(left, end):
        first = 4 * (column - left)
        depth = ti.Vector([depths[first + s] for s in ti.static(range(4))])
        hit = ti.Vector([hits[first + s] for s in ti.static(range(4))])
        if hit.max() >= 0 or everywhere:
            share = single(0.5)
            if ti.static(drawing.surfaces):
                share = dither(row, column)
            behind = light_behind(drawing, by_row, row, column)
            changed, light = pixel_light(drawing, row, column, depth, hit, behind)
            if changed == 1:
                level = ti.Vector([displayed(drawing.curve, light[channel], share) for channel in ti.static(range(3))])
                if ti.static(by_row):
                    for channel in ti.static(range(3)):
                        drawing.picture[row, column, channel] = ti.cast(level[channel], ti.u8)
                else:
                    drawing.picture[row, column] = ti.cast(level[0] | level[1] << 8 | level[2] << 16, ti.u32)


@ti.func
def light_behind(drawing: Template, by_row: Template, row, column):
    """Light of the background, which the picture holds before it is drawn."""
    light = ti.Vector([single(0)] * 3)
    if ti.static(by_row):
        for channel in ti.static(range(3)):
            light[channel] = drawing.levels[ti.cast(drawing.picture[row, column, channel], ti.i32)]
    else:
        light = packed_light(drawing, drawing.picture[row, column])
    return light
