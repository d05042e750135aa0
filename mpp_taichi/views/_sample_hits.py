"""Depths at which rays through samples of a picture meet a sphere or a line; x and y are numbers or vectors of samples."""

import taichi as ti

from mpp_taichi.types import Template
from mpp_taichi.views._single import single

NOWHERE = 3.0e38  # depth of a ray that meets no primitive
SAMPLES = ((-0.125, -0.375), (0.375, -0.125), (-0.375, 0.125), (0.125, 0.375))  # rotated grid, in pixels from the middle


@ti.func
def sample_places(column, row):
    """Pixel positions x and y of the samples of a pixel."""
    x, y = ti.cast(column, ti.f32), ti.cast(row, ti.f32)
    return (
        ti.Vector([x + single(0.5 + across) for across, _ in ti.static(SAMPLES)]),
        ti.Vector([y + single(0.5 + down) for _, down in ti.static(SAMPLES)]),
    )


@ti.func
def rays(drawing: Template, x, y):
    """Points at which rays through pixel positions meet the plane at unit depth: right and up from the picture's middle."""
    middle_x, middle_y = single(0.5) * drawing.width, single(0.5) * drawing.height
    return (x - middle_x) * drawing.per_pixel, (middle_y - y) * drawing.per_pixel


@ti.func
def sphere_hit(drawing: Template, p, x, y):
    """Depth where the ray through (x, y) meets sphere p, or `NOWHERE`; the ray is (x, y, 1) t, or (x, y) + (0, 0, t).

    The depth is measured from the point of the ray nearest to the centre, so that small far spheres keep their shape in single
    precision. There is no branch, so that processors compute the samples of a pixel together.
    """
    table = ti.static(drawing.table)
    one, aside = single(1), ti.cast(drawing.orthographic, ti.f32)
    mx, my, mz = table[p, 5] - aside * x, table[p, 6] - aside * y, table[p, 7]
    dx, dy = (one - aside) * x, (one - aside) * y
    inverse = one / (dx * dx + dy * dy + one)
    nearest = (mx * dx + my * dy + mz) * inverse
    ox, oy, oz = mx - nearest * dx, my - nearest * dy, mz - nearest
    under = table[p, 8] * table[p, 8] - (ox * ox + oy * oy + oz * oz)
    depth = ti.select(under > 0, nearest - ti.sqrt(ti.max(under, single(0)) * inverse), single(-1))
    return ti.select(depth > 0, depth, single(NOWHERE))


@ti.func
def line_hit(drawing: Template, p, x, y):
    """Depth at which the pixel position (x, y) lies on line p, or `NOWHERE` where the position lies beside the line."""
    table = ti.static(drawing.table)
    ax, ay = x - table[p, 5], y - table[p, 6]
    share = ti.min(ti.max((ax * table[p, 8] + ay * table[p, 9]) * table[p, 11], single(0)), single(1))
    ox, oy = ax - share * table[p, 8], ay - share * table[p, 9]
    depth = table[p, 7] + share * table[p, 10]
    if drawing.orthographic == 0:
        depth = single(1) / depth
    depth = ti.select(ox * ox + oy * oy < table[p, 12] * table[p, 12], depth, single(-1))
    return ti.select(depth > 0, depth, single(NOWHERE))
