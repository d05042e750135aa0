"""Partner rows: for each slot of a cell grid the slots that are near enough, on a CPU in rows of whole vectors."""

import taichi as ti

from mpp_taichi.device.heavy_loops import is_heavy, loop_grain
from mpp_taichi.neighbors._sphere_grid import CHUNKS
from mpp_taichi.neighbors.cell_grid import CellGrid
from mpp_taichi.neighbors.plain_rows import is_plain, visit_rows
from mpp_taichi.state.field_group import FieldGroup
from mpp_taichi.types import Template

FIRST_ROOM = 64  # places of a slot, on average over a chunk


@ti.data_oriented
class PartnerRows:
    """The partners of each slot, without the slot itself, in the order of the grid.

    partner   (places,) slots; those of slot k from begin[k] to end[k]

    The length of a row is a multiple of `lanes`: the last places hold the number of a slot that does not exist, n. The chunks
    of slots run in parallel, and each writes its own part of the list, so that the list does not depend on the threads. Where
    a chunk has no room, the list gets more room and is written anew.
    """

    def __init__(self, grid: CellGrid, lanes: int) -> None:
        """Allocate; needs a started Taichi."""
        self.grid, self.lanes = grid, lanes
        self.slot_count = grid.particle_count
        self.begin, self.end, self.full = (ti.field(ti.i32) for _ in range(3))
        self._memory = FieldGroup((self.slot_count, (self.begin, self.end)), (CHUNKS, self.full))
        self._list_memory: FieldGroup | None = None
        self._allocate(FIRST_ROOM * (self.slot_count // CHUNKS + 1))

    def _allocate(self, room: int) -> None:
        """Make room for so many places in each chunk."""
        if self._list_memory is not None:
            self._list_memory.destroy()
        self.room = -(-room // self.lanes) * self.lanes
        self.partner = ti.field(ti.i32)
        self._list_memory = FieldGroup((CHUNKS * self.room, self.partner))

    def destroy(self) -> None:
        """Free the memory."""
        self._memory.destroy()
        if self._list_memory is not None:
            self._list_memory.destroy()

    def write(self) -> None:
        """Write the list for the grid as it was built last."""
        while self._write(is_plain(self.grid), self.partner, self.room) > 0:
            self._allocate(2 * self.room)

    @ti.kernel
    def _write(self, plain: Template, partner: Template, room: ti.i32) -> ti.i32:
        """Fill the rows; returns the number of chunks that had no room for theirs."""
        grain = ti.static(loop_grain())
        for q in range(CHUNKS * grain):
            if is_heavy(q, grain):
                chunk = q // grain
                place, last = chunk * room, (chunk + 1) * room - self.lanes  # the places from `last` on only end a row
                for slot in range(self.grid.begin_of(chunk), self.grid.begin_of(chunk + 1)):
                    self.begin[slot] = place
                    if ti.static(plain):
                        place = visit_rows(self.grid, slot, self._list_near, place, ti.Vector([last, slot]), later=False)
                    else:
                        self.end[slot] = place
                        self.grid.visit(slot, self._note, last, 0)
                        place = self.end[slot]
                    end = (place + self.lanes - 1) // self.lanes * self.lanes
                    for empty in range(place, end):
                        partner[empty] = self.slot_count
                    self.end[slot] = end
                    place = end
                self.full[chunk] = ti.cast(place >= last, ti.i32)
        without_room = 0
        for chunk in range(CHUNKS):
            without_room += self.full[chunk]
        return without_room

    @ti.func
    def _list_near(self, x, reach, place, more, begin, stop):
        """Write the slots of a run that are near enough, from `place` on; returns the place after them.

        Every slot of the run is written, and the place moves on if the slot is near enough: a branch would be mispredicted.
        """
        end, last, slot = place, more[0], more[1]
        for other in range(begin, stop):
            self.partner[end] = other
            together = reach + self.grid.sorted_reach[other]
            near = self.grid.square_distance(x, self.grid.sorted_position[other]) <= together * together
            end = ti.min(end + ti.cast(near & (other != slot), ti.i32), last)
        return end

    @ti.func
    def _note(self, slot, other, last, _):
        place = self.end[slot]
        if other != slot:
            self.partner[place] = other
            self.end[slot] = ti.min(place + 1, last)
