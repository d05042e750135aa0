"""Looking ahead in an event-driven run: what the next events need is fetched for many of them at once."""

from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.contacts._event_cells import EventCells
from mpp_taichi.contacts._event_queue import EventQueue
from mpp_taichi.contacts._event_spheres import Spheres

BUCKETS = 32  # of the queue that are looked at together; there is about one event in each
MOST = 256  # spheres that are looked at together
# Fewer spheres than these stay in the caches of one core.
FEWEST = 16384


@ti.data_oriented
class LookAhead:
    """Reads a word of each line that the events of the next buckets will need, and does nothing with it.

    A processor waits for memory once for all reads that do not depend on each other, but an event's reads do: from the queue
    to the sphere, to its cell, to its neighbours. Here every step of that way is taken for all events together. What it reads
    may change until the event comes, or be none of the event's at all: results do not depend on it.
    """

    def __init__(self, spheres: Spheres, cells: EventCells, queue: EventQueue, builder: Any) -> None:
        """For the events of a queue; nothing is done for few spheres."""
        self.spheres, self.cells, self.queue = spheres, cells, queue
        self.is_worthwhile = spheres.count >= FEWEST
        self.cell_count = int(np.prod(cells.cells))
        # From a cell to the middles of the rows of three cells that it is among.
        m = cells.cells
        self.rows = tuple(a * m[1] for a in (-1, 0, 1))
        if spheres.dimensions == 3:
            self.rows = tuple((a + b) * m[2] for a in self.rows for b in (-1, 0, 1))
        self.last = ti.field(ti.i32)
        self.read = ti.field(spheres.wide)
        builder.place(self.last, self.read)
        self.upcoming, self.neighbour = ti.field(ti.i32), ti.field(ti.i32)
        builder.dense(ti.i, BUCKETS + MOST).place(self.upcoming)
        builder.dense(ti.i, MOST * 3 * len(self.rows)).place(self.neighbour)

    @ti.func
    def look(self):
        """To be called once the earliest event is known."""
        if ti.static(self.is_worthwhile):
            bucket = self.queue.bucket[None]
            if bucket > self.last[None] or bucket < self.last[None] - BUCKETS:
                self.last[None] = bucket + BUCKETS
                count = self._gather_events(bucket + 1, ti.min(bucket + 1 + BUCKETS, self.queue.bucket_count))
                self.read[None] = self._read_partners(count) + self._read_neighbours(count)

    @ti.func
    def _gather_events(self, begin, end):
        """The spheres of these buckets."""
        count = 0
        for b in range(begin, end):
            i = self.queue.first[b]
            self.upcoming[count] = i
            count += 1 if i >= 0 else 0
        m = 0
        while m < count and count < MOST:
            i = self.queue.next[self.upcoming[m]]
            self.upcoming[count] = i
            count += 1 if i >= 0 else 0
            m += 1
        return count

    @ti.func
    def _read_partners(self, count):
        total = 0
        for m in range(count):
            i = self.upcoming[m]
            j = self.queue.partner[i]
            j = j if (j >= 0) & (j < self.spheres.count) else i
            total += self.spheres.contacts[i] + self.spheres.contacts[j] + self.queue.next[j]
        return ti.cast(total, self.spheres.wide)

    @ti.func
    def _read_neighbours(self, count):
        """One sphere of each cell around; whether the box is periodic, and who else is in the cell, matters little."""
        found = 0
        for m in range(count):
            cell = self.cells.cell[self.upcoming[m]]
            for row in ti.static(self.rows):
                for step in range(-1, 2):
                    j = self.cells.head[ti.math.clamp(cell + row + step, 0, self.cell_count - 1)]
                    self.neighbour[found] = ti.max(j, 0)
                    found += 1
        total = ti.cast(0, self.spheres.wide)
        for m in range(found):
            total += self.spheres.clock[self.neighbour[m]]
        return total
