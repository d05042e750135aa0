"""A sweep of many spheres on a device of many threads: who plays with whom found by all of them, an island by each thread."""

from typing import Any

import taichi as ti

from mpp_taichi.contacts._base import ContactSetup
from mpp_taichi.contacts.shared.field_trees import FieldTrees
from mpp_taichi.contacts.sweep.drift_planning import Piece
from mpp_taichi.contacts.sweep.sweep import Sweep
from mpp_taichi.neighbors.prefix_sum import PrefixSum

JOINS, JOINED, STOPPED = 0, 1, 2
HOOKS_AT_ONCE = 4  # before the host looks whether the islands are known


@ti.data_oriented
class DeviceSweep(Sweep):
    """What `Sweep` does with a grid, without lists that threads add to.

    A sphere's island begins as that of its first contact; what else belongs to it is found while it is played, as everywhere.
    In `wish` each sphere notes one with which it wants to be joined, of several that of the lowest number: the next round finds
    the others. Islands are known by their smallest index: labels sink along wishes, and to the labels of labels, until none
    changes. Threads write to places of their own sphere or island, or the same number as all others.

    label     (n,) smallest index of the island that is known so far
    involved  (n,) 1: has a contact, or was joined to those that have
    renewed   (n,) 1 at the label of an island that is to be played
    flag      JOINS: somebody wishes to be joined; JOINED: all are; STOPPED: the device ended loops of a thread
    """

    keeps_slots = False

    def __init__(self, setup: ContactSetup, state: Any, *, event_limit: int) -> None:
        """Allocate for the spheres of `setup`, whose positions and velocities are fields of `state`."""
        Sweep.__init__(self, setup, state, event_limit=event_limit, all_pairs=False)
        n = setup.particle_count
        self.sums = PrefixSum(n)
        fields = [ti.field(ti.i32) for _ in range(8)]
        self.wish, self.label, self.involved, self.renewed, self.arrival, self.arrived, self.first, self.is_played = fields
        self.flag = ti.field(ti.i32)
        self._device_trees = FieldTrees()
        for field in fields:
            self._device_trees.place(n + 1, integers=[field])
        self._device_trees.place(3, integers=[self.flag])
        self._device_trees.finish()
        self._was_stopped = False

    def destroy(self) -> None:
        """Give the memory back."""
        self.sums.destroy()
        self._device_trees.destroy()
        Sweep.destroy(self)

    def _look_around(self, piece: Piece) -> None:
        """Sort the spheres, and take positions and velocities over into the slots."""
        self.flight.set_reaches(piece)
        self.grid.build(self.state.position, self.flight.reach, piece.bounds)
        self._take_radii()
        self._take_over(piece.common, piece.time, piece.rounding, False)

    # Looking for first contacts ----------------------------------------------------------------------------------------

    def _search(self, time: float, h: float, listed: bool) -> int:
        """Returns about how many contacts there are."""
        self._find_first(time, h)
        self.sums.run(self.involved, self.first, self.particle_count)
        return self._count_involved() // 2

    @ti.kernel
    def _count_involved(self) -> ti.i32:
        return self.first[self.particle_count]

    @ti.kernel
    def _find_first(self, time: float, h: float):
        for _ in range(1):
            self.violations[0] = 0
        for k in range(self.particle_count):
            wall = self._first_wall(k, time, h)
            self.islands.first_time[k] = ti.math.inf
            self.islands.first_partner[k] = -1
            if wall[0] <= h:
                self.islands.first_time[k] = wall[0]
                self.islands.first_partner[k] = ti.cast(wall[1], ti.i32)
            self.grid.visit(k, self._see_first, h, h)
            self.involved[k] = ti.cast(self.islands.first_time[k] <= h, ti.i32)
            self.wish[k] = ti.max(self.islands.first_partner[k], -1)
            self.label[k] = k
            self.renewed[k] = self.involved[k]
            if self.watch.was_stopped():
                self.tally.give_up(k, 1)

    @ti.func
    def _see_first(self, k, other, h, _):
        if other != k:
            separation = self.bounce.separation(self.start_position[k], self.start_position[other])
            self._see_overlap(k, other, separation)
            t = self._time_of_contact(k, other, separation, self.start_velocity[k], self.start_velocity[other], h)
            if t <= h:
                self.islands.offer(k, other, t)

    @ti.func
    def join(self, k, other):
        """Wish that the islands of k and other be one."""
        if self.wish[k] < 0 or self.islands.number(other) < self.islands.number(self.wish[k]):
            self.wish[k] = other
        self.flag[JOINS] = 1

    # Forming islands ---------------------------------------------------------------------------------------------------

    def _form(self) -> None:
        """Join whom wishes join, and list the members of all islands that changed."""
        while True:
            for _ in range(HOOKS_AT_ONCE):
                self._hook()
            if self._are_joined() == 1:
                break
        self._count_members()
        self.sums.run(self.islands.size, self.islands.begin, self.particle_count - 1)
        self._enter_members()
        self.sums.run(self.is_played, self.first, self.particle_count)
        self._list_pending()

    @ti.kernel
    def _hook(self):
        for k in range(self.particle_count):
            if self.wish[k] >= 0:
                one, other = self.label[k], self.label[self.wish[k]]
                if one != other:
                    ti.atomic_min(self.label[ti.max(one, other)], ti.min(one, other))
        for k in range(self.particle_count):
            self.label[k] = self.label[self.label[k]]

    @ti.kernel
    def _are_joined(self) -> ti.i32:
        for _ in range(1):
            self.flag[JOINED] = 1
        for k in range(self.particle_count):
            label = self.label[k]
            if self.label[label] != label:
                self.flag[JOINED] = 0
            if self.wish[k] >= 0:
                if self.label[self.wish[k]] != label:
                    self.flag[JOINED] = 0
        return self.flag[JOINED]

    @ti.kernel
    def _count_members(self):
        for k in range(self.particle_count):
            self.islands.size[k] = 0
            if self.wish[k] >= 0:
                self.involved[self.wish[k]] = 1
                self.renewed[self.label[k]] = 1
        for k in range(self.particle_count):
            root = self.label[k]
            self.wish[k] = -1
            self.islands.island[k] = -1
            if self.involved[k] == 1:
                self.islands.island[k] = root
                if self.renewed[root] == 1:
                    self.arrival[k] = ti.atomic_add(self.islands.size[root], 1)

    @ti.kernel
    def _enter_members(self):
        for k in range(self.particle_count):
            root = self.label[k]
            if self.involved[k] == 1 and self.renewed[root] == 1:
                self.arrived[self.islands.begin[root] + self.arrival[k]] = k
        for k in range(self.particle_count):
            root = self.label[k]
            self.is_played[k] = ti.cast(self.islands.size[k] > 0, ti.i32)
            if self.involved[k] == 1 and self.renewed[root] == 1:
                begin = self.islands.begin[root]
                place = 0
                for other in range(begin, begin + self.islands.size[root]):
                    if self.arrived[other] < k:
                        place += 1
                self.islands.members[begin + place] = k
                self.islands.place[k] = place

    @ti.kernel
    def _list_pending(self):
        for k in range(self.particle_count):
            self.renewed[k] = 0
            if self.is_played[k] == 1:
                self.islands.pending[self.first[k]] = k

    # Playing islands ---------------------------------------------------------------------------------------------------

    def _play_islands(self, time: float, h: float, listed: bool, is_first: int) -> tuple[int, int]:
        """Returns whether islands are to be joined, and whether a sphere left its margin."""
        self._form()
        self._play_pending(time, h)
        self._look_for_joins(h)
        joins, violations, stopped = self._outcome()
        self._was_stopped = stopped == 1
        if violations == 1:
            self.flight.find_farthest()
        return joins, violations + stopped

    @ti.kernel
    def _play_pending(self, time: float, h: float):
        for _ in range(1):
            self.flag[JOINS] = 0
            self.flag[STOPPED] = 0
        for q in range(self.first[self.particle_count]):
            root = self.islands.pending[q]
            self._play(root, time, h)
            if self.watch.was_stopped():
                self.flag[STOPPED] = 1

    def _again(self, piece: Piece) -> Piece:
        """A shorter piece where the device ended the loops of a thread, which had too many contacts to play."""
        return self.flight.shorten(piece) if self._was_stopped else self.flight.widen(piece)

    @ti.kernel
    def _look_for_joins(self, h: float):
        for k in range(self.particle_count):
            if self.involved[k] == 1:
                if self.near[k] == 1:
                    self.grid.visit(k, self._see_other_island, h, h)

    @ti.kernel
    def _outcome(self) -> ti.types.vector(3, ti.i32):
        return ti.Vector([self.flag[JOINS], self.violations[0], self.flag[STOPPED]])

    @ti.kernel
    def _commit(self, h: float):
        for k in range(self.particle_count):
            if self.islands.island[k] >= 0:
                self._keep(k, k, h)
            else:
                self._fly_on(k, h)
