"""The surfaces of an enclosure on the device, by their numbers.

Planes, cylinders and spheres are few, and known when kernels are compiled; a loop over them is unrolled. Segments may be many,
and are in fields. A solver loops over both, with one body, which takes the number of the surface as a template:

    for s in ti.static(range(self.walls.plain_count)):
        body(s, …)
    if ti.static(self.walls.segment_count > 0):
        for g in range(self.walls.segment_count):
            body(self.walls.plain_count + g, …)
"""

from typing import Any

import taichi as ti

from mpp_taichi.arithmetic.point_lookup import provide
from mpp_taichi.scene.formulas.program import points_of
from mpp_taichi.types import Template
from mpp_taichi.walls import _geometry
from mpp_taichi.walls._base import Enclosure, Surface
from mpp_taichi.walls._segments import WallSegments


@ti.data_oriented
class WallSurfaces:
    """The formulas of `_geometry.py` and `_segments.py`, by the number of the surface: a Python number, or a segment's number.

    surfaces         the surfaces of the enclosure, segments last
    account_count    number of the accounts of the enclosure
    heats            whether some surface is thermal
    rubs             whether some surface has a friction
    works            whether some surface moves, so that it does work
    curves           whether some surface moves as a formula says, so that contacts are predicted along tangents
    pushes           whether a sphere may be found in some surface that curves its flight, and is put back (`sunk`)
    """

    def __init__(self, enclosure: Enclosure) -> None:
        """Allocate and fill; needs a started Taichi."""
        self.surfaces = enclosure.surfaces
        self.segment_count = len(enclosure.segments)
        self.plain_count = len(self.surfaces) - self.segment_count
        self.accounts = enclosure.account_of
        self.account_count = len(enclosure.accounts)
        self.heats = any(surface.is_thermal for surface in self.surfaces)
        self.rubs = any(surface.friction > 0.0 for surface in self.surfaces)
        self.works = any(surface.moves for surface in self.surfaces)
        self.curves = any(surface.has_motion or surface.has_turning for surface in self.surfaces)
        self.pushes = any(map(is_pushing, self.surfaces))
        for law in (law for surface in self.surfaces for law in surface.laws):
            provide(points_of(law))
        self.segments: Any = None
        self._tree: Any = None
        if any(surface.kind == "segment" for surface in self.surfaces[: self.plain_count]):
            raise ValueError("segments must be the last surfaces of an enclosure")
        if self.segment_count:
            self.segments = WallSegments(enclosure.segments)
            self.segment_account = ti.field(ti.i32)
            builder = ti.FieldsBuilder()
            builder.dense(ti.i, self.segment_count).place(self.segment_account)
            self._tree = builder.finalize()
            for g, account in enumerate(self.accounts[self.plain_count :]):
                self.segment_account[g] = account

    def destroy(self) -> None:
        """Give the memory back."""
        for part in (self.segments, self._tree):
            if part is not None:
                part.destroy()

    def is_plane(self, w: Any) -> bool:
        """Whether surface w is a plane."""
        return is_known(w) and self.surfaces[w].kind == "plane"

    def is_bowl(self, w: Any) -> bool:
        """Whether surface w is curved around the particles."""
        return is_known(w) and self.surfaces[w].kind != "plane" and self.surfaces[w].inside

    @ti.func
    def gap(self, w: Template, x, radius, time):
        """Distance [length] from a sphere at x to surface w; negative where they overlap."""
        result = radius * 0
        if ti.static(is_known(w)):
            result = _geometry.gap(self.surfaces[w], x, radius, time)
        else:
            result = self.segments.gap(w - self.plain_count, x, radius, time)
        return result

    @ti.func
    def normal(self, w: Template, x, time):
        """Unit vector towards x at the point of surface w next to x; zero on an axis, at a centre and at an end."""
        result = ti.Vector.zero(float, x.n)
        if ti.static(is_known(w)):
            result = _geometry.normal(self.surfaces[w], x, time)
        else:
            result = self.segments.normal(w - self.plain_count, x, time)
        return result

    @ti.func
    def normal_change(self, w, x, time, change):
        """Change of the normal of surface w, a number that is known only when a kernel runs, where x is moved by a `change`."""
        result = ti.Vector.zero(float, x.n)
        for s in ti.static(range(self.plain_count)):
            if w == s:
                result = _geometry.normal_change(self.surfaces[s], x, time, change)
        if ti.static(self.segment_count > 0):
            if w >= self.plain_count:
                result = self.segments.normal_change(w - self.plain_count, x, time, change)
        return result

    @ti.func
    def velocity(self, w: Template, x, time):
        """The velocity of surface w at a time, at its point x where it turns, with as many components as x.

        In place of the point that a sphere touches, x may be the centre of the sphere for the part along the normal.
        """
        result = ti.Vector.zero(float, x.n)
        if ti.static(is_known(w)):
            result = _geometry.surface_velocity(self.surfaces[w], x, time)
        else:
            result = self.segments.velocity(w - self.plain_count, x, time)
        return result

    @ti.func
    def restitution(self, w: Template):
        """The restitution of surface w."""
        result = ti.cast(1.0, float)
        if ti.static(is_known(w)):
            result = ti.cast(self.surfaces[w].restitution, float)
        else:
            result = self.segments.restitution_of[w - self.plain_count]
        return result

    @ti.func
    def temperature(self, w):
        """k T of surface w, a number that is known only when a kernel runs, and the seed of its velocities; −1 of a mirror."""
        result, seed = ti.cast(-1.0, float), ti.u32(0)
        for s in ti.static(range(self.plain_count)):
            if ti.static(self.surfaces[s].is_thermal):
                if w == s:
                    result, seed = self.surfaces[s].temperature, ti.u32(self.surfaces[s].seed)
        return result, seed

    @ti.func
    def friction(self, w):
        """The coefficient of the friction on surface w, a number that is known only when a kernel runs."""
        result = ti.cast(0.0, float)
        for s in ti.static(range(self.plain_count)):
            if ti.static(self.surfaces[s].friction > 0.0):
                if w == s:
                    result = ti.cast(self.surfaces[s].friction, float)
        if ti.static(self.segment_count > 0):
            if ti.static(self.segments.rubs):
                if w >= self.plain_count:
                    result = self.segments.friction_of[w - self.plain_count]
        return result

    @ti.func
    def sunk(self, w, gap):
        """The depth of a sphere in surface w, a number known only when a kernel runs, from which it is to be put back; or 0.

        A flight is taken along tangents in the frame of a surface that turns, so that a sphere that lies on the surface sinks
        into it by a small part of its radius from one tangent to the next. It must not add up.
        """
        result = ti.cast(0.0, float)
        for s in ti.static(range(self.plain_count)):
            if ti.static(is_pushing(self.surfaces[s])):
                if w == s:
                    result = ti.max(-gap, 0.0)
        if ti.static(self.segment_count > 0):
            if ti.static(len(self.segments.movers) > 0):
                if w >= self.plain_count:
                    if self.segments.mover[w - self.plain_count] >= 0:
                        result = ti.max(-gap, 0.0)
        return result

    @ti.func
    def account(self, w: Template):
        """The number under which the impulse on surface w is summed."""
        result = 0
        if ti.static(is_known(w)):
            result = self.accounts[w]
        else:
            result = self.segment_account[w - self.plain_count]
        return result

    @ti.func
    def account_of(self, w):
        """The account of surface w, a number that is known only when a kernel runs."""
        result = 0
        for s in ti.static(range(self.plain_count)):
            if w == s:
                result = self.account(s)
        if ti.static(self.segment_count > 0):
            if w >= self.plain_count:
                result = self.account(w)
        return result

    @ti.func
    def support(self, w, x, radius, time):
        """Gap and normal of segment w for a sphere that rests: see `WallSegments.support`."""
        return self.segments.support(w - self.plain_count, x, radius, time)

    @ti.func
    def stands_back(self, w, x, radius, time, v, when, horizon):
        """Whether a sphere meets another segment before segment w at their corner: see `WallSegments.stands_back`."""
        return self.segments.stands_back(w - self.plain_count, x, radius, time, v, when, horizon)

    @ti.func
    def can_hold(self, w: Template, x, radius, time):
        """Whether surface w can hold a sphere at x that touches it; at a corner the other segment may hold it alone."""
        result = True
        if ti.static(not is_known(w)):
            result = self.segments.can_hold(w - self.plain_count, x, radius, time)
        return result

    @ti.func
    def time_of_contact(self, w: Template, x, v, radius, time, horizon):
        """Earliest s in 0 … horizon at which a sphere in straight flight meets surface w; infinity if there is none."""
        result = ti.math.inf
        if ti.static(is_known(w)):
            result = _geometry.time_of_contact(self.surfaces[w], x, v, radius, time, horizon)
        else:
            result = self.segments.time_of_contact(w - self.plain_count, x, v, radius, time, horizon)
        return result

    @ti.func
    def time_of_contact_falling(self, w: Template, x, v, acceleration, radius, time, horizon):
        """The time of contact in a flight x + v s + acceleration s² / 2."""
        result = ti.math.inf
        if ti.static(is_known(w)):
            result = _geometry.time_of_contact_falling(self.surfaces[w], x, v, acceleration, radius, time, horizon)
        else:
            result = self.segments.time_of_contact_falling(w - self.plain_count, x, v, acceleration, radius, time, horizon)
        return result

    @ti.func
    def extent(self, w: Template, dimensions: Template):
        """Size of the numbers that describe surface w, whose rounding is part of the error of a gap [length]."""
        result = ti.cast(0.0, float)
        if ti.static(is_known(w)):
            point = ti.Vector([self.surfaces[w].point[c] for c in ti.static(range(dimensions))], float)
            result = point.norm() + self.surfaces[w].radius
        else:
            g = w - self.plain_count
            result = self.segments.begin[g].norm() + self.segments.end[g].norm()
        return result

    @ti.func
    def touched(self, w, x, radius, time):
        """Gap, normal, velocity at the touched point, restitution and account of surface w, known only when a kernel runs."""
        gap, n, velocity = radius * 0, ti.Vector.zero(float, x.n), ti.Vector.zero(float, x.n)
        restitution, account = ti.cast(1.0, float), 0
        for s in ti.static(range(self.plain_count)):
            if w == s:
                gap, n = self.gap(s, x, radius, time), self.normal(s, x, time)
                velocity = self.velocity(s, x - (gap + radius) * n, time)
                restitution, account = self.restitution(s), self.account(s)
        if ti.static(self.segment_count > 0):
            if w >= self.plain_count:
                gap, n = self.gap(w, x, radius, time), self.normal(w, x, time)
                velocity = self.velocity(w, x - (gap + radius) * n, time)
                restitution, account = self.restitution(w), self.account(w)
        return gap, n, velocity, restitution, account


def is_pushing(surface: Surface) -> bool:
    """Whether a sphere that is found in a surface is put back onto it: turning carries it, or it is a segment in motion."""
    return surface.is_carried or (surface.kind == "segment" and surface.has_motion)


def is_known(w: Any) -> bool:
    """Whether the number of a surface is known when a kernel is compiled."""
    return isinstance(w, int)
