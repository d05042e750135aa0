"""Playing an island: the flights and contacts of its spheres within a piece of a drift, event by event."""

import math
from typing import Any

import taichi as ti

from mpp_taichi.arithmetic.particle_update import drifted
from mpp_taichi.contacts.sweep.played_spheres import NOTHING
from mpp_taichi.contacts.sweep.sweep_parts import SweepParts
from mpp_taichi.types import Template

LOOK_AGAIN = -1  # stamp of a prediction that says only that there is no contact before


@ti.data_oriented
class IslandPlayer:
    """The spheres of an island on their way from contact to contact.

    The next event of the island is taken from the tournament of `Islands`, the `rule` resolves it, and the next events of the
    spheres whose velocities it changed are predicted anew. A sphere outside that a member is going to hit is noted in
    `links`; the islands are then joined and played again. Spheres are numbered by slots.
    """

    def __init__(self, parts: SweepParts, rule: Any, links: Any, event_limit: int) -> None:
        """Bind the parts; `rule` has `resolve` (PairRule, GroupRule), `links` has `wish` (Islands, DeviceIslands)."""
        self.bounce, self.tally, self.slots, self.played = parts.bounce, parts.tally, parts.slots, parts.played
        self.islands, self.planner, self.candidates, self.memory = parts.islands, parts.planner, parts.candidates, parts.memory
        self.state, self.rule, self.links, self.walls = parts.state, rule, links, parts.bounce.walls
        self.event_limit = event_limit
        self.particle_count = parts.slots.particle_count
        self.all_pairs = parts.slots.all_pairs
        self.looks_again = self.all_pairs and self.planner.shortest_period < math.inf

    # Events of an island

    @ti.func
    def play(self, root, time, h):
        """Every event of an island within the piece, in the order of time."""
        begin = self.islands.begin[root]
        size = self.islands.size[root]
        for p in range(size):
            self._start(self.islands.members[begin + p])
        self.islands.start_tournament(root)
        events = 0
        count = 0
        if ti.static(self.looks_again):
            count = size
            for p in range(size):
                self.played.touched[begin + p] = self.islands.members[begin + p]
        t = h * 0
        playing = True
        while playing:
            for c in range(count):
                self._predict(root, self.played.touched[begin + c], t, time, h)
            i = self.islands.next(root)
            t = self.islands.best_time[i]
            if not t <= h:
                playing = False
            else:
                count = 1
                self.played.touched[begin] = i
                if self.played.is_fresh(i):
                    events += 1
                    if events > self.event_limit:
                        self.tally.fail(root, 1)
                        playing = False
                    else:
                        count = self.rule.resolve(root, i, self.played.best_partner[i], t, time)
        for p in range(size):
            i = self.islands.members[begin + p]
            self.played.advance(i, h)
            if ti.static(not self.all_pairs):
                self._check_margin(i)

    @ti.func
    def _start(self, i):
        self.played.start(i, self.islands.first_partner[i])
        self.islands.best_time[i] = self.islands.first_time[i]
        self.memory.start(i, self.slots.index(i))
        self.tally.begin(i)

    @ti.func
    def _check_margin(self, k):
        if self.played.excursion[k] > self.slots.reach[k] - self.slots.radius[k]:
            self.planner.note_violation(self.slots.index(k), self.played.excursion[k])

    # Prediction of events

    @ti.func
    def _predict(self, root, i, now, time, h):
        """Find the next event of sphere i, which may become the next event of its partner too."""
        self.islands.best_time[i] = ti.math.inf
        self.played.best_partner[i] = NOTHING
        if ti.static(self.all_pairs):
            for j in range(self.particle_count):
                if j != i:
                    self._consider(i, j, now, h)
        else:
            self.candidates.visit(i, self._consider_slot, now, h)
        for s in ti.static(range(self.walls.plain_count)):
            self._consider_wall(s, i, now, time, h)
        if ti.static(self.walls.segment_count > 0):
            for g in range(self.walls.segment_count):
                self._consider_wall(self.walls.plain_count + g, i, now, time, h)
        self.islands.replay(root, i)

    @ti.func
    def _consider_wall(self, s: Template, i, now, time, h):
        """A contact of i with surface s may be its next event."""
        x, v = self.played.place_at(i, now), self.played.velocity[i]
        radius = self.slots.radius_of(i)
        t = now + self.bounce.time_of_wall(s, self.slots.index(i), radius, x, v, time + now, h - now)
        if t < self.islands.best_time[i]:
            self.islands.best_time[i] = t
            self.played.best_partner[i] = -2 - s

    @ti.func
    def _consider_slot(self, i, j, now, h):
        """Consider a candidate partner: a member of the island, of another island, or a sphere that flies freely."""
        if self.islands.island[j] == self.islands.island[i]:
            if j != i:
                self._consider(i, j, now, h)
        elif self.islands.island[j] >= 0:
            if self.slots.margins_meet(i, j):
                self.played.near[i] = 1
        else:
            v = self.slots.velocity[j]
            d = self.bounce.separation(self.played.place_at(i, now), self.slots.position[j] + v * now)
            if self.slots.time_of_contact(i, j, d, self.played.velocity[i], v, h - now) <= h - now:
                self.links.wish(i, j)

    @ti.func
    def _consider(self, i, j, now, h):
        """A contact of i with j of the same island may be the next event of i, or of j."""
        d = self.bounce.separation(self.played.place_at(i, now), self.played.place_at(j, now))
        v_i, v_j = self.played.velocity[i], self.played.velocity[j]
        horizon = h - now
        if ti.static(self.looks_again):
            horizon = ti.min(horizon, self._sight(i, j, (v_j - v_i).norm()))
        t = now + self.slots.time_of_contact(i, j, d, v_i, v_j, horizon)
        stamp_i, stamp_j = self.played.stamp[i], self.played.stamp[j]
        if ti.static(self.looks_again):
            if t > h and horizon < h - now:
                t = now + horizon
                stamp_i, stamp_j = LOOK_AGAIN, LOOK_AGAIN
        if self._is_sooner(t, j, i):
            self.islands.best_time[i] = t
            self.played.best_partner[i] = j
            self.played.best_stamp[i] = stamp_j
        if self._is_sooner(t, i, j):
            self.islands.best_time[j] = t
            self.played.best_partner[j] = i
            self.played.best_stamp[j] = stamp_i
            self.islands.replay(self.islands.island[j], j)

    @ti.func
    def _is_sooner(self, t, partner, i):
        """Whether a contact with a partner comes before the next event of i; at one time the lower number comes first."""
        result = t < self.islands.best_time[i]
        if t == self.islands.best_time[i]:
            result = t < ti.math.inf and self.islands.number(partner) < self.islands.number(self.played.best_partner[i])
        return result

    @ti.func
    def _sight(self, i, j, speed):
        """For how long no other image of j can reach i than the image that is the nearest now.

        All pairs of a periodic box are tested again after this time.
        """
        return (self.planner.shortest_period / 2.0 - self.slots.radius_of(i) - self.slots.radius_of(j)) / speed

    # Contacts between islands, and the end of a piece

    @ti.func
    def see_other_island(self, k, other, h, _):
        """Join two islands where spheres may have met: neither left a ball around its start, and the balls meet."""
        is_in_another = self.islands.island[other] >= 0 and self.islands.island[other] != self.islands.island[k]
        if is_in_another and (self.played.near[k] == 1 or self.played.near[other] == 1):
            separation = self.bounce.separation(self.slots.position[k], self.slots.position[other])
            radii = self.slots.radius_of(k) + self.slots.radius_of(other)
            reach = radii + self.played.excursion[k] + self.played.excursion[other]
            if separation.dot(separation) <= reach * reach:
                self.links.wish(k, other)

    @ti.func
    def keep(self, chunk, k, h):
        """Put the sphere of slot k, which was played, where it is at the end of a piece of length h, and keep its counts."""
        i = self.slots.index(k)
        if ti.static(self.slots.stay):
            self.slots.position[k] = self.played.position[k]
            self.slots.velocity[k] = self.played.velocity[k]
        else:
            self.state.position[i] = self.played.position[k]
            self.state.velocity[i] = self.played.velocity[k]
        self.tally.keep(chunk, k)
        self.memory.keep(k, i, h)

    @ti.func
    def fly_on(self, k, h):
        """Put the sphere of slot k, which is in no island, where it is at the end of a piece of length h."""
        i = self.slots.index(k)
        x = drifted(self.slots.position[k], self.slots.velocity[k], h)
        if ti.static(self.slots.stay):
            self.slots.position[k] = x
        else:
            self.state.position[i] = x
        self.memory.pass_by(i, h)
