"""The candidate partners of each slot of a cell grid, in a list that is written once and read many times."""

import taichi as ti

from mpp_taichi.device.fast_taichi.prefetch import prefetch
from mpp_taichi.device.heavy_loops import is_heavy, loop_grain
from mpp_taichi.neighbors._sphere_grid import CHUNKS
from mpp_taichi.neighbors.cell_grid import CellGrid
from mpp_taichi.neighbors.plain_rows import is_plain, visit_rows
from mpp_taichi.state.field_group import FieldGroup
from mpp_taichi.types import Template

PARTNERS_PER_SPHERE = 10  # room of the list, on average over a chunk; a pair takes one place


@ti.data_oriented
class PartnerList:
    """The candidate partners of each slot. To read the list takes a third of the time of a search in the grid.

    Later partners, which come after their slot in the grid, are searched in chunks of slots; the chunks run in parallel, and
    each writes its own part of the list. Earlier partners are the same pairs again, sorted by their second slot: each thread
    reads all pairs and keeps the pairs of its share of slots. Both lists are in the order of the slots, whatever the number of
    threads. Where a chunk has no room for its partners, there is no list.

    partner   later partners of slot k from begin[k] to middle[k], earlier partners from earlier[k] to earlier[k + 1]
    """

    def __init__(self, grid: CellGrid, *, later_only: bool = False) -> None:
        """Allocate, for later partners only if no others are read; needs a started Taichi."""
        self.later_only = later_only
        self.grid = grid
        self.particle_count = grid.particle_count
        self.sharer_count = grid.sorter_count
        self.room = PARTNERS_PER_SPHERE * (self.particle_count // CHUNKS + 1) + 64
        self.begin, self.middle, self.earlier, self.partner, self.written = (ti.field(ti.i32) for _ in range(5))
        self._memory = FieldGroup(
            (self.particle_count + 1, (self.begin, self.middle, self.earlier)),  # read together
            ((1 if later_only else 2) * CHUNKS * self.room, self.partner),
            (CHUNKS, self.written),
        )

    def destroy(self) -> None:
        """Free the memory."""
        self._memory.destroy()

    def write(self) -> bool:
        """Write the list for the grid as it was built last; False if there is no room for the partners."""
        if self._write(is_plain(self.grid)) > 0:
            return False
        if not self.later_only:
            self._turn_round()
        return True

    @ti.kernel
    def _write(self, plain: Template) -> ti.i32:
        grain = ti.static(loop_grain())
        for q in range(CHUNKS * grain):
            if is_heavy(q, grain):
                chunk = q // grain
                begin = chunk * self.room
                place, last = begin, begin + self.room - 1  # the last place may be written, but never counts
                for slot in range(self.grid.begin_of(chunk), self.grid.begin_of(chunk + 1)):
                    self.begin[slot] = place
                    if ti.static(plain):
                        place = visit_rows(self.grid, slot, self._list_near, place, last)
                    else:
                        self.middle[slot] = place
                        self.grid.visit_later(slot, self._note, last, 0)
                        place = self.middle[slot]
                    self.middle[slot] = place
                self.written[chunk] = place - begin
        without_room = 0
        for chunk in range(CHUNKS):
            if self.written[chunk] == self.room - 1:
                without_room += 1
        return without_room

    @ti.func
    def _list_near(self, x, reach, place, last, begin, stop):
        """Write the slots of a run that are near enough, from `place` on, up to `last`; returns the place after them.

        Every slot of the run is written, and the place moves on if the slot is near enough: a branch would be mispredicted.
        """
        end = place
        for other in range(begin, stop):
            self.partner[end] = other
            together = reach + self.grid.sorted_reach[other]
            near = self.grid.square_distance(x, self.grid.sorted_position[other]) <= together * together
            end = ti.min(end + ti.cast(near, ti.i32), last)
        return end

    @ti.func
    def _note(self, slot, other, last, _):
        place = self.middle[slot]
        self.partner[place] = other
        self.middle[slot] = ti.min(place + 1, last)

    @ti.kernel
    def _turn_round(self):
        """Write the earlier partners: all pairs, sorted by their later slot."""
        grain = ti.static(loop_grain())
        for q in range(self.sharer_count * grain):
            if is_heavy(q, grain):
                part = q // grain
                first, end = self._share(part), self._share(part + 1)
                for slot in range(first, end):
                    self.earlier[slot] = 0
                for slot in range(end):
                    for k in range(self.begin[slot], self.middle[slot]):
                        other = self.partner[k]
                        if first <= other and other < end:
                            self.earlier[other] = self.earlier[other] + 1
        ti.loop_config(serialize=True)
        for _ in range(1):
            place = CHUNKS * self.room
            for slot in range(self.particle_count):
                place += self.earlier[slot]
                self.earlier[slot] = place
            self.earlier[self.particle_count] = place
        # From the last slot back, so that at the end `earlier` holds the first place of each slot.
        for q in range(self.sharer_count * grain):
            if is_heavy(q, grain):
                part = q // grain
                first, end = self._share(part), self._share(part + 1)
                for back in range(1, end + 1):
                    slot = end - back
                    for k in range(self.begin[slot], self.middle[slot]):
                        other = self.partner[k]
                        if first <= other and other < end:
                            place = self.earlier[other] - 1
                            self.earlier[other] = place
                            self.partner[place] = slot

    @ti.func
    def _share(self, part):
        return ti.cast(ti.cast(part, ti.i64) * self.particle_count // self.sharer_count, ti.i32)

    @ti.func
    def visit_later(self, slot, task: Template, first, second):
        """Call task(slot, other slot, first, second) for each candidate partner that comes after the slot."""
        for k in range(self.begin[slot], self.middle[slot]):
            task(slot, self.partner[k], first, second)

    @ti.func
    def visit(self, slot, task: Template, first, second):
        """Call task(slot, other slot, first, second) for each candidate partner of a slot."""
        begin, later, earlier = self.begin[slot], self.middle[slot], self.earlier[slot]
        split = later - begin
        for k in range(split + self.earlier[slot + 1] - earlier):
            place = begin + k
            if k >= split:
                place = earlier + k - split
            task(slot, self.partner[place], first, second)

    @ti.func
    def count_of(self, slot):
        """Number of candidate partners of a slot."""
        return self.middle[slot] - self.begin[slot] + self.earlier[slot + 1] - self.earlier[slot]

    @ti.func
    def partner_of(self, slot, k):
        """The k-th candidate partner of a slot."""
        split = self.middle[slot] - self.begin[slot]
        place = self.begin[slot] + k
        if k >= split:
            place = self.earlier[slot] + k - split
        return self.partner[place]

    @ti.func
    def fetch(self, slot):
        """Prefetch both parts of the list of a slot from memory."""
        prefetch(self.partner, self.begin[slot])
        prefetch(self.partner, self.earlier[slot])
