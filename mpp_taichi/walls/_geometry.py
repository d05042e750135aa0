"""Formulas of a surface that is known when kernels are compiled: gap, normal, time of contact.

A surface that moves as a formula says is taken to move at its velocity at the time from which a contact is looked for: over a
drift of h its place is then off by h²/2 times its acceleration. Where a sphere is found in it, it is in contact now. A surface
that turning carries to another place is looked at in its own frame (`_turnings.py`), in pieces of the flight that are so short
that each is off by a small part of the radius.

Positions and velocities have two or three components; in two dimensions a sphere, or a cylinder along z, is a circle.
A contact is the first time at which gap ≤ 0 and the gap shrinks: a sphere that already overlaps the surface is in
contact now if it approaches and has none while it recedes. Round-off then cannot make it fall through.
Source: Bannerman, Strobl, Formella, Pöschel, Comput. Particle Mech. 1 (2014) 191 (arXiv:1211.6718).
"""

import taichi as ti

from mpp_taichi.types import Template
from mpp_taichi.walls._motions import motion_of
from mpp_taichi.walls._roots import first_contact, first_contact_curved, first_contact_falling
from mpp_taichi.walls._turnings import MOST_PIECES, good_for, place_in_wall, turned, velocity_in_wall, velocity_of_wall


@ti.func
def gap(surface: Template, x, radius, time):
    """Distance [length] from a sphere at x to the surface; negative where they overlap."""
    result = radius * 0
    q = _from_surface(surface, x, time)
    if ti.static(surface.kind == "plane"):
        result = _along(surface, q) - radius
    elif ti.static(surface.inside):
        result = surface.radius - radius - q.norm()
    else:
        result = q.norm() - surface.radius - radius
    return result


@ti.func
def normal(surface: Template, x, time):
    """Unit vector into the free side at the point of the surface next to x; zero on the axis or at the centre."""
    result = ti.Vector.zero(float, x.n)
    if ti.static(surface.kind == "plane"):
        result = _direction(surface, x)
    else:
        # Of a vector that is long beside the radius, the first projection leaves a part along the axis, its rounding error.
        q = _across(surface, _from_surface(surface, x, time))
        length = q.norm()
        if length > 0:
            result = q / (ti.static(-1.0 if surface.inside else 1.0) * length)
    if ti.static(surface.is_carried):
        result = turned(surface, result, time, 1)
    return result


@ti.func
def normal_change(surface: Template, x, time, change):
    """Change of the normal where x is moved by a small `change`; zero at a plane, on the axis and at the centre."""
    result = ti.Vector.zero(float, x.n)
    if ti.static(surface.kind != "plane"):
        q = _across(surface, _from_surface(surface, x, time))
        length = q.norm()
        if length > 0:
            result = turn(q / length, _across(surface, change), ti.static(-1.0 if surface.inside else 1.0) * length)
    return result


@ti.func
def turn(n, change, length):
    """Change of the unit vector n along a vector of this length, of which `change` is a small change."""
    return (change - n * n.dot(change)) / length


@ti.func
def surface_velocity(surface: Template, x, time):
    """The velocity of the surface at a time, at its point x where it turns, with as many components as x."""
    result = ti.Vector.zero(float, x.n)
    if ti.static(surface.has_turning):
        result = velocity_of_wall(surface, x, time)
    else:
        result = _velocity_of_shift(surface, x, time)
    return result


@ti.func
def _velocity_of_shift(surface: Template, x, time):
    """The velocity of the surface without its turning."""
    result = ti.Vector([surface.velocity[k] for k in ti.static(range(x.n))], float)
    if ti.static(surface.has_motion):
        now = motion_of(surface, time)
        for k in ti.static(range(x.n)):
            result[k] = now[x.n + k]
    return result


@ti.func
def time_of_contact(surface: Template, x, v, radius, time, horizon):
    """Earliest s in 0 … horizon at which a sphere in straight flight meets the surface; infinity if there is none."""
    result = ti.math.inf
    if ti.static(surface.is_carried):
        result = _time_in_pieces(surface, x, v, radius, time, horizon)
    else:
        result = _time_on_tangent(surface, x, v, radius, time, horizon)
    return result


