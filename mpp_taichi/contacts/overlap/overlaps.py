"""Find all pairs that overlap, let them bounce and push them apart, one after the other by number."""

from typing import Any

import taichi as ti

from mpp_taichi.contacts._base import ContactReport, ContactSetup
from mpp_taichi.contacts.overlap.kept_candidates import KeptCandidates
from mpp_taichi.contacts.overlap.overlap_bounces import OverlapBounces
from mpp_taichi.contacts.shared.contact_counts import CHUNKS
from mpp_taichi.device.heavy_loops import is_heavy, loop_grain
from mpp_taichi.neighbors.cell_grid import CellGrid
from mpp_taichi.neighbors.plain_rows import is_plain, visit_rows
from mpp_taichi.types import Template

ALL_PAIRS_UP_TO = 200  # spheres; more are faster in a list, see tools/benchmarks/benchmark_opencl.py
PAIRS_PER_SPHERE = 8  # room for pairs: a contact graph of spheres has fewer than 7.5 edges for each sphere
FEW = 64  # spheres for each pair; if there are more, pairs count as few and are sorted as such


@ti.data_oriented
class Overlaps:
    """Overlapping pairs on the CPU: found on the cell grid or among all pairs, listed by number, and resolved by one thread.

    The result does not depend on how the pairs are found.
    """

    def __init__(self, setup: ContactSetup, state: Any, *, all_pairs: bool | None = None) -> None:
        """Allocate for the spheres of `setup`, whose positions and velocities are fields of `state`."""
        n = self.particle_count = setup.particle_count
        self.state = state
        self.all_pairs = n <= ALL_PAIRS_UP_TO if all_pairs is None else all_pairs
        self.capacity = PAIRS_PER_SPHERE * n + 64
        self.bounces = OverlapBounces(setup, state, apart=False)
        self.bounce, self.tally = self.bounces.bounce, self.bounces.tally
        builder = ti.FieldsBuilder()
        self.found = ti.Vector.field(2, ti.i32)
        self.partner, self.row, self.found_count = ti.field(ti.i32), ti.field(ti.i32), ti.field(ti.i32)
        for field in (self.found, self.partner):
            builder.dense(ti.i, self.capacity).place(field)
        builder.dense(ti.i, n + 2).place(self.row)
        builder.dense(ti.i, 1).place(self.found_count)
        self._tree = builder.finalize()
        enclosure = setup.enclosure
        self.grid: Any = None if self.all_pairs else CellGrid(n, setup.dimensions, enclosure.period, enclosure.origin)
        self.kept: Any = None if self.all_pairs else KeptCandidates(self.grid, state.position, self.bounce.radius)

    def destroy(self) -> None:
        """Give the memory back."""
        for part in (self.bounces, self._tree, self.kept, self.grid):
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
        if self.all_pairs:
            self._correct_serial(time)
        else:
            if self.kept.find():
                self._find_listed()
            else:
                self._find(is_plain(self.grid))
            self._bounce_pairs(time)
            self._bounce_walls(time)

    @ti.kernel
    def _correct_serial(self, time: float):
        ti.loop_config(serialize=True)
        for _ in range(1):
            self.correct_serial(time)

    @ti.func
    def correct_serial(self, time):
        """Let all overlapping spheres bounce, found among all pairs; inside a serialized loop."""
        count = 0
        for i in range(self.particle_count):
            self.row[i] = count
            for j in range(i + 1, self.particle_count):
                if self.bounces.do_overlap(i, j):
                    if count < self.capacity:
                        self.partner[count] = j
                        count += 1
                    else:
                        self.tally.give_up(i, 1)
        self.row[self.particle_count] = count
        self._work_off(time)
        for i in range(self.particle_count):
            self.bounces.bounce_off_walls(0, i, time)

    @ti.kernel
    def _find(self, plain: Template):
        self.found_count[0] = 0
        for slot in range(self.particle_count):
            if ti.static(plain):
                visit_rows(self.grid, slot, self._note_run, slot, 0)
            else:
                self.grid.visit_later(slot, self._note, 0.0, 0.0)

    @ti.kernel
    def _find_listed(self):
        self.found_count[0] = 0
        for slot in range(self.particle_count):
            self.kept.partners.visit_later(slot, self._note_near, 0.0, 0.0)

    @ti.func
    def _note_near(self, slot, other, _, __):
        if self.kept.are_near(slot, other):
            self._note(slot, other, 0.0, 0.0)

    @ti.func
    def _note_run(self, x, reach, slot, _, begin, end):
        for other in range(begin, end):
            together = reach + self.grid.sorted_reach[other]
            if self.grid.square_distance(x, self.grid.sorted_position[other]) <= together * together:
                self._note(slot, other, 0.0, 0.0)
        return slot

    @ti.func
    def _note(self, slot, other, _, __):
        one, two = self.grid.order[slot], self.grid.order[other]
        i, j = ti.min(one, two), ti.max(one, two)
        if self.bounces.do_overlap(i, j):
            k = ti.atomic_add(self.found_count[0], 1)  # in any order: they are sorted below
            if k < self.capacity:
                self.found[k] = ti.Vector([i, j])

    @ti.kernel
    def _bounce_pairs(self, time: float):
        ti.loop_config(serialize=True)
        for _ in range(1):
            count = ti.min(self.found_count[0], self.capacity)
            self.tally.give_up(0, ti.max(self.found_count[0] - self.capacity, 0))
            if count < self.particle_count // FEW:
                self._sort_few(count)
            else:
                self._sort_many(count)
            for k in range(count):
                self.bounces.bounce_pair(0, self.found[k][0], self.found[k][1], time)

    @ti.func
    def _sort_few(self, count):
        """Shell's sort with gaps 1, 4, 13, 40, …, which does not read the spheres without a pair."""
        gap = 1
        while gap < count // 3:
            gap = 3 * gap + 1
        while gap > 0:
            for k in range(gap, count):
                pair, hole = self.found[k], k
                while hole >= gap and self._is_later(self.found[ti.max(hole - gap, 0)], pair):
                    self.found[hole] = self.found[hole - gap]
                    hole -= gap
                self.found[hole] = pair
            gap //= 3

    @ti.func
    def _is_later(self, pair, other):
        return pair[0] > other[0] or (pair[0] == other[0] and pair[1] > other[1])

    @ti.func
    def _sort_many(self, count):
        """Sort the pairs into a row for each sphere."""
        for i in range(self.particle_count + 2):
            self.row[i] = 0
        for k in range(count):
            i = self.found[k][0]
            self.row[i + 2] = self.row[i + 2] + 1
        for i in range(self.particle_count):
            self.row[i + 2] = self.row[i + 2] + self.row[i + 1]
        for k in range(count):
            i = self.found[k][0]
            self.partner[self.row[i + 1]] = self.found[k][1]
            self.row[i + 1] = self.row[i + 1] + 1
        for i in range(self.particle_count):
            self._sort_row(self.row[i], self.row[i + 1])
            for k in range(self.row[i], self.row[i + 1]):
                self.found[k] = ti.Vector([i, self.partner[k]])

    @ti.func
    def _sort_row(self, begin, end):
        for k in range(begin + 1, end):
            j = self.partner[k]
            hole = k
            while hole > begin and self.partner[ti.max(hole - 1, 0)] > j:
                self.partner[hole] = self.partner[hole - 1]
                hole -= 1
            self.partner[hole] = j

    @ti.func
    def _work_off(self, time):
        for i in range(self.particle_count):
            for k in range(self.row[i], self.row[i + 1]):
                self.bounces.bounce_pair(0, i, self.partner[k], time)

    @ti.kernel
    def _bounce_walls(self, time: float):
        if ti.static(len(self.bounce.walls.surfaces) > 0):
            grain = ti.static(loop_grain())
            for q in range(CHUNKS * grain):
                if is_heavy(q, grain):
                    chunk = q // grain
                    for i in range(self.tally.begin_of(chunk), self.tally.begin_of(chunk + 1)):
                        self.bounces.bounce_off_walls(chunk, i, time)
