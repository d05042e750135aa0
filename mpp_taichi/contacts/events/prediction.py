"""Prediction of the next event of a sphere in an event-driven run: a contact, or the crossing of a side of its cell."""

import taichi as ti

from mpp_taichi.contacts.events.lines import Lines
from mpp_taichi.contacts.events.lookahead import LookAhead
from mpp_taichi.types import Template
from mpp_taichi.walls._roots import first_contact_curved, first_contact_falling
from mpp_taichi.walls._surfaces import WallSurfaces

# Relative tolerance of the squared distance in the first test of a pair; more than round-off, even in f32.
SLACK = 1e-5


@ti.data_oriented
class Prediction:
    """Finds the earliest event of a sphere. Partners are numbered: sphere j: j; surface w: −1 − w; side s: count + 1 + s."""

    def __init__(self, look_ahead: LookAhead, walls: WallSurfaces, lines: Lines) -> None:
        """Place the fields, for the spheres, cells and queue of `look_ahead`, between these walls."""
        self.spheres, self.cells, self.queue = look_ahead.spheres, look_ahead.cells, look_ahead.queue
        self.look_ahead, self.walls = look_ahead, walls
        self.count = self.spheres.count
        # The next contact of a sphere that crosses a side of its cell before.
        self.contact_time = lines.field(self.spheres.wide)
        self.contact_partner, self.contact_stamp = lines.field(ti.i32), lines.field(ti.i32)
        self.lasting = (self.contact_time, self.contact_partner, self.contact_stamp)

    @ti.func
    def predict(self, i, time, crossed):
        """Find the next event of sphere i after `time`, and put it into the queue; `crossed`: the side it crossed, or −2.

        After a crossing the contact that was found before is still valid if its partner has had no other contact; then only
        the cells that are new neighbours are searched.
        """
        x, v = self.spheres.position_at(i, time), self.spheres.velocity_at(i, time)
        a = self.spheres.acceleration(i)
        side = crossed
        partner, stamp = self.count, 0
        contact = ti.cast(ti.math.inf, self.spheres.wide)
        if crossed >= 0:
            contact, partner, stamp = self.contact_time[i], self.contact_partner[i], self.contact_stamp[i]
            if partner >= 0 and partner < self.count:
                if self.spheres.contacts[partner] != stamp:
                    side = -2
                    contact = ti.cast(ti.math.inf, self.spheres.wide)
        soonest = ti.cast(contact - time, float)
        found = self.count
        if side < 0:
            for w in ti.static(range(self.walls.plain_count)):
                s = self._until_wall(w, i, x, v, a, time, soonest)
                if s < soonest:
                    soonest, found = s, -1 - w
            if ti.static(self.walls.segment_count > 0):
                for g in range(self.walls.segment_count):
                    s = self._until_wall(self.walls.plain_count + g, i, x, v, a, time, soonest)
                    if s < soonest:
                        soonest, found = s, -1 - (self.walls.plain_count + g)
        count = self.cells.gather(i, side)
        ahead = self.look_ahead.fetches.take(count)
        m = 0
        while m < count:
            self.look_ahead.fetches.fetch(ahead, m)
            j = self.cells.near[m]
            count = self.cells.follow(i, m, count)
            if j != i:
                s = self._until_sphere(i, j, self.cells.image[m], x, v, a, time, soonest)
                if s < soonest:
                    soonest, found = s, j
            m += 1
        if found != self.count:
            contact, partner, stamp = time + ti.cast(soonest, self.spheres.wide), found, 0
            if found >= 0:
                stamp = self.spheres.contacts[found]
        leaving, through = self.cells.crossing(x, v, a, i)
        crossing = time + ti.cast(leaving, self.spheres.wide)
        if crossing < contact:
            self.contact_time[i], self.contact_partner[i], self.contact_stamp[i] = contact, partner, stamp
            contact, partner = crossing, self.count + 1 + through
        self.queue.change(i, contact, partner, stamp)

    @ti.func
    def _until_sphere(self, i, j, image, x, v, a, time, horizon):
        """Time until contact of sphere i, at x with v now, with an image of sphere j."""
        q, u = x - self.spheres.position_at(j, time), v - self.spheres.velocity_at(j, time)
        if image != 0:
            q = self.cells.seen(q, image)
        reach = self.spheres.radius(i) + self.spheres.radius(j)
        result = ti.math.inf
        if ti.static(self.spheres.falls_together):
            # Most pairs separate or pass. One branch excludes both, by a test that never excludes a contact.
            away, fast, near = q.dot(u), u.norm_sqr(), q.norm_sqr()
            if (away < 0) & (away * away >= fast * (near * ti.static(1 - SLACK) - reach * reach)):
                result = first_contact_curved(q, u, reach, False, horizon)
        else:
            result = first_contact_falling(q, u, a - self.spheres.acceleration(j), reach, False, horizon)
        if ti.static(self.spheres.has_held):
            if self.spheres.is_held(i) and self.spheres.is_held(j):
                result = ti.math.inf
        # After a bounce two spheres in straight flight separate, whatever round-off says, until one has another contact.
        if ti.static(self.spheres.falls_together):
            if result == 0 and self.spheres.last_partner[i] == j and self.spheres.last_partner[j] == i:
                result = ti.math.inf
        return result

    @ti.func
    def _until_wall(self, w: Template, i, x, v, a, time, horizon):
        """Time until contact of sphere i with surface w."""
        now = ti.cast(time, float)
        radius = self.spheres.radius(i)
        result = ti.math.inf
        if ti.static(self.spheres.has_gravity):
            result = self.walls.time_of_contact_falling(w, x, v, a, radius, now, horizon)
        else:
            result = self.walls.time_of_contact(w, x, v, radius, now, horizon)
            if result == 0 and self.spheres.last_partner[i] == -1 - w:
                result = ti.math.inf
        if ti.static(self.spheres.has_held):
            if self.spheres.is_held(i):
                result = ti.math.inf
        return result
