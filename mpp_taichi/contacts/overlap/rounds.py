"""Overlapping pairs on a device of many threads: pairs that share no sphere bounce together, in the order of their numbers."""

from typing import Any

import taichi as ti

from mpp_taichi.contacts._base import ContactReport, ContactSetup
from mpp_taichi.contacts.overlap.overlap_bounces import OverlapBounces
from mpp_taichi.contacts.overlap.overlaps import PAIRS_PER_SPHERE
from mpp_taichi.contacts.shared.loop_watch import LoopWatch
from mpp_taichi.neighbors.device_grid import DeviceGrid
from mpp_taichi.neighbors.prefix_sum import PrefixSum

ALL_PAIRS_UP_TO = 500  # spheres; with more, a launch takes less time than the test of all pairs
ROUNDS_AT_ONCE = 4  # launches before the host asks whether a pair is left


@ti.data_oriented
class OverlapRounds:
    """The pairs of `Overlaps` with the same outcome, by a thread for each sphere.

    Row i holds the spheres that overlap sphere i, by number, and next[i] is the first place of the row that is not resolved
    yet. A pair is resolved when each of its spheres is the next one in the row of the other; each round resolves at least the
    first pair that is left. Of two pairs that share a sphere the one with the lower numbers comes first, so that the outcome
    is the same as if one pair were resolved after the other. A thread writes to the row and the totals of its own sphere only,
    so that nothing is added atomically.
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
        """Move all spheres by h along their velocities, then let overlapping pairs bounce."""
        self.bounces.move(h)
        self.correct(time + h)

    def correct(self, time: float) -> None:
        """Let the spheres bounce that overlap at `time`."""
        if self.grid is not None:
            self.grid.build(self.state.position, self.bounce.radius)
        self._count_partners()
        self.sums.run(self.partner_count, self.row, self.particle_count)
        left = self._list_partners()
        while left:
            for _ in range(ROUNDS_AT_ONCE):
                self._bounce_round(time)
            left = self._is_any_left()
        if self.bounce.walls.surfaces:
            self._bounce_walls(time)

    @ti.kernel
    def _count_partners(self):
        for k in range(self.particle_count):
            i = self._sphere(k)
            self.partner_count[i] = 0
            self._visit(k, self._count)

    @ti.kernel
    def _list_partners(self) -> ti.i32:
        """Fill the rows; returns whether there are pairs to resolve. Pairs for which there is no room are given up."""
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
        """The sphere of thread k; threads with near numbers have spheres that are near in space."""
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
        """Enter the other sphere into the row of sphere k, which stays sorted."""
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
