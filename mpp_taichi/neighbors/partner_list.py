"""Which slots of a cell grid are candidate partners, written down once and read many times."""

import taichi as ti

from mpp_taichi.neighbors.cell_grid import CHUNKS, CellGrid
from mpp_taichi.serial_loops import loop_grain
from mpp_taichi.types import Template

PARTNERS_PER_SPHERE = 16  # for which there is room, on average over a chunk


@ti.data_oriented
class PartnerList:
    """The candidates that a grid shows for each slot: reading them takes a third of the time of looking for them.

    Chunks of slots are written in parallel, each into its own part of the list and in the order of its slots, so that the
    list does not depend on the threads. Where a chunk has no room for its partners there is no list.
    """

    def __init__(self, grid: CellGrid) -> None:
        """Allocate; needs a started Taichi."""
        self.grid = grid
        self.particle_count = grid.particle_count
        self.room = PARTNERS_PER_SPHERE * (self.particle_count // CHUNKS + 1) + 64
        self.begin, self.middle, self.end, self.partner, self.written = (ti.field(ti.i32) for _ in range(5))
        builder = ti.FieldsBuilder()
        builder.dense(ti.i, self.particle_count).place(self.begin, self.middle, self.end)
        for count, field in ((CHUNKS * self.room, self.partner), (CHUNKS, self.written)):
            builder.dense(ti.i, count).place(field)
        self._tree = builder.finalize()

    def destroy(self) -> None:
        """Give the memory back."""
        self._tree.destroy()

    def write(self) -> bool:
        """Write down the candidates of the grid as it is built now; False if there is no room for them."""
        return self._write() == 0

    @ti.kernel
    def _write(self) -> ti.i32:
        grain = ti.static(loop_grain())
        for q in range(CHUNKS * grain):
            if q % grain == 0:
                chunk = q // grain
                begin = chunk * self.room
                for slot in range(self.grid.begin_of(chunk), self.grid.begin_of(chunk + 1)):
                    self.begin[slot], self.middle[slot], self.end[slot] = begin, begin, begin
                    self.grid.visit(slot, self._note, (chunk + 1) * self.room, 0)
                    begin = self.end[slot]
                self.written[chunk] = begin - chunk * self.room
        without_room = 0
        for chunk in range(CHUNKS):
            if self.written[chunk] == self.room:
                without_room += 1
        return without_room

    @ti.func
    def _note(self, slot, other, limit, _):
        """Later partners first."""
        end = self.end[slot]
        if other != slot and end < limit:
            self.end[slot] = end + 1
            place = end
            if other > slot:
                place = self.middle[slot]
                self.middle[slot] = place + 1
                self.partner[end] = self.partner[place]
            self.partner[place] = other

    @ti.func
    def visit_later(self, slot, task: Template, first, second):
        """task(slot, other slot, first, second) for each candidate partner of a slot that comes after it."""
        for k in range(self.begin[slot], self.middle[slot]):
            task(slot, self.partner[k], first, second)

    @ti.func
    def visit(self, slot, task: Template, first, second):
        """The same for every candidate partner."""
        for k in range(self.begin[slot], self.end[slot]):
            task(slot, self.partner[k], first, second)
