"""Looking ahead in an event-driven run: what the next events need is fetched while others happen."""

import numpy as np
import taichi as ti

from mpp_taichi.contacts._event_cells import EventCells
from mpp_taichi.contacts._event_queue import EventQueue
from mpp_taichi.contacts._event_spheres import Spheres
from mpp_taichi.prefetch import prefetch
from mpp_taichi.types import Template

TOGETHER = 16  # buckets of the queue that are looked at at a time; there is about one event in each
# Fewer spheres than these stay in the caches of one core.
FEWEST = 16384


@ti.data_oriented
class LookAhead:
    """Has the lines fetched that the events of the next buckets will need.

    An event's reads wait for each other: from the queue to the sphere, to its cell, to its neighbours. Here they are made some
    buckets after each other, each when what it needs has come. What is fetched may change until the event comes, or be none
    of the event's at all: results do not depend on it.
    """

    def __init__(self, spheres: Spheres, cells: EventCells, queue: EventQueue, builder: ti.FieldsBuilder) -> None:
        """For the events of a queue; nothing is done for few spheres."""
        self.spheres, self.cells, self.queue = spheres, cells, queue
        self.is_worthwhile = spheres.count >= FEWEST
        self.cell_count = int(np.prod(cells.cells))
        # From a cell to the next one along each axis, and to the middles of the rows of three cells that it is among.
        m = cells.cells
        self.strides = (m[1] * m[2], m[2], 1)
        self.rows = tuple(a * m[1] for a in (-1, 0, 1))
        if spheres.dimensions == 3:
            self.rows = tuple((a + b) * m[2] for a in self.rows for b in (-1, 0, 1))
        self.last = ti.field(ti.i32)
        builder.place(self.last)

    @ti.func
    def look(self):
        """To be called once the earliest event is known."""
        if ti.static(self.is_worthwhile):
            bucket = self.queue.bucket[None]
            if bucket >= self.last[None] + TOGETHER or bucket < self.last[None]:
                self.last[None] = bucket
                for step in range(TOGETHER):
                    b = bucket + 1 + step
                    self._fetch_first(b + 5 * TOGETHER)
                    self._fetch_second(b + 4 * TOGETHER)
                    self._each(b + 3 * TOGETHER, self._fetch_partner)
                    self._each(b + 2 * TOGETHER, self._fetch_around)
                    self._each(b + TOGETHER, self._fetch_around_partner)

    @ti.func
    def _first(self, bucket):
        """The first sphere in a bucket, or less than 0."""
        return self.queue.first[bucket] if bucket < self.queue.bucket_count else -1

    @ti.func
    def _partner(self, i):
        """Whom sphere i will meet, or less than 0."""
        j = self.queue.partner[i]
        return j if (j >= 0) & (j < self.spheres.count) else -1

    # Step by step, for the events of a bucket ------------------------------------------------------------------------------

    @ti.func
    def _fetch_first(self, bucket):
        i = self._first(bucket)
        if i >= 0:
            self._fetch(i)

    @ti.func
    def _fetch_second(self, bucket):
        i = self._first(bucket)
        if i >= 0:
            self._fetch(ti.max(self.queue.next[i], 0))

    @ti.func
    def _each(self, bucket, task: Template):
        """task(i) for the spheres of a bucket."""
        i = self._first(bucket)
        while i >= 0:
            task(i)
            i = self.queue.next[i]

    @ti.func
    def _fetch_partner(self, i):
        self._fetch_heads(i)
        j = self._partner(i)
        if j >= 0:
            self._fetch(j)

    @ti.func
    def _fetch_around(self, i):
        self._fetch_neighbours(i)
        j = self._partner(i)
        if j >= 0:
            self._fetch_heads(j)

    @ti.func
    def _fetch_around_partner(self, i):
        j = self._partner(i)
        if j >= 0:
            self._fetch_neighbours(j)

    # What is of a sphere, and around it ------------------------------------------------------------------------------------

    @ti.func
    def _fetch(self, i):
        prefetch(self.queue.next, i)
        prefetch(self.spheres.contacts, i)

    @ti.func
    def _cell(self, i):
        """Around which cell sphere i looks for partners at its event: its own, or the next one if it crosses into that."""
        cell, side = self.cells.cell[i], self.queue.partner[i] - self.spheres.count - 1
        if side >= 0:
            for axis, stride in ti.static(enumerate(self.strides)):
                if side // 2 == axis:
                    cell += (2 * (side % 2) - 1) * stride
        return cell

    @ti.func
    def _head(self, cell):
        return ti.math.clamp(cell, 0, self.cell_count - 1)

    @ti.func
    def _fetch_heads(self, i):
        cell = self._cell(i)
        for row in ti.static(self.rows):
            prefetch(self.cells.head, self._head(cell + row))

    @ti.func
    def _fetch_neighbours(self, i):
        """One sphere of each cell around; whether the box is periodic, and who else is in the cell, matters little."""
        cell = self._cell(i)
        for row in ti.static(self.rows):
            for step in ti.static(range(-1, 2)):
                prefetch(self.spheres.clock, ti.max(self.cells.head[self._head(cell + row + step)], 0))
