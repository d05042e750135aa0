"""The light of one pixel, from the primitives that its samples hit."""

import taichi as ti

from mpp_taichi.types import Template
from mpp_taichi.views._rings import through_rings
from mpp_taichi.views._sample_hits import NOWHERE, rays, sample_places, sphere_hit
from mpp_taichi.views._single import single
from mpp_taichi.views._surface_shading import glow, shade_plain, shade_surface
from mpp_taichi.views.surface_parts import RINGS


@ti.func
def pixel_light(drawing: Template, row, column, depth, hit, behind):
    """The mean light of a pixel's samples, and whether it differs from the background."""
    x, y = sample_places(column, row)
    right, up = rays(drawing, x, y)
    changed, total = 1, ti.Vector([single(0)] * 3)
    if hit.max() < 0 and ti.static(not drawing.surfaces & RINGS):
        changed = 0
        if ti.static(drawing.surfaces):  # one sample is enough where there are no edges
            halo = glow(drawing, right[0], up[0], single(NOWHERE))
            if halo.max() > 0:
                changed, total = 1, ti.min(behind + halo, single(1))
    elif ti.static(drawing.surfaces):
        left = ti.Vector([1, 1, 1, 1])
        while left.max() > 0:
            # Shade once for all samples that hit the same primitive, at their mean position, which it also covers.
            p, seen_depth = -1, single(NOWHERE)
            for s in ti.static(range(4)):
                if left[s] == 1:
                    p, seen_depth = hit[s], depth[s]
            shared, middle_x, middle_y = single(0), single(0), single(0)
            for s in ti.static(range(4)):
                same = ti.cast(hit[s] == p, ti.i32)
                share = ti.cast(same, ti.f32)
                shared, middle_x, middle_y = shared + share, middle_x + share * right[s], middle_y + share * up[s]
                left[s] *= 1 - same
            middle_x, middle_y = middle_x / shared, middle_y / shared
            if 0 <= p < drawing.sphere_count:
                middle = sphere_hit(drawing, p, middle_x, middle_y)
                if middle < single(NOWHERE):  # rounding may move the mean position off the rim
                    seen_depth = middle
            light = ray_light(drawing, p, middle_x, middle_y, seen_depth, behind)
            if ti.static(drawing.surfaces & RINGS):
                light = through_rings(drawing, middle_x, middle_y, seen_depth, ti.min(light, single(1)))
            light += glow(drawing, middle_x, middle_y, seen_depth)
            total += single(0.25) * shared * ti.min(light, single(1))
        if ti.static(drawing.surfaces & RINGS):
            if hit.max() < 0 and ti.abs(total - behind).max() == 0:
                changed = 0
    else:
        for s in ti.static(range(4)):
            light = ray_light(drawing, hit[s], right[s], up[s], depth[s], behind)
            total += single(0.25) * ti.min(light, single(1))
    return changed, total


@ti.func
def ray_light(drawing: Template, p, x, y, depth, behind):
    """Light along the ray through (x, y), which meets primitive p at a depth; for p = −1 the light of the background."""
    light = behind
    if p >= drawing.sphere_count:
        light = ti.Vector([drawing.table[p, k] for k in ti.static(range(13, 16))])
    elif p >= 0:
        if ti.static(drawing.surfaces):
            light = shade_surface(drawing, p, x, y, depth)
        else:
            light = shade_plain(drawing, p, x, y, depth)
    return light
