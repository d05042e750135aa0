"""Looking ahead in an event-driven run: the memory of the next events is fetched while earlier events happen."""

import numpy as np
import taichi as ti

from mpp_taichi.contacts.events.cells import EventCells
from mpp_taichi.contacts.events.fetches import Fetches
from mpp_taichi.contacts.events.queue import EventQueue
from mpp_taichi.contacts.events.spheres import FlyingSpheres
from mpp_taichi.device.fast_taichi.prefetch import prefetch

TOGETHER = 4  # buckets of the queue that are read together
MOST = 64  # spheres that are kept of these buckets
# The memory of fewer spheres stays in the caches of one core.
FEWEST = 16384


@ti.data_oriented
class LookAhead:
    """Fetches the lines of memory that the events of the next buckets will need.

    The reads of an event wait for each other: from the queue to the sphere, to its cell, to its neighbours. Here each kind of
    read is made some buckets after the read on which it depends. The spheres and cells may change before the event happens, or
    the guess of them may be wrong: results do not depend on a fetch. Only the lists of the buckets are walked with branches,
    since a mispredicted branch costs as much as a dozen fetches.
    """

    def __init__(self, spheres: FlyingSpheres, cells: EventCells, queue: EventQueue, builder: ti.FieldsBuilder) -> None:
        """Place the fields, for the events of a queue; few spheres or cells are not fetched."""
        self.spheres, self.cells, self.queue = spheres, cells, queue
        # From the number of a cell to the next cell along each axis, and to the middles of the rows of three cells around it.
        m, d = cells.cells, spheres.dimensions
        self.strides = (m[1] * m[2], m[2], 1)[:d]
        self.rows = tuple(a * m[1] for a in (-1, 0, 1))
        if d == 3:
            self.rows = tuple((a + b) * m[2] for a in self.rows for b in (-1, 0, 1))
        # A cell nearer than `margin` to the first or last number is replaced; its neighbours across a periodic side are few.
        self.margin, self.cell_count = self.rows[-1] + 1, int(np.prod(m))
        self.is_worthwhile = spheres.count >= FEWEST and self.cell_count > 2 * self.margin
        self.fetches = Fetches(spheres, cells, builder, is_worthwhile=self.is_worthwhile)
        self.last, self.noted = ti.field(ti.i32), ti.field(ti.i32)
        builder.place(self.last, self.noted)
        # Spheres with an event in the buckets that were read last, and the cells around which the next partners of these
        # spheres, and of the spheres that they meet, are searched.
        self.sphere, self.around = ti.field(ti.i32), ti.field(ti.i32)
        builder.dense(ti.i, MOST).place(self.sphere)
        builder.dense(ti.i, 2 * MOST).place(self.around)
        # The number that a crossing adds to the number of a cell, by its side + 1; at 0: no crossing.
        self.shift = ti.field(ti.i32)
        builder.dense(ti.i, 1 + 2 * d).place(self.shift)

    def write(self) -> None:
        """Fill the tables."""
        if self.is_worthwhile:
            self.fetches.write(self.margin)
        self.shift.from_numpy(np.array([0, *(way * s for s in self.strides for way in (-1, 1))], np.int32))

    @ti.func
    def look(self):
        """Fetch for the next buckets; to be called once the earliest event is known."""
        if ti.static(self.is_worthwhile):
            bucket = self.queue.bucket[None]
            if bucket >= self.last[None] + TOGETHER or bucket < self.last[None]:
                self.last[None] = bucket
                for step in range(TOGETHER):
                    self._fetch_note(bucket + 1 + 4 * TOGETHER + step)
                for step in range(TOGETHER):
                    self._fetch_spheres(bucket + 1 + 3 * TOGETHER + step)
                self._fetch_neighbours()
                self._fetch_partners(bucket + 1 + 2 * TOGETHER)

    # Stages, each for all events of a bucket

    @ti.func
    def _first(self, bucket):
        """The first note in a bucket, or less than 0."""
        return self.queue.first[ti.min(bucket, self.queue.bucket_count - 1)]

    @ti.func
    def _fetch_note(self, bucket):
        prefetch(self.queue.next, ti.max(self._first(bucket), 0))

    @ti.func
    def _fetch_spheres(self, bucket):
        note = self._first(bucket)
        while note >= 0:
            self._fetch(self.queue.sphere[note])
            note = self.queue.next[note]

    @ti.func
    def _fetch_partners(self, begin):
        """Fetch the partners and the heads of the lists of cells; keep the spheres for `_fetch_neighbours`."""
        count = 0
        for step in range(TOGETHER):
            note = self._first(begin + step)
            while note >= 0:
                i = self.queue.sphere[note]
                self._fetch(ti.max(self._partner(i), 0))
                middle = self._middle(self._cell(i))
                for row in ti.static(self.rows):
                    prefetch(self.cells.head, middle + row)
                self.sphere[count] = i
                count = ti.min(count + ti.cast(self.queue.is_in(i, begin + step), ti.i32), MOST - 1)
                note = self.queue.next[note]
        self.noted[None] = count

    @ti.func
    def _fetch_neighbours(self):
        """Put the rows around the kept spheres and their partners into the ring of fetches."""
        count = 0
        for k in range(self.noted[None]):
            i = self.sphere[k]
            j = self._partner(i)
            self.around[count], self.around[count + 1] = self._cell(i), self.cells.cell[ti.max(j, 0)]
            # A partner that has the same event is kept itself.
            count += 1 + ti.cast((j >= 0) & (self.queue.partner[ti.max(j, 0)] != i), ti.i32)
        place = self.fetches.end()
        for k in range(count):
            middle = self._middle(self.around[k])
            for row in ti.static(self.rows):
                self.fetches.put(place, middle + row)
                place += 1
        self.fetches.put_until(place)

    # A sphere and the cells around the sphere

    @ti.func
    def _fetch(self, i):
        prefetch(self.queue.place, i)
        prefetch(self.spheres.contacts, i)

    @ti.func
    def _partner(self, i):
        """The sphere that sphere i will meet, or less than 0."""
        j = self.queue.partner[i]
        return j if j < self.spheres.count else -1

    @ti.func
    def _cell(self, i):
        """The cell around which partners of sphere i are searched at its event: its own cell, or the cell that it enters."""
        return self.cells.cell[i] + self.shift[ti.max(self.queue.partner[i] - self.spheres.count, 0)]

    @ti.func
    def _middle(self, cell):
        return ti.math.clamp(cell, self.margin, self.cell_count - 1 - self.margin)