@ti.func
def _time_in_pieces(surface: Template, x, v, radius, time, horizon):
    """The time of contact where a flight is curved in the frame of the surface."""
    result = ti.math.inf
    passed, flying = horizon * 0, True
    while flying:
        place, now, rest = x + v * passed, time + passed, horizon - passed
        piece = ti.min(ti.max(good_for(surface, place, v, radius, now), horizon / MOST_PIECES), rest)
        s = _time_on_tangent(surface, place, v, radius, now, piece)
        if s <= piece:
            result = ti.min(passed + s, horizon)
        passed += piece
        flying = piece < rest and s > piece
    return result


@ti.func
def _time_on_tangent(surface: Template, x, v, radius, time, horizon):
    """The time of contact where the surface, or the flight in the frame of the surface, goes on along its tangent."""
    result = ti.math.inf
    u = _relative(surface, x, v, time)
    if ti.static(surface.kind == "plane"):
        result = first_contact(gap(surface, x, radius, time), _along(surface, u), 0.0, horizon)
    else:
        q = _from_surface(surface, x, time)
        result = first_contact_curved(q, _across(surface, u), _reach(surface, radius), surface.inside, horizon)
    return result


@ti.func
def _relative(surface: Template, x, v, time):
    """The velocity v of a sphere relative to the surface; where turning carries the surface, in its frame."""
    result = v
    if ti.static(surface.is_carried):
        result = velocity_in_wall(surface, x, v, time)
    else:
        result = v - _velocity_of_shift(surface, x, time)
    return result


@ti.func
def time_of_contact_falling(surface: Template, x, v, acceleration, radius, time, horizon):
    """Time of contact in a flight x + v s + acceleration s² / 2, which makes the distance to a curved surface a quartic."""
    result = ti.math.inf
    if ti.static(surface.kind == "plane"):
        speed = _along(surface, v - surface_velocity(surface, x, time))
        result = first_contact(gap(surface, x, radius, time), speed, _along(surface, acceleration), horizon)
    else:
        q = _from_surface(surface, x, time)
        u = _across(surface, v - surface_velocity(surface, x, time))
        a = _across(surface, acceleration)
        result = first_contact_falling(q, u, a, _reach(surface, radius), surface.inside, horizon)
    return result


@ti.func
def _reach(surface: Template, radius):
    """Distance of a touching sphere's centre from the axis or centre."""
    return surface.radius - radius if ti.static(surface.inside) else surface.radius + radius


@ti.func
def _direction(surface: Template, x):
    return ti.Vector([surface.direction[k] for k in ti.static(range(x.n))], float)


@ti.func
def _along(surface: Template, vector):
    """The part of a vector along a plane's normal, by the normal's components other than 0: most planes lie along axes."""
    axes = ti.static([k for k in range(vector.n) if surface.direction[k] != 0.0])
    result = surface.direction[axes[0]] * vector[axes[0]]
    for k in ti.static(axes[1:]):
        result += surface.direction[k] * vector[k]
    return result


@ti.func
def _from_surface(surface: Template, x, time):
    """The vector to x from the surface's point, axis or centre at this time."""
    point = ti.Vector([surface.point[k] for k in ti.static(range(x.n))], float)
    way = x
    if ti.static(surface.is_carried):
        way = place_in_wall(surface, x, time) - point
    else:
        way = x - point
        for k in ti.static(range(x.n)):
            if ti.static(surface.velocity[k] != 0.0):
                way[k] -= surface.velocity[k] * time
        if ti.static(surface.has_motion):
            now = motion_of(surface, time)
            for k in ti.static(range(x.n)):
                way[k] -= now[k]
    return _across(surface, way)


@ti.func
def _across(surface: Template, vector):
    """The part of a vector across a cylinder's axis; all of it for other kinds."""
    result = vector
    if ti.static(surface.kind == "cylinder"):
        axis = _direction(surface, vector)
        result = vector - axis * axis.dot(vector)
    return result
