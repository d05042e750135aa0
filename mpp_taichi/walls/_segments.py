"""Segments on the device: gap, normal and time of contact of a sphere and one of many segments, by its number.

The centre of a sphere that touches a segment lies on the outline of a stadium: two sides, which are the segment moved by a
radius, and half a circle around each end. In three dimensions everything happens in the x–y plane. A contact is the first time
at which gap ≤ 0 and the gap shrinks, as for other surfaces (`_geometry.py`).

A segment that moves as a formula says, or that turns, is looked at in its own frame (`_turnings.py`), in pieces of the flight
that are so short that each is off by a small part of the radius. A sphere on one side then cannot come to the other side.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.walls._base import Surface
from mpp_taichi.walls._geometry import turn
from mpp_taichi.walls._roots import first_contact, first_contact_curved, first_contact_falling, time_of_return
from mpp_taichi.walls._turnings import MOST_PIECES, good_for, place_in_wall, turned, velocity_in_wall, velocity_of_wall

FAR = 1e6  # radii; the gap of a segment that a sphere cannot press against, since it lies behind another segment
FLAT = 1e-6  # sine of the angle up to which two segments that meet count as one straight line


@ti.data_oriented
class WallSegments:
    """The segments of an enclosure, in fields.

    begin, end   (m,) ends when the time is 0 [length]
    along        (m,) unit vector from begin to end
    moving       (m,) velocity in the x–y plane; 0 of the segments of movers [length / time]
    movers       surfaces that move as formulas say, one for all segments that move alike
    mover        (m,) the number of the mover of each segment, −1: none
    neighbor     (m,) the segments that begin or end where this segment begins and where it ends, −1 where it has a free end or
                 meets more than one segment
    """

    def __init__(self, surfaces: Sequence[Surface]) -> None:
        """Allocate and fill; needs a started Taichi."""
        self.count = len(surfaces)
        self.movers, mover = movers(surfaces)
        begin, end, velocity = (
            np.array([getattr(surface, name)[:2] for surface in surfaces]) for name in ("point", "end", "velocity")
        )
        velocity[mover >= 0] = 0.0
        self.moves = bool(velocity.any())
        self.rubs = any(surface.friction > 0.0 for surface in surfaces)
        self.begin, self.end, self.along, self.moving = (ti.Vector.field(2, float) for _ in range(4))
        self.length, self.restitution_of = ti.field(float), ti.field(float)
        self.neighbor = ti.Vector.field(2, ti.i32)
        self.friction_of, self.mover = ti.field(float), ti.field(ti.i32)
        numbers, integers = ti.FieldsBuilder(), ti.FieldsBuilder()  # apart: see State._builder
        for field in (self.begin, self.end, self.along, self.moving, self.length, self.restitution_of):
            numbers.dense(ti.i, self.count).place(field)
        integers.dense(ti.i, self.count).place(self.neighbor)
        numbers.dense(ti.i, self.count if self.rubs else 1).place(self.friction_of)
        integers.dense(ti.i, self.count if self.movers else 1).place(self.mover)
        self._trees = [numbers.finalize(), integers.finalize()]
        real = np.float32 if ti.lang.impl.current_cfg().default_fp == ti.f32 else np.float64
        for field, values in (
            (self.begin, begin),
            (self.end, end),
            (self.along, np.array([surface.direction[:2] for surface in surfaces])),
            (self.moving, velocity),
            (self.length, np.hypot(*(end - begin).T)),
            (self.restitution_of, np.array([surface.restitution for surface in surfaces])),
        ):
            field.from_numpy(np.ascontiguousarray(values, dtype=real))
        self.neighbor.from_numpy(neighbors(begin, end, np.column_stack([velocity, mover])))
        if self.rubs:
            self.friction_of.from_numpy(np.array([surface.friction for surface in surfaces], dtype=real))
        if self.movers:
            self.mover.from_numpy(mover)

    def destroy(self) -> None:
        """Give the memory back."""
        for tree in self._trees:
            tree.destroy()

    @ti.func
    def gap(self, g, x, radius, time):
        """Distance [length] from a sphere at x to segment g; negative where they overlap."""
        along, across = self._place(g, x, time)
        return self._distance(g, along, across) - radius

    @ti.func
    def normal(self, g, x, time):
        """Unit vector from the nearest point of segment g to x."""
        along, across = self._place(g, x, time)
        flat = self._flat_normal(g, x, along, across, time)
        result = ti.Vector.zero(float, x.n)
        result[0], result[1] = flat[0], flat[1]
        for m in ti.static(range(len(self.movers))):
            if self.mover[g] == m:
                result = turned(self.movers[m], result, time, 1)
        return result

    @ti.func
    def normal_change(self, g, x, time, change):
        """Change of the normal where x is moved by a small `change`; zero but around an end."""
        result = ti.Vector.zero(float, x.n)
        along, across = self._place(g, x, time)
        if along < 0 or along > self.length[g]:
            distance = self._distance(g, along, across)
            if distance > 0:
                n = self._flat_normal(g, x, along, across, time)
                turned = turn(n, ti.Vector([change[0], change[1]]), distance)
                result[0], result[1] = turned[0], turned[1]
        return result

    @ti.func
    def velocity(self, g, x, time):
        """The velocity of segment g at a time, at its point x where it turns, with as many components as x."""
        result = ti.Vector.zero(float, x.n)
        if ti.static(self.moves):
            result[0], result[1] = self.moving[g][0], self.moving[g][1]
        for m in ti.static(range(len(self.movers))):
            if self.mover[g] == m:
                result = velocity_of_wall(self.movers[m], x, time)
        return result

    @ti.func
    def time_of_contact(self, g, x, v, radius, time, horizon):
        """Earliest s in 0 … horizon at which a sphere in straight flight meets segment g; infinity if there is none."""
        result = ti.math.inf
        if ti.static(len(self.movers) > 0):
            result = self._time_in_pieces(g, x, v, radius, time, horizon)
        else:
            result = self._time_on_tangent(g, x, v, radius, time, horizon)
        return result

    @ti.func
    def _time_in_pieces(self, g, x, v, radius, time, horizon):
        """The time of contact where a flight is curved in the frame of the segment."""
        result = ti.math.inf
        passed, flying = horizon * 0, True
        while flying:
            place, now, rest = x + v * passed, time + passed, horizon - passed
            piece = rest
            for m in ti.static(range(len(self.movers))):
                if self.mover[g] == m:
                    piece = ti.min(ti.max(good_for(self.movers[m], place, v, radius, now), horizon / MOST_PIECES), rest)
            s = self._time_on_tangent(g, place, v, radius, now, piece)
            if s <= piece:
                result = ti.min(passed + s, horizon)
            passed += piece
            flying = piece < rest and s > piece
        return result

    @ti.func
    def _time_on_tangent(self, g, x, v, radius, time, horizon):
        """The time of contact where the flight in the frame of the segment goes on along its tangent."""
        result = ti.math.inf
        along, across = self._place(g, x, time)
        u = self._relative(g, x, v, time)
        gap = self._distance(g, along, across) - radius
        if gap <= 0:
            if self._flat_normal(g, x, along, across, time).dot(u) < 0:
                result = 0.0
        elif not gap > horizon * u.norm():
            side = 1.0 if across > 0 else -1.0
            depth, speed, slide = ti.abs(across) - radius, side * self._cross(g, u), self.along[g].dot(u)
            if depth > 0:
                s = first_contact(depth, speed, 0.0, horizon)
                if s <= horizon:
                    if 0 <= along + slide * s <= self.length[g]:
                        result = s
            if result > horizon:
                # The stadium is convex: a sphere that misses both sides can only meet an end.
                for q in ti.static((self._from_begin, self._from_end)):
                    result = ti.min(result, first_contact_curved(q(g, x, time), u, radius, False, horizon))
        return result

    @ti.func
    def time_of_contact_falling(self, g, x, v, acceleration, radius, time, horizon):
        """Time of contact in a flight x + v s + acceleration s² / 2, which may lead around an end to the other side."""
        result = ti.math.inf
        along, across = self._place(g, x, time)
        u, a = self._relative(g, x, v, time), ti.Vector([acceleration[0], acceleration[1]])
        gap = self._distance(g, along, across) - radius
        if gap <= 0 and self._flat_normal(g, x, along, across, time).dot(u) < 0:
            result = 0.0
        else:
            length, slide, pull = self.length[g], self.along[g].dot(u), self.along[g].dot(a)
            speed, weight = self._cross(g, u), self._cross(g, a)
            for side in ti.static((1.0, -1.0)):
                touching = gap <= 0 and side * across >= 0 and 0 <= along <= length
                s = _passes(side * across - radius, side * speed, side * weight, touching)
                if s <= horizon:
                    if 0 <= along + s * (slide + s * pull / 2) <= length:
                        result = ti.min(result, s)
            last = ti.min(horizon, result)
            if _enters(across, speed, weight, radius) <= last:
                for k in range(2):
                    if _enters(along - k * length, slide, pull, radius) <= last:
                        q = self._from_end(g, x, time)
                        if k == 0:
                            q = self._from_begin(g, x, time)
                        s = first_contact_falling(q, u, a, radius, False, last)
                        if s > 0 or gap > 0:  # what overlaps and approaches is in contact now, and has been found
                            result = ti.min(result, s)
        return result if result <= horizon else ti.math.inf

    # Where two segments meet

    @ti.func
    def stands_back(self, g, x, radius, time, v, when, horizon):
        """Whether a sphere in straight flight, which meets segment g after `when`, meets its neighbour at a corner before."""
        along, across = self._place(g, x, time)
        other = self._neighbor_at(g, along)
        result = False
        if other >= 0:
            before = self.time_of_contact(other, x, v, radius, time, horizon)
            result = before < when or (before == when and other < g)
        return result

    @ti.func
    def support(self, g, x, radius, time):
        """Gap and normal of the half plane that holds a sphere at x off segment g, while it moves by a part of a radius.

        Where the nearest point of g is a corner, and the sphere is beside the other segment of the corner, that segment holds
        it. Segment g adds nothing at a corner that points to the sphere, so that its gap is FAR, and its own line at a corner
        that is hollow. A sphere before the point of a corner touches both segments there; the one with the lower number counts.
        """
        along, across = self._place(g, x, time)
        flat = self._flat_normal(g, x, along, across, time)
        gap = self._distance(g, along, across) - radius
        other = self._neighbor_at(g, along)
        if other >= 0:
            beside, apart = self._place(other, x, time)
            if 0 <= beside <= self.length[other]:
                away = self.along[g] if along < 0 else -self.along[g]
                rise = away.dot(self._across(other)) * (1.0 if apart > 0 else -1.0)
                gap, flat = FAR * radius, self._across(g) * (1.0 if across > 0 else -1.0)
                if rise > FLAT:
                    gap = ti.abs(across) - radius
            elif other < g:
                gap = FAR * radius
        result = ti.Vector.zero(float, x.n)
        result[0], result[1] = flat[0], flat[1]
        return gap, result

    @ti.func
    def can_hold(self, g, x, radius, time):
        """Whether segment g can hold a sphere at x that touches it; at a corner the other segment may hold it alone."""
        gap, _ = self.support(g, x, radius, time)
        return gap < 0.5 * FAR * radius

    @ti.func
    def _neighbor_at(self, g, along):
        """The neighbour of segment g at the end that is next to a place beyond it; −1 beside the segment."""
        result = -1
        if along < 0:
            result = self.neighbor[g][0]
        elif along > self.length[g]:
            result = self.neighbor[g][1]
        return result

    # Parts

    @ti.func
    def _place(self, g, x, time):
        """Coordinates of x along segment g, from its begin, and across it, to the left [length]."""
        q = self._from_begin(g, x, time)
        return self.along[g].dot(q), self._cross(g, q)

    @ti.func
    def _from_begin(self, g, x, time):
        return self._in_wall(g, x, time) - self.begin[g] - self._way(g, time)

    @ti.func
    def _from_end(self, g, x, time):
        return self._in_wall(g, x, time) - self.end[g] - self._way(g, time)

    @ti.func
    def _in_wall(self, g, x, time):
        """The place x in the x–y plane; of a segment that moves as a formula says, in its frame."""
        result = ti.Vector([x[0], x[1]])
        for m in ti.static(range(len(self.movers))):
            if self.mover[g] == m:
                place = place_in_wall(self.movers[m], x, time)
                result = ti.Vector([place[0], place[1]])
        return result

    @ti.func
    def _way(self, g, time):
        result = ti.Vector.zero(float, 2)
        if ti.static(self.moves):
            result = self.moving[g] * time
        return result

    @ti.func
    def _relative(self, g, x, v, time):
        result = ti.Vector([v[0], v[1]])
        if ti.static(self.moves):
            result -= self.moving[g]
        for m in ti.static(range(len(self.movers))):
            if self.mover[g] == m:
                u = velocity_in_wall(self.movers[m], x, v, time)
                result = ti.Vector([u[0], u[1]])
        return result

    @ti.func
    def _across(self, g):
        return ti.Vector([-self.along[g][1], self.along[g][0]])

    @ti.func
    def _cross(self, g, q):
        return self.along[g][0] * q[1] - self.along[g][1] * q[0]

    @ti.func
    def _distance(self, g, along, across):
        beyond = ti.max(-along, along - self.length[g])
        return ti.abs(across) if beyond <= 0 else ti.sqrt(beyond * beyond + across * across)

    @ti.func
    def _flat_normal(self, g, x, along, across, time):
        """The normal in the x–y plane; zero at an end."""
        result = self._across(g) * (1.0 if across > 0 else -1.0)
        if along < 0 or along > self.length[g]:
            q = self._from_end(g, x, time)
            if along < 0:
                q = self._from_begin(g, x, time)
            distance = q.norm()
            result = q / distance if distance > 0 else q
        return result


@ti.func
def _passes(gap, speed, acceleration, touching):
    """First s ≥ 0 at which gap + speed s + acceleration s² / 2 falls through 0, or infinity.

    A sphere that is `touching` (gap ≤ 0) and recedes meets the side again as in `first_contact`.
    """
    result = ti.math.inf
    if gap > 0:
        result = first_contact(gap, speed, acceleration, ti.math.inf)
    elif acceleration < 0 and speed >= 0:
        square = speed * speed - 2 * acceleration * gap
        if touching:
            result = time_of_return(speed, acceleration, square)
        elif square >= 0:
            result = (speed + ti.sqrt(square)) / -acceleration
    return result


@ti.func
def _enters(place, speed, acceleration, reach):
    """First s ≥ 0 at which |place + speed s + acceleration s² / 2| ≤ reach, but for rounding; infinity if never."""
    side = 1.0 if place > 0 else -1.0
    gap = side * place - reach * 1.001
    result = place * 0
    if gap > 0:
        result = first_contact(gap, side * speed, side * acceleration, ti.math.inf)
    return result


def movers(surfaces: Sequence[Surface]) -> tuple[tuple[Surface, ...], np.ndarray]:
    """One surface for all that move alike as formulas say, and the number of this surface for each, (m,) int32; −1: none.

    Segments with a velocity across the x–y plane are among them where they have a friction, which then drags along z.
    """
    found: dict[tuple[Any, ...], int] = {}
    chosen: list[Surface] = []
    numbers = np.full(len(surfaces), -1, np.int32)
    for k, surface in enumerate(surfaces):
        if surface.has_motion or surface.has_turning or (surface.friction > 0.0 and surface.velocity[2] != 0.0):
            key = (id(surface.motion), surface.turning and surface.turning.key, surface.velocity)
            if key not in found:
                found[key] = len(chosen)
                chosen.append(surface)
            numbers[k] = found[key]
    return tuple(chosen), numbers


def neighbors(begin: np.ndarray, end: np.ndarray, velocity: np.ndarray) -> np.ndarray:
    """For each segment the one other that meets it at its begin, and at its end, (m, 2) int32; −1: none, or more than one.

    Only segments with the same row of `velocity` meet; a row may have more numbers than the velocity.
    """
    places: dict[tuple[float, ...], list[int]] = {}
    for points in (begin, end):
        for number, (point, moving) in enumerate(zip(points, velocity)):
            places.setdefault((*(point + 0.0), *(moving + 0.0)), []).append(number)  # + 0.0: of −0.0 a 0.0
    found = np.full((len(begin), 2), -1, np.int32)
    for column, points in enumerate((begin, end)):
        for number, (point, moving) in enumerate(zip(points, velocity)):
            met = places[(*(point + 0.0), *(moving + 0.0))]
            if len(met) == 2:
                found[number, column] = met[0] if met[1] == number else met[1]
    return found
