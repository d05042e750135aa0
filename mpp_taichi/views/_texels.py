"""Light of textures on the device."""

import math

import taichi as ti

from mpp_taichi.types import Template
from mpp_taichi.views._single import single


@ti.func
def packed_light(drawing: Template, packed):
    """Light of red | green << 8 | blue << 16 as displayed."""
    return ti.Vector([drawing.levels[ti.cast(packed >> 8 * channel & 255, ti.i32)] for channel in ti.static(range(3))])


@ti.func
def texel_light(drawing: Template, k):
    """Light of one texel."""
    return packed_light(drawing, drawing.texels[k])


@ti.func
def texture_light(drawing: Template, m, normal):
    """Light of the texture of material m where the surface has a normal, between the four nearest texels."""
    material, place = ti.static(drawing.material, drawing.place)
    first, width, height = place[m, 0], place[m, 1], place[m, 2]
    east = normal.dot(ti.Vector([material[m, 0], material[m, 1], material[m, 2]]))
    north_east = normal.dot(ti.Vector([material[m, 3], material[m, 4], material[m, 5]]))
    north = normal.dot(ti.Vector([material[m, 6], material[m, 7], material[m, 8]]))
    north = ti.min(ti.max(north, single(-1.0)), single(1.0))
    u = (ti.atan2(north_east, east) * single(0.5 / math.pi) + single(0.5)) * width - single(0.5)
    v = ti.acos(north) * single(1.0 / math.pi) * height - single(0.5)
    v = ti.min(ti.max(v, single(0.0)), ti.cast(height - 1, ti.f32))
    column, row = ti.cast(ti.floor(u), ti.i32), ti.cast(ti.floor(v), ti.i32)
    s, t = u - ti.floor(u), v - ti.floor(v)
    left, right = (column + width) % width, (column + 1 + width) % width
    upper, lower = first + row * width, first + ti.min(row + 1, height - 1) * width
    above = texel_light(drawing, upper + left) * (1 - s) + texel_light(drawing, upper + right) * s
    below = texel_light(drawing, lower + left) * (1 - s) + texel_light(drawing, lower + right) * s
    return above * (1 - t) + below * t
