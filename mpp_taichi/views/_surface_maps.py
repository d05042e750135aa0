"""Clouds, slopes, highlights and lights at night on the device; only pictures of views that ask for them compile this code."""

import taichi as ti

from mpp_taichi.types import Template
from mpp_taichi.views._single import direction, single
from mpp_taichi.views._texels import between_texels, in_body, packed_light
from mpp_taichi.views.relief import LEVEL, STEP
from mpp_taichi.views.surface_parts import (
    BRIGHTNESS,
    CLOUD_AXES,
    CLOUDS_AT,
    GLOSS_AT,
    NIGHT_AT,
    OPACITY,
    RELIEF_AT,
    STRENGTH,
    SURFACE_AXES,
)

TWILIGHT = 0.1  # sine of the height of a light over the horizon above which there is no night, and below which there is no day
STEEP_LIGHT = 4.0  # a slope has at most so many times the light of level ground, so that there is none beyond the terminator


@ti.func
def packed_light_and_opacity(drawing: Template, packed):
    """Light times opacity, and opacity, of a texel of clouds."""
    light = packed_light(drawing, packed)
    opacity = ti.cast((packed >> 24) & 255, ti.f32) * single(1.0 / 255.0)
    return ti.Vector([light[0], light[1], light[2], opacity])


@ti.func
def packed_slope(drawing: Template, packed):
    """Slopes to the east and to the north of a texel."""
    east, north = ti.cast(packed & 65535, ti.i32) - LEVEL, ti.cast((packed >> 16) & 65535, ti.i32) - LEVEL
    return ti.Vector([ti.cast(east, ti.f32), ti.cast(north, ti.f32)]) * single(STEP)


@ti.func
def clouds_over(drawing: Template, m, normal):
    """Light times opacity, and opacity, of the clouds of material m where the surface has a normal."""
    seen = between_texels(drawing, m, normal, CLOUDS_AT, CLOUD_AXES, packed_light_and_opacity)
    return seen * drawing.material[m, OPACITY]


@ti.func
def sloping_normal(drawing: Template, m, normal):
    """The normal of the sloping surface of material m where the sphere has a normal.

    With the slopes a to the east and b to the north it is n − a e − b f, at length one.
    """
    material = ti.static(drawing.material)
    slope = between_texels(drawing, m, normal, RELIEF_AT, SURFACE_AXES, packed_slope)
    x, y, z = in_body(drawing, m, normal, SURFACE_AXES)
    level = ti.sqrt(ti.max(x * x + y * y, single(1e-12)))
    meridian = ti.Vector([material[m, SURFACE_AXES + k] for k in ti.static(range(3))])
    quarter = ti.Vector([material[m, SURFACE_AXES + 3 + k] for k in ti.static(range(3))])
    pole = ti.Vector([material[m, SURFACE_AXES + 6 + k] for k in ti.static(range(3))])
    east = (x * quarter - y * meridian) / level
    north = level * pole - z / level * (x * meridian + y * quarter)
    return direction(normal - slope[0] * east - slope[1] * north)


@ti.func
def sloping_light(level, sloping):
    """Share of a light's strength on a slope, by the cosines of the light on level ground and on the slope."""
    return ti.min(ti.max(sloping, single(0.0)), single(STEEP_LIGHT) * ti.max(level, single(0.0)))


@ti.func
def share_of_night(level):
    """1 where a light is far below the horizon, 0 where it is above, by its cosine on level ground."""
    share = ti.min(ti.max(single(0.5) - level * single(0.5 / TWILIGHT), single(0.0)), single(1.0))
    return share * share * (3 - 2 * share)


@ti.func
def night_light(drawing: Template, m, normal):
    """Light of the lights at night of material m."""
    return between_texels(drawing, m, normal, NIGHT_AT, SURFACE_AXES, packed_light) * drawing.material[m, BRIGHTNESS]


@ti.func
def packed_shares(drawing: Template, packed):
    """Red, green and blue of a texel as shares of the largest value."""
    return ti.Vector([ti.cast(packed >> 8 * channel & 255, ti.f32) for channel in ti.static(range(3))]) * single(1.0 / 255.0)


@ti.func
def gloss_at(drawing: Template, m, normal):
    """Share of a light in the middle of its highlight on material m where the surface has a normal."""
    return between_texels(drawing, m, normal, GLOSS_AT, SURFACE_AXES, packed_shares) * drawing.material[m, STRENGTH]
