"""Friction of a sphere on a wall: Coulomb's law for one bounce of a sphere that does not spin."""

import taichi as ti

from mpp_taichi.types import Template


@ti.func
def rubbed(walls: Template, surface, n, v, wall_velocity, w, impulse):
    """The velocity of a sphere after the friction of a bounce, and the kinetic energy that it takes in the frame of the wall.

    surface           number of the surface, whose coefficient is μ
    n                 normal of the surface
    v, wall_velocity  velocity of the sphere after the impulse along n, and of the point of the wall that it touches
    w                 inverse masses of the sphere along the axes, 0 along a held axis
    impulse           J, the impulse along n

    The impulse along the wall is −min(μ J, m |u|) u/|u|, where u is the part along the wall of the relative velocity: the
    friction slows the sliding of the sphere and never reverses it. The energy is P |u| − P² / (2 m) for an impulse of size P.
    Held axes are left out of n and u, so that the speed along n stays as the bounce made it.
    """
    normal, slide = n, v - wall_velocity
    for k in ti.static(range(n.n)):
        if w[k] == 0.0:
            normal[k], slide[k] = 0.0, 0.0
    square = normal.norm_sqr()
    if square > 0.0:
        slide -= normal * (normal.dot(slide) / square)
    speed, weight = slide.norm(), w.max()
    after, lost = v, ti.cast(0.0, float)
    if speed > 0.0 and weight > 0.0:
        push = ti.min(walls.friction(surface) * ti.max(impulse, 0.0), speed / weight)
        after = v - slide * (push * weight / speed)
        lost = push * (speed - 0.5 * push * weight)
    return after, lost


@ti.func
def work_of_wall(wall_velocity, before, after, w):
    """The work of a wall on a sphere in a bounce [energy]: its velocity at the touched point times the impulse."""
    result = ti.cast(0.0, float)
    for k in ti.static(range(before.n)):
        if w[k] > 0.0:
            result += wall_velocity[k] * (after[k] - before[k]) / w[k]
    return result
