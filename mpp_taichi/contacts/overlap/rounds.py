"""Overlapping pairs on a device of many threads: those that share no sphere bounce together, in the order of their numbers."""

from typing import Any

import taichi as ti

from mpp_taichi.contacts._base import ContactReport, ContactSetup
from mpp_taichi.contacts.overlap.overlap_bounces import OverlapBounces
from mpp_taichi.contacts.overlap.overlaps import ALL_PAIRS_UP_TO, PAIRS_PER_SPHERE
from mpp_taichi.contacts.shared.loop_watch import LoopWatch
from mpp_taichi.neighbors.device_grid import DeviceGrid
from mpp_taichi.neighbors.prefix_sum import PrefixSum

ROUNDS_AT_ONCE = 4  # before the host looks whether a pair is left


@ti.data_oriented
class OverlapRounds:
    """What `Overlaps` does, by a thread for each sphere.

    Row i are the spheres that overlap sphere i, by number, and next[i] is the first whose turn is to come. A pair has its turn
    when it is the next of both; each round ends at least the first pair that is left. No pair comes before another that shares
    a sphere with it and has lower numbers, so that the outcome is that of one after the other. Threads write to rows and
    totals of their own sphere alone: nothing is added atomically.
    """

    def __init__(self, setup: ContactSetup, state: Any, *, all_pairs: bool | None = None) -> None:
        """Allocate for the spheres of `setup`, whose positions and velocities are fields of `state`."""
        n = self.particle_count = setup.particle_count
        self.state = state
        self.all_pairs = n <= ALL_PAIRS_UP_TO if all_pairs is None else all_pairs
        self.capacity = 2 * (PAIRS_PER_SPHERE * n + 64)  # each pair in both of its rows
        self.bounces = OverlapBounces(setup, state, apart=True)
        self.bounce, self.tally = self.bounces.bounce, self.bounces.tally
        self.partner, self.partner_count, self.row, self.next, self.ready = (ti.field(ti.i32) for _ in range(5))
        self.left = ti.field(ti.i32)
        builder = ti.FieldsBuilder()
        builder.dense(ti.i, self.capacity).place(self.partner)
        for field in (self.partner_count, self.next, self.ready):
            builder.dense(ti.i, n).place(field)
        builder.dense(ti.i, n + 1).place(self.row)
        builder.dense(ti.i, 1).place(self.left)
        self._tree = builder.finalize()
        self.watch = LoopWatch()
        self.sums = PrefixSum(n)
        enclosure = setup.enclosure
        self.grid: Any = None if self.all_pairs else DeviceGrid(n, setup.dimensions, enclosure.period, enclosure.origin)

    def destroy(self) -> None:
        """Give the memory back."""
        for part in (self.bounces, self._tree, self.watch, self.sums, self.grid):
            if part is not None:
                part.destroy()

    def collect(self) -> ContactReport:
        """Counts since the last call."""
        return self.tally.collect()

    def drift(self, time: float, h: float) -> None:
        """Move all spheres by h along their velocities, then let those that overlap bounce."""
        self.bounces.move(h)
        self.correct(time + h)

    def correct(self, time: float) -> None:
        """Let those bounce that overlap at `time`."""
        if self.grid is not None:
            self.grid.build(self.state.position, self.bounce.radius)
        self._count_partners()
        self.sums.run(self.partner_count, self.row, self.particle_count)
        left = self._list_partners()
        while left:
            for _ in range(ROUNDS_AT_ONCE):
                self._bounce_round(time)
            left = self._is_any_left()
        if self.bounce.surfaces:
            self._bounce_walls(time)

    @ti.kernel
    def _count_partners(self):
        for k in range(self.particle_count):
            i = self._sphere(k)
            self.partner_count[i] = 0
            self._visit(k, self._count)

    @ti.kernel
    def _list_partners(self) -> ti.i32:
        """Returns whether there are any to be worked off; where they have no room, they are given up."""
        for k in range(self.particle_count):
            i = self._sphere(k)
            self.next[i] = self.row[i]
            if self.row[self.particle_count] <= self.capacity:
                if self.partner_count[i] > 0:
                    self.partner_count[i] = 0
                    self._visit(k, self._enter)
            elif k == 0:
                self.tally.give_up(i, self.row[self.particle_count] // 2)
            if self.watch.was_stopped():
                self.tally.give_up(i, 1)
        left = 0
        if self.row[self.particle_count] <= self.capacity:
            left = self.row[self.particle_count]
        return left

    @ti.func
    def _sphere(self, k):
        """Whose partners thread k looks for: neighbours in space are neighbours in memory."""
        result = k
        if ti.static(not self.all_pairs):
            result = self.grid.order[k]
        return result

    @ti.func
    def _visit(self, k, task: ti.template()):
        if ti.static(self.all_pairs):
            for j in range(self.particle_count):
                task(k, j, 0, 0)
        else:
            self.grid.visit(k, task, 0, 0)

    @ti.func
    def _count(self, k, other, _, __):
        i, j = self._sphere(k), self._sphere(other)
        if i != j:
            if self.bounces.do_overlap(i, j):
                self.partner_count[i] = self.partner_count[i] + 1

    @ti.func
    def _enter(self, k, other, _, __):
        """Into the row of sphere k, which stays in order."""
        i, j = self._sphere(k), self._sphere(other)
        if i != j:
            if self.bounces.do_overlap(i, j):
                hole = self.row[i] + self.partner_count[i]
                self.partner_count[i] = self.partner_count[i] + 1
                while hole > self.row[i] and self.partner[ti.max(hole - 1, 0)] > j:
                    self.partner[hole] = self.partner[hole - 1]
                    hole -= 1
                self.partner[hole] = j

    @ti.kernel
    def _bounce_round(self, time: float):
        for i in range(self.particle_count):
            self.ready[i] = -1
            if self.next[i] < self.row[i + 1]:
                j = self.partner[self.next[i]]
                if i < j and self.partner[self.next[j]] == i:
                    self.ready[i] = j
        for i in range(self.particle_count):
            j = self.ready[i]
            if j >= 0:
                self.bounces.bounce_pair(i, i, j, time)
                self.next[i] = self.next[i] + 1
                self.next[j] = self.next[j] + 1

    @ti.kernel
    def _is_any_left(self) -> ti.i32:
        for _ in range(1):
            self.left[0] = 0
        for i in range(self.particle_count):
            if self.next[i] < self.row[i + 1]:
                self.left[0] = 1
        return self.left[0]

    @ti.kernel
    def _bounce_walls(self, time: float):
        for i in range(self.particle_count):
            self.bounces.bounce_off_walls(i, i, time)
