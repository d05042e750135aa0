"""Light of textures on the device."""

import math

import taichi as ti

from mpp_taichi.types import Template
from mpp_taichi.views._single import single
from mpp_taichi.views.surface_parts import SURFACE_AXES, TEXTURE_AT


@ti.func
def packed_light(drawing: Template, packed):
    """Light of red | green << 8 | blue << 16 as displayed."""
    return ti.Vector([drawing.levels[ti.cast(packed >> 8 * channel & 255, ti.i32)] for channel in ti.static(range(3))])


@ti.func
def in_body(drawing: Template, m, normal, axes: Template):
    """The normal in a body's coordinates: along the prime meridian, 90° east of it, and the north pole."""
    material = ti.static(drawing.material)
    east = normal.dot(ti.Vector([material[m, axes], material[m, axes + 1], material[m, axes + 2]]))
    north_east = normal.dot(ti.Vector([material[m, axes + 3], material[m, axes + 4], material[m, axes + 5]]))
    north = normal.dot(ti.Vector([material[m, axes + 6], material[m, axes + 7], material[m, axes + 8]]))
    return east, north_east, north


@ti.func
def between_texels(drawing: Template, m, normal, at: Template, axes: Template, light_of: Template):
    """A map of material m, from column `at` of `place` on, where the surface has a normal, between the four nearest texels."""
    place = ti.static(drawing.place)
    first, width, height = place[m, at], place[m, at + 1], place[m, at + 2]
    east, north_east, north = in_body(drawing, m, normal, axes)
    north = ti.min(ti.max(north, single(-1.0)), single(1.0))
    u = (ti.atan2(north_east, east) * single(0.5 / math.pi) + single(0.5)) * width - single(0.5)
    v = ti.acos(north) * single(1.0 / math.pi) * height - single(0.5)
    v = ti.min(ti.max(v, single(0.0)), ti.cast(height - 1, ti.f32))
    column, row = ti.cast(ti.floor(u), ti.i32), ti.cast(ti.floor(v), ti.i32)
    s, t = u - ti.floor(u), v - ti.floor(v)
    left, right = (column + width) % width, (column + 1 + width) % width
    upper, lower = first + row * width, first + ti.min(row + 1, height - 1) * width
    above = light_of(drawing, drawing.texels[upper + left]) * (1 - s) + light_of(drawing, drawing.texels[upper + right]) * s
    below = light_of(drawing, drawing.texels[lower + left]) * (1 - s) + light_of(drawing, drawing.texels[lower + right]) * s
    return above * (1 - t) + below * t


@ti.func
def texture_light(drawing: Template, m, normal):
    """Light of the texture of material m where the surface has a normal."""
    return between_texels(drawing, m, normal, TEXTURE_AT, SURFACE_AXES, packed_light)
