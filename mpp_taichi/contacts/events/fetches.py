"""Fetches of memory of an event-driven run that are due, made a few at a time."""

import taichi as ti

from mpp_taichi.contacts.events.cells import EventCells
from mpp_taichi.contacts.events.spheres import FlyingSpheres
from mpp_taichi.device.fast_taichi.prefetch import prefetch

ROOM = 4096  # rows that can wait to be fetched; must be a power of two
# A row is fetched for each sphere that is tested for a contact. If more than ENOUGH rows wait, BEFOREHAND come first.
ENOUGH, BEFOREHAND = 8, 2


@ti.data_oriented
class Fetches:
    """A ring of rows whose spheres are to be fetched; a row is three cells, known by the middle cell.

    A processor has some ten fetches under way, drops any more that it is asked for, and takes as long for a fetch as for the
    test of a dozen pairs. So the fetches are made between such tests.
    """

    def __init__(self, spheres: FlyingSpheres, cells: EventCells, builder: ti.FieldsBuilder, *, is_worthwhile: bool) -> None:
        """Place the fields, for spheres in their cells; no fetch is made unless `is_worthwhile`."""
        self.spheres, self.cells, self.is_worthwhile = spheres, cells, is_worthwhile
        self.ring, self.filled, self.done = ti.field(ti.i32), ti.field(ti.i32), ti.field(ti.i32)
        builder.dense(ti.i, ROOM).place(self.ring)
        builder.place(self.filled, self.done)

    def write(self, cell: int) -> None:
        """Empty the ring; its places get the number of a cell that has two neighbours, so that they can be fetched too."""
        self.ring.fill(cell)
        self.filled[None] = self.done[None] = 0

    @ti.func
    def end(self):
        """The place at which to `put` the next row; after the last row comes `put_until` with the place after it."""
        return self.filled[None]

    @ti.func
    def put(self, place, cell):
        """Put the row around a cell into a place of the ring."""
        self.ring[place & (ROOM - 1)] = cell

    @ti.func
    def put_until(self, place):
        """Let the rows before this place wait. If there are more rows than the ring has room for, most are forgotten."""
        self.filled[None] = place & (ROOM - 1)

    @ti.func
    def take(self, count):
        """Take up to `count` rows, to `fetch` them one after the other."""
        done, waiting = self.done[None], 0
        if ti.static(self.is_worthwhile):
            waiting = (self.filled[None] - done) & (ROOM - 1)
            if waiting > ENOUGH:
                for k in ti.static(range(BEFOREHAND)):
                    self._fetch(done + k)
                done += BEFOREHAND
                waiting -= BEFOREHAND
            self.done[None] = (done + ti.min(count, waiting)) & (ROOM - 1)
        return ti.Vector([done, waiting - 1])

    @ti.func
    def fetch(self, taken, k):
        """Fetch the k-th row that was taken; if there are fewer, the last row once more, which costs nothing."""
        if ti.static(self.is_worthwhile):
            self._fetch(taken[0] + ti.min(k, taken[1]))

    @ti.func
    def _fetch(self, place):
        """Fetch the first sphere of each of the three cells; further spheres of a cell are rare."""
        cell = self.ring[place & (ROOM - 1)]
        for step in ti.static((-1, 0, 1)):
            prefetch(self.spheres.clock, ti.max(self.cells.head[cell + step], 0))
