"""Turning walls in kernels: places and velocities in the frame of the wall, and how long a tangent is good for.

A surface turns about a point c, which moves along with it: the point X of the surface is at c + d + R (X − c) at a time, with
the displacement d and the rotation R by the angle θ of that time. A sphere at x is at

    y = c + Rᵀ (x − c − d),    y′ = Rᵀ (v − d′ − θ′ a × (x − c − d))

in the frame of the surface, in which the surface is at rest, as it is when d = 0 and θ = 0. Contacts are looked for there.
A straight flight is curved in this frame,

    y″ = −Rᵀ (2 θ′ a × u + θ′² a × (a × r) + θ″ a × r + d″),    u = R y′, r = x − c − d,

and is taken along its tangent for a time in which it leaves the tangent by a small part of the radius of the sphere.
"""

from typing import Any

import taichi as ti

from mpp_taichi.arithmetic.elementary_functions import elementary
from mpp_taichi.arithmetic.formula_steps import KernelArithmetic
from mpp_taichi.arithmetic.traced import traced
from mpp_taichi.types import Template
from mpp_taichi.walls._motions import at_time

PART_OF_RADIUS = 1.0 / 16.0  # up to which a flight may leave its tangent before the next tangent is taken
MOST_PIECES = 16384  # of a flight; with so many of them a flight may leave one tangent for all by 10⁷ radii


@ti.func
def place_in_wall(surface: Template, x, time):
    """The place x in the frame of the surface."""
    about = _about(surface, x)
    return about + turned(surface, _from_axis(surface, x, time), time, -1)


@ti.func
def velocity_in_wall(surface: Template, x, v, time):
    """The velocity in the frame of the surface of a sphere at x with the velocity v."""
    return turned(surface, v - velocity_of_wall(surface, x, time), time, -1)


@ti.func
def velocity_of_wall(surface: Template, x, time):
    """d′ + θ′ a × r: the velocity at the place x of a body to which the surface is fixed."""
    result = ti.Vector.zero(float, x.n)
    shift = shift_of(surface, x.n, time)
    for k in ti.static(range(x.n)):
        result[k] = shift[x.n + k]
    if ti.static(surface.has_turning):
        rates = rates_of(surface, time)
        result += rates[0] * _cross(surface, _from_axis(surface, x, time))
    return result


@ti.func
def turned(surface: Template, vector, time, sign: Template):
    """R times a vector, or Rᵀ where the sign is −1."""
    result = vector
    if ti.static(surface.has_turning):
        circle = circle_of(surface, time)
        once = _cross(surface, vector)
        result = vector + sign * circle[1] * once + (1.0 - circle[0]) * _cross(surface, once)
    return result


@ti.func
def good_for(surface: Template, x, v, radius, time):
    """How long a flight from x leaves its tangent in the frame of the surface by less than a part of the radius [time]."""
    result = ti.math.inf
    shift = shift_of(surface, x.n, time)
    second = ti.Vector.zero(float, x.n)
    for k in ti.static(range(x.n)):
        second[k] = shift[2 * x.n + k]
    bending = second.norm()
    if ti.static(surface.has_turning):
        rates = rates_of(surface, time)
        distance = _cross(surface, _from_axis(surface, x, time)).norm()
        u = v - velocity_of_wall(surface, x, time)
        bending += 2.0 * ti.abs(rates[0]) * u.norm() + (rates[0] * rates[0] + ti.abs(rates[1])) * distance
    if bending > 0.0 and radius > 0.0:
        result = ti.sqrt(2.0 * PART_OF_RADIUS * radius / bending)
    return result


@ti.func
def _about(surface: Template, x):
    result = ti.Vector.zero(float, x.n)
    if ti.static(surface.has_turning):
        result = ti.Vector([surface.turning.about[k] for k in ti.static(range(x.n))], float)
    return result


@ti.func
def _from_axis(surface: Template, x, time):
    """r: the vector from the point c + d of the axis to x."""
    way = x - _about(surface, x)
    shift = shift_of(surface, x.n, time)
    for k in ti.static(range(x.n)):
        way[k] -= shift[k]
    return way


@ti.func
def _cross(surface: Template, vector):
    """a × vector; in two components the axis is z, or the opposite direction."""
    result = ti.Vector.zero(float, vector.n)
    a = ti.static(surface.turning.axis)
    if ti.static(vector.n == 2):
        result = ti.Vector([-a[2] * vector[1], a[2] * vector[0]])
    else:
        result = ti.Vector(
            [a[1] * vector[2] - a[2] * vector[1], a[2] * vector[0] - a[0] * vector[2], a[0] * vector[1] - a[1] * vector[0]]
        )
    return result


@traced
def shift_of(surface: Any, size: int, time: Any) -> list[Any]:
    """d, d′ and d″ at a time, `size` components of each."""
    found = [ti.cast(speed * ti.cast(time, float), float) for speed in surface.velocity[:size]]
    found += [ti.cast(speed, float) for speed in surface.velocity[:size]] + [ti.cast(0.0, float)] * size
    if surface.motion is None:
        return found
    law = surface.motion
    first, second = at_time(law.motion, time), at_time(law.change, time)[law.dimensions :]
    parts = [first[: law.dimensions], first[law.dimensions :], second]
    return [ti.cast(each, float) for part in parts for each in part[:size]]


@traced
def rates_of(surface: Any, time: Any) -> list[Any]:
    """θ′ and θ″ at a time."""
    return [ti.cast(each, float) for each in at_time(surface.turning.angle.change, time)]


@traced
def circle_of(surface: Any, time: Any) -> list[Any]:
    """The cosine and the sine of θ at a time."""
    angle = KernelArithmetic.kept(ti.cast(at_time(surface.turning.angle.motion, time)[0], float))
    return [KernelArithmetic.kept(elementary(name, angle)) for name in ("cos", "sin")]
