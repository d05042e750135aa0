"""Fetches of an event-driven run that are due, made a few at a time."""

import taichi as ti

from mpp_taichi.contacts.events.cells import EventCells
from mpp_taichi.contacts.events.spheres import FlyingSpheres
from mpp_taichi.device.fast_taichi.prefetch import prefetch

ROOM = 4096  # rows that can wait to be fetched; a power of two
# A row is fetched for each sphere that is tested for a contact; if more wait than so many, some are beforehand.
ENOUGH, BEFOREHAND = 8, 2


@ti.data_oriented
class Fetches:
    """Rows of three cells, by the middle one, whose spheres' lines are to be fetched; they wait in a ring.

    A processor has some ten fetches under way, drops those that it is asked for beyond, and takes as long for one of them as
    for the test of a dozen pairs. So they are asked for between such tests.
    """

    def __init__(self, spheres: FlyingSpheres, cells: EventCells, builder: ti.FieldsBuilder, *, is_worthwhile: bool) -> None:
        """Of these spheres in their cells; nothing is done if it is not worthwhile."""
        self.spheres, self.cells, self.is_worthwhile = spheres, cells, is_worthwhile
        self.ring, self.filled, self.done = ti.field(ti.i32), ti.field(ti.i32), ti.field(ti.i32)
        builder.dense(ti.i, ROOM).place(self.ring)
        builder.place(self.filled, self.done)

    def write(self, cell: int) -> None:
        """Nothing waits; a cell between two others stands for what was fetched last."""
        self.ring.fill(cell)
        self.filled[None] = self.done[None] = 0

    @ti.func
    def end(self):
        """The place at which to `put` the next row; after some, `put_until` the place after the last."""
        return self.filled[None]

    @ti.func
    def put(self, place, cell):
        """The row around a cell is to wait."""
        self.ring[place & (ROOM - 1)] = cell

    @ti.func
    def put_until(self, place):
        """What was put before this place waits. Of more than there is room for, most are forgotten."""
        self.filled[None] = place & (ROOM - 1)

    @ti.func
    def take(self, count):
        """Take up to so many, to `fetch` them one after the other."""
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
        """The k-th of those taken; there being fewer, the last once more, which costs nothing."""
        if ti.static(self.is_worthwhile):
            self._fetch(taken[0] + ti.min(k, taken[1]))

    @ti.func
    def _fetch(self, place):
        """One sphere of each cell; who else is in it matters little."""
        cell = self.ring[place & (ROOM - 1)]
        for step in ti.static((-1, 0, 1)):
            prefetch(self.spheres.clock, ti.max(self.cells.head[cell + step], 0))
