"""Looking ahead in an event-driven run: what the next events need is on its way to the processor before they happen."""

import os
from typing import Any

import taichi as ti

from mpp_taichi.contacts._event_cells import EventCells
from mpp_taichi.contacts._event_queue import EventQueue
from mpp_taichi.contacts._event_spheres import Spheres

# Buckets of the queue that are looked at together.
BUCKETS = int(os.environ.get("K", 8))
LEVEL = int(os.environ.get("LEVEL", 9))
SMALLEST = int(os.environ.get("SMALLEST", 8000))


@ti.data_oriented
class LookAhead:
    """Reads what lies far away in memory for several events at once, so that the waits for it overlap."""

    def __init__(self, spheres: Spheres, cells: EventCells, queue: EventQueue, builder: Any) -> None:
        """Of these spheres."""
        self.spheres, self.cells, self.queue = spheres, cells, queue
        self.looked = ti.field(ti.i32)
        self.sum = ti.field(ti.i32)
        self.upcoming = ti.field(ti.i32)
        builder.place(self.looked, self.sum)
        builder.dense(ti.i, spheres.count + BUCKETS).place(self.upcoming)
        self.is_worthwhile = spheres.count >= SMALLEST

    @ti.func
    def look(self):
        if ti.static(self.is_worthwhile):
            bucket = self.queue.bucket[None]
            if bucket > self.looked[None] or bucket < self.looked[None] - BUCKETS:
                self.looked[None] = bucket + BUCKETS
                self._read(bucket + 1, ti.min(bucket + 1 + BUCKETS, self.queue.bucket_count))

    @ti.func
    def _read(self, begin, end):
        count = 0
        for b in range(begin, end):
            i = self.queue.first[b]
            self.upcoming[count] = i
            count += 1 if i >= 0 else 0
        m = 0
        while m < count:
            i = self.queue.next[self.upcoming[m]]
            self.upcoming[count] = i
            count += 1 if i >= 0 else 0
            m += 1
        if ti.static(LEVEL > 1):
            total = 0
            for k in range(count):
                i = self.upcoming[k]
                j = self.queue.partner[i]
                j = j if (j >= 0) & (j < self.spheres.count) else i
                total += self.spheres.contacts[i] + self.spheres.stalled[i] + self.cells.cell[i][0] + self.cells.turns[i][0]
                total += self.spheres.contacts[j] + self.spheres.stalled[j] + self.cells.cell[j][0] + self.cells.turns[j][0]
                total += self.queue.partner[j]
            self.sum[None] = total
        if ti.static(LEVEL > 2):
            for k in range(count):
                i = self.upcoming[k]
                j = self.queue.partner[i]
                side = -2
                if j > self.spheres.count:
                    side = j - self.spheres.count - 1
                self.cells.gather(i, side)
                if ti.static(LEVEL > 3):
                    if j >= 0 and j < self.spheres.count:
                        self.cells.gather(j, -2)
