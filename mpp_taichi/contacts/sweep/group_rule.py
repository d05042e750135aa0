"""The rule for an event where all contacts that touch at one instant are resolved together."""

import taichi as ti

from mpp_taichi.arithmetic.particle_update import drifted
from mpp_taichi.contacts._base import TOUCHING_POWER, ContactSetup
from mpp_taichi.contacts.sweep.contact_group import ContactGroup
from mpp_taichi.contacts.sweep.pair_rule import PairRule
from mpp_taichi.contacts.sweep.reflections import Reflections
from mpp_taichi.contacts.sweep.sweep_parts import SweepParts
from mpp_taichi.types import Template

SEGMENTS_EACH = 8  # that a sphere touches at one time, on an average; more are given up
CONTACTS_EACH = 8  # touching spheres have fewer than 7.5 contacts each: half the mean kissing number, below 14.96


@ti.data_oriented
class GroupRule:
    """An event of a group: the spheres that meet, the spheres that touch these, the spheres that touch the latter, and so on.

    Spheres touch up to a gap of ε^TOUCHING_POWER of their reach, ε the rounding unit: events that a symmetric scene has at one
    instant stay one group until rounding has pulled them that far apart.
    """

    in_turn = True  # the group has memory for one island only

    def __init__(self, setup: ContactSetup, parts: SweepParts) -> None:
        """Allocate for the spheres of `setup`."""
        self.bounce, self.tally, self.slots, self.played = parts.bounce, parts.tally, parts.slots, parts.played
        self.memory, self.islands, self.grid = parts.memory, parts.islands, parts.grid
        self.alone, self.walls = PairRule(parts), parts.bounce.walls
        n = self.particle_count = setup.particle_count
        self.all_pairs = parts.slots.all_pairs
        pairs = min(n * (n - 1) // 2, CONTACTS_EACH * n)
        walls = self.walls.plain_count + min(self.walls.segment_count, SEGMENTS_EACH)
        self.group = ContactGroup(setup, pairs + n * walls)
        self.reflections = Reflections(self.group)
        self.touching = self.group.epsilon**TOUCHING_POWER
        builder = ti.FieldsBuilder()
        self.mark = ti.field(ti.i32)  # of each sphere; 1: it is listed in the group, 2: its contacts too
        self.rows = ti.field(ti.i32)
        self.listed = ti.field(ti.i32)
        builder.dense(ti.i, n).place(self.mark)
        for field in (self.rows, self.listed):
            builder.dense(ti.i, 1).place(field)
        self._tree = builder.finalize()

    def destroy(self) -> None:
        """Give the memory back."""
        self.reflections.destroy()
        self.group.destroy()
        self._tree.destroy()

    @ti.func
    def resolve(self, root, i, partner, t, time):
        """Resolve the group of i at time t of the piece; returns how many spheres changed their velocities, in `touched`."""
        begin = self.islands.begin[root]
        self.rows[0] = 0
        self.listed[0] = 0
        self._list(begin, i, t)
        if partner >= 0:
            self._list(begin, partner, t)
        done = 0
        while done < self.listed[0]:
            self._find_contacts(root, self.played.touched[begin + done], t, time)
            done += 1
        count = self.rows[0]
        if count > self.group.capacity:
            self.tally.fail(root, count - self.group.capacity)
            count = self.group.capacity
        outcome = self.reflections.resolve(self.played, count)
        if outcome[1] > 0:
            self.tally.fail(root, outcome[1])
        hit = self._account(count, t)
        if hit == 0:
            # The approach is round-off of the speeds in the group, so that only the two that meet bounce.
            self.alone.bounce_now(i, partner, t, time)
        for p in range(self.listed[0]):
            self.played.stamp[self.played.touched[begin + p]] = self.played.stamp[self.played.touched[begin + p]] + 1
            self.mark[self.played.touched[begin + p]] = 0
        return self.listed[0]

    @ti.func
    def _list(self, begin, i, t):
        """Put a sphere into the group, at time t."""
        if self.mark[i] == 0:
            self.mark[i] = 1
            self.group.inverse_mass[i] = self.bounce.inverse_mass[self.slots.index(i)]
            self.played.advance(i, t)
            self.played.touched[begin + self.listed[0]] = i
            self.listed[0] = self.listed[0] + 1

    @ti.func
    def _find_contacts(self, root, i, t, time):
        """Add rows for the spheres and surfaces that touch sphere i of the group, unless their row is there already."""
        self.mark[i] = 2
        if ti.static(self.all_pairs):
            for j in range(self.particle_count):
                self._see_touching(i, j, root, t)
        else:
            self.grid.visit(i, self._see_touching, root, t)
        for s in ti.static(range(self.walls.plain_count)):
            self._see_wall(s, i, t, time)
        if ti.static(self.walls.segment_count > 0):
            for g in range(self.walls.segment_count):
                self._see_wall(self.walls.plain_count + g, i, t, time)

    @ti.func
    def _see_wall(self, s: Template, i, t, time):
        x, radius = self.played.position[i], self.slots.radius_of(i)
        if self.walls.gap(s, x, radius, time + t) <= self.touching * radius:
            if self.walls.can_hold(s, x, radius, time + t):
                n = self.walls.normal(s, x, time + t)
                self._add_row(i, -1 - s, n, n.dot(self.walls.velocity(s, x, time + t)), self.walls.restitution(s), t)

    @ti.func
    def _see_touching(self, i, j, root, t):
        """If j touches i: let j join the group if it is in the island, else join the island, which is then played again."""
        if self.islands.island[j] == root:
            if j != i and self.mark[j] < 2:
                d = self.bounce.separation(self.played.position[i], self.played.place_at(j, t))
                if self._touches(i, j, d):
                    self._list(self.islands.begin[root], j, t)
                    e = self.bounce.restitution_of(self.slots.index(i), self.slots.index(j))
                    self._add_row(i, j, d * (-1.0 / d.norm()), ti.cast(0.0, float), e, t)
        elif ti.static(not self.all_pairs):
            if self.islands.island[j] >= 0:
                if self.slots.margins_meet(i, j):
                    self.played.near[i] = 1
            else:
                d = self.bounce.separation(self.played.position[i], drifted(self.slots.position[j], self.slots.velocity[j], t))
                if self._touches(i, j, d):
                    self.islands.wish(i, j)

    @ti.func
    def _touches(self, i, j, d):
        reach = self.slots.radius_of(i) + self.slots.radius_of(j)
        return d.norm() - reach <= self.touching * reach

    @ti.func
    def _add_row(self, i, second, normal, surface_speed, nominal, t):
        c = self.rows[0]
        self.rows[0] = c + 1
        if c < self.group.capacity:
            e, elastic = self.memory.restitution_without_note(nominal, i, second, t)
            self.group.set_row(c, i, second, normal, surface_speed, e, elastic)

    @ti.func
    def _account(self, count, t):
        """Count the contacts that were hit; returns how many."""
        hit = 0
        for c in range(count):
            hits = self.group.hits[c]
            if hits > 0:
                hit += 1
                i, second = self.group.first[c], self.group.second[c]
                share = self.group.impulse[c] / hits
                lost = self.group.lost[c] / hits
                for _ in range(hits):
                    if second >= 0:
                        reach = self.slots.radius_of(i) + self.slots.radius_of(second)
                        self.tally.add_pair(i, share, reach, lost, self.group.made_elastic[c])
                    else:
                        account = self.walls.account_of(-1 - second)
                        work = share * self.group.surface_speed[c]
                        self.tally.add_wall(i, account, share, lost, self.group.made_elastic[c], work)
                self.memory.note(i, second, t)
        return hit
