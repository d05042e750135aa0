"""Where the ray through a sample of a picture meets a sphere or a line."""

import taichi as ti

from mpp_taichi.types import Template
from mpp_taichi.views._surface_shading import single

SAMPLES = ((-0.125, -0.375), (0.375, -0.125), (-0.375, 0.125), (0.125, 0.375))  # rotated grid, in pixels from the middle


@ti.func
def sphere_hit(table: Template, p, x, y, orthographic):
    """Depth where the ray through (x, y) meets sphere p, negative for none; the ray is (x, y, 1) t, or (x, y) + (0, 0, t).

    Measured from the point of the ray nearest to the centre, so that far small spheres keep their shape in single precision.
    """
    mx, my, dx, dy = table[p, 5], table[p, 6], x, y
    if orthographic == 1:
        mx, my, dx, dy = mx - x, my - y, single(0.0), single(0.0)
    mz = table[p, 7]
    d2 = dx * dx + dy * dy + 1
    nearest = (mx * dx + my * dy + mz) / d2
    ox, oy, oz = mx - nearest * dx, my - nearest * dy, mz - nearest
    under = table[p, 8] * table[p, 8] - (ox * ox + oy * oy + oz * oz)
    depth = single(-1.0)
    if under > 0:
        depth = nearest - ti.sqrt(under / d2)
    return depth


@ti.func
def line_hit(table: Template, p, x, y, orthographic):
    """Depth where the pixel position (x, y) lies on line p, negative where it lies beside."""
    ax, ay = x - table[p, 5], y - table[p, 6]
    share = ti.min(ti.max((ax * table[p, 8] + ay * table[p, 9]) * table[p, 11], single(0.0)), single(1.0))
    ox, oy = ax - share * table[p, 8], ay - share * table[p, 9]
    depth = single(-1.0)
    if ox * ox + oy * oy < table[p, 12] * table[p, 12]:
        depth = table[p, 7] + share * table[p, 10]
        if orthographic == 0:
            depth = single(1.0) / depth
    return depth
