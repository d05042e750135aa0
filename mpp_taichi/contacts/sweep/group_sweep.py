"""Drift with exact contacts, where everything that touches at an instant is resolved together."""

from types import SimpleNamespace
from typing import Any

import taichi as ti

from mpp_taichi.contacts._base import TOUCHING_POWER, ContactSetup
from mpp_taichi.contacts.sweep.contact_group import ContactGroup
from mpp_taichi.contacts.sweep.reflections import Reflections
from mpp_taichi.contacts.sweep.sweep import Sweep
from mpp_taichi.walls import _geometry

CONTACTS_EACH = 8  # touching spheres have fewer than 7.5 contacts each: half the mean kissing number, below 14.96


@ti.data_oriented
class GroupSweep(Sweep):
    """A sweep whose event is a group: the spheres that meet, what touches them then, what touches those, and so on.

    Spheres touch up to a gap of ε^TOUCHING_POWER of their reach, ε the rounding unit: events that a symmetric scene has at one
    instant stay one group until rounding has pulled them that far apart. Islands are played one after the other.
    """

    plays_in_turn = True
    keeps_slots = False

    def __init__(self, setup: ContactSetup, state: Any, *, event_limit: int, all_pairs: bool | None = None) -> None:
        """Allocate for the spheres of `setup`, whose positions and velocities are fields of `state`."""
        Sweep.__init__(self, setup, state, event_limit=event_limit, all_pairs=all_pairs)
        n = setup.particle_count
        pairs = min(n * (n - 1) // 2, CONTACTS_EACH * n)
        self.group = ContactGroup(setup, pairs + n * len(setup.enclosure.surfaces))
        self.reflections = Reflections(self.group)
        self.touching = self.group.epsilon**TOUCHING_POWER
        self.moving = SimpleNamespace(velocity=self.local_velocity)
        builder = ti.FieldsBuilder()
        self.mark = ti.field(ti.i32)  # 1: listed in the group, 2: and its contacts too
        self.rows = ti.field(ti.i32)
        self.listed = ti.field(ti.i32)
        builder.dense(ti.i, n).place(self.mark)
        for field in (self.rows, self.listed):
            builder.dense(ti.i, 1).place(field)
        self._group_tree = builder.finalize()

    def destroy(self) -> None:
        """Give the memory back."""
        self.reflections.destroy()
        self.group.destroy()
        self._group_tree.destroy()
        Sweep.destroy(self)

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
            self._find_contacts(root, self.touched[begin + done], t, time)
            done += 1
        count = self.rows[0]
        if count > self.group.capacity:
            self.tally.fail(root, count - self.group.capacity)
            count = self.group.capacity
        outcome = self.reflections.resolve(self.moving, count)
        if outcome[1] > 0:
            self.tally.fail(root, outcome[1])
        hit = self._account(count, t)
        if hit == 0:
            # An approach that is round-off of the group's speeds: the two part by themselves.
            self._bounce_alone(i, partner, t, time)
        for p in range(self.listed[0]):
            self.stamp[self.touched[begin + p]] = self.stamp[self.touched[begin + p]] + 1
            self.mark[self.touched[begin + p]] = 0
        return self.listed[0]

    @ti.func
    def _list(self, begin, i, t):
        """Put a sphere into the group, at time t."""
        if self.mark[i] == 0:
            self.mark[i] = 1
            self.group.inverse_mass[i] = self.bounce.inverse_mass[self.index(i)]
            self.advance(i, t)
            self.touched[begin + self.listed[0]] = i
            self.listed[0] = self.listed[0] + 1

    @ti.func
    def _find_contacts(self, root, i, t, time):
        """Rows for what touches sphere i of the group and was not looked at yet."""
        self.mark[i] = 2
        if ti.static(self.all_pairs):
            for j in range(self.particle_count):
                self._see_touching(i, j, root, t)
        else:
            self.grid.visit(i, self._see_touching, root, t)
        x = self.local_position[i]
        for s in ti.static(range(len(self.bounce.surfaces))):
            radius = self.radius_of(i)
            if _geometry.gap(self.bounce.surfaces[s], x, radius, time + t) <= self.touching * radius:
                n = _geometry.normal(self.bounce.surfaces[s], x, time + t)
                speed = n.dot(_geometry.surface_velocity(self.bounce.surfaces[s], x))
                self._add_row(i, -1 - s, n, speed, ti.cast(self.bounce.surfaces[s].restitution, float), t)

    @ti.func
    def _see_touching(self, i, j, root, t):
        """A sphere of the same island joins the group; one outside joins the island, which is then played again."""
        if self.islands.island[j] == root:
            if j != i and self.mark[j] < 2:
                d = self.bounce.separation(self.local_position[i], self.place_at(j, t))
                if self._touches(i, j, d):
                    self._list(self.islands.begin[root], j, t)
                    e = self.bounce.restitution_of(self.index(i), self.index(j))
                    self._add_row(i, j, d * (-1.0 / d.norm()), ti.cast(0.0, float), e, t)
        elif ti.static(not self.all_pairs):
            if self.islands.island[j] >= 0:
                if self._may_meet(i, j):
                    self.near[i] = 1
            else:
                d = self.bounce.separation(self.local_position[i], self.start_position[j] + self.start_velocity[j] * t)
                if self._touches(i, j, d):
                    self.join(i, j)

    @ti.func
    def _touches(self, i, j, d):
        reach = self.radius_of(i) + self.radius_of(j)
        return d.norm() - reach <= self.touching * reach

    @ti.func
    def _add_row(self, i, second, normal, surface_speed, nominal, t):
        c = self.rows[0]
        self.rows[0] = c + 1
        if c < self.group.capacity:
            e = nominal
            elastic = 0
            if ti.static(self.keeps_last_contact):
                last = self.local_last_contact[i]
                if second >= 0:
                    last = ti.max(last, self.local_last_contact[second])
                if t - last < self.contact_time and e < 1.0:
                    e = 1.0
                    elastic = 1
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
                        reach = self.radius_of(i) + self.radius_of(second)
                        self.tally.add_pair(i, share, reach, lost, self.group.made_elastic[c])
                    else:
                        self.tally.add_wall(i, -1 - second, share, lost, self.group.made_elastic[c])
                if ti.static(self.keeps_last_contact):
                    self.local_last_contact[i] = t
                    if second >= 0:
                        self.local_last_contact[second] = t
        return hit

    @ti.func
    def _bounce_alone(self, i, partner, t, time):
        if partner >= 0:
            self.bounce_pair(ti.min(i, partner), ti.max(i, partner), t)
        else:
            self.bounce_off_wall(i, -2 - partner, t, time)
