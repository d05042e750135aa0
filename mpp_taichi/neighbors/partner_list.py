"""Which slots of a cell grid are candidate partners, written down once and read many times."""

import numpy as np
import taichi as ti

from mpp_taichi.neighbors._levels import UNFOLDED
from mpp_taichi.neighbors.cell_grid import CHUNKS, CellGrid
from mpp_taichi.serial_loops import loop_grain
from mpp_taichi.types import Template

PARTNERS_PER_SPHERE = 10  # for which there is room, on average over a chunk; each pair is partners of one of its two


@ti.data_oriented
class PartnerList:
    """The candidates that a grid shows for each slot: reading them takes a third of the time of looking for them.

    Those that come later in the grid are looked for, in chunks of slots that are written in parallel, each into its own part
    of the list. Those that come earlier are the same pairs once more, sorted by their second slot: each thread goes through
    all pairs and keeps those of its share of slots. Both are in the order of slots whatever the number of threads. Where a
    chunk has no room for its partners there is no list.

    partner   later partners of slot k from begin[k] to middle[k], earlier ones from earlier[k] to earlier[k + 1]
    """

    def __init__(self, grid: CellGrid) -> None:
        """Allocate; needs a started Taichi."""
        self.grid = grid
        self.particle_count = grid.particle_count
        self.sharer_count = grid.sorter_count
        self.room = PARTNERS_PER_SPHERE * (self.particle_count // CHUNKS + 1) + 64
        self.begin, self.middle, self.earlier, self.partner, self.written = (ti.field(ti.i32) for _ in range(5))
        builder = ti.FieldsBuilder()
        builder.dense(ti.i, self.particle_count + 1).place(self.begin, self.middle, self.earlier)
        for count, field in ((2 * CHUNKS * self.room, self.partner), (CHUNKS, self.written)):
            builder.dense(ti.i, count).place(field)
        self._tree = builder.finalize()

    def destroy(self) -> None:
        """Give the memory back."""
        self._tree.destroy()

    def write(self) -> bool:
        """Write down the candidates of the grid as it is built now; False if there is no room for them."""
        if self._write(self.is_plain) > 0:
            return False
        self._turn_round()
        return True

    @property
    def is_plain(self) -> bool:
        """Whether the grid has one level, a bucket for each cell, and three cells or more along an axis that repeats."""
        level, grid = self.grid.table[0], self.grid
        cells = level.cells[np.array(grid.repeats[: grid.dimensions])]
        return len(grid.table) == 1 and level.mask == UNFOLDED and bool((cells >= 3).all())

    @ti.kernel
    def _write(self, plain: Template) -> ti.i32:
        grain = ti.static(loop_grain())
        for q in range(CHUNKS * grain):
            if q % grain == 0:
                chunk = q // grain
                begin = chunk * self.room
                place, last = begin, begin + self.room - 1  # which is written to, but not counted
                for slot in range(self.grid.begin_of(chunk), self.grid.begin_of(chunk + 1)):
                    self.begin[slot] = place
                    if ti.static(plain):
                        place = self._list_later(slot, place, last)
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
    def _list_later(self, slot, place, last):
        """Write what `visit_later` of a plain grid shows from `place` on, up to `last`; returns the place after it.

        Every slot of the cells around is written, and stays if it is near enough: no processor foresees which are.
        """
        x, reach = self.grid.sorted_position[slot], self.grid.sorted_reach[slot]
        cells, strides = self.grid.level_cells[0], ti.cast(self.grid.level_strides[0], ti.i32)
        own = self.grid._cell(x, 0)
        lowest, highest = own, own
        for axis in ti.static(range(self.grid.dimensions)):
            lowest[axis] -= 1
            highest[axis] += 1
            if ti.static(not self.grid.repeats[axis]):
                lowest[axis] = ti.max(lowest[axis], 0)
                highest[axis] = ti.min(highest[axis], cells[axis] - 1)
        # Along x the cells follow each other; where the box repeats one lies at the other end.
        west, east = ti.max(lowest[0], 0), ti.min(highest[0], cells[0] - 1)
        beyond = -1
        if lowest[0] < 0:
            beyond = cells[0] - 1
        if highest[0] >= cells[0]:
            beyond = 0
        first_y, first_z = own[1], own[2]  # rows before these hold earlier slots only
        if lowest[1] < 0 or lowest[2] < 0:
            first_y, first_z = lowest[1], lowest[2]
        end = place
        for z in range(first_z, highest[2] + 1):
            for y in range(first_y if z == first_z else lowest[1], highest[1] + 1):
                cell = self.grid._wrapped(ti.Vector([west, y, z]), cells)
                row = cell[1] * strides[0] + cell[2] * strides[1]
                begin, stop = self.grid.start[row + west], self.grid.start[row + east + 1]
                if stop > slot + 1:
                    end = self._list_near(x, reach, end, last, ti.max(begin, slot + 1), stop)
                if beyond >= 0:
                    begin, stop = self.grid.start[row + beyond], self.grid.start[row + beyond + 1]
                    end = self._list_near(x, reach, end, last, ti.max(begin, slot + 1), stop)
        return end

    @ti.func
    def _list_near(self, x, reach, place, last, begin, stop):
        end = place
        for other in range(begin, stop):
            self.partner[end] = other
            together = reach + self.grid.sorted_reach[other]
            near = self.grid._square_distance(x, self.grid.sorted_position[other]) <= together * together
            end = ti.min(end + ti.cast(near, ti.i32), last)
        return end

    @ti.func
    def _note(self, slot, other, last, _):
        place = self.middle[slot]
        self.partner[place] = other
        self.middle[slot] = ti.min(place + 1, last)

    @ti.kernel
    def _turn_round(self):
        """Sort the pairs by their later slot."""
        grain = ti.static(loop_grain())
        for q in range(self.sharer_count * grain):
            if q % grain == 0:
                first, end = self._share(q // grain), self._share(q // grain + 1)
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
        # From the last slot back, so that in the end every count of places stands where they begin.
        for q in range(self.sharer_count * grain):
            if q % grain == 0:
                first, end = self._share(q // grain), self._share(q // grain + 1)
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
        """task(slot, other slot, first, second) for each candidate partner of a slot that comes after it."""
        for k in range(self.begin[slot], self.middle[slot]):
            task(slot, self.partner[k], first, second)

    @ti.func
    def visit(self, slot, task: Template, first, second):
        """The same for every candidate partner."""
        begin, later, earlier = self.begin[slot], self.middle[slot], self.earlier[slot]
        split = later - begin
        for k in range(split + self.earlier[slot + 1] - earlier):
            place = begin + k
            if k >= split:
                place = earlier + k - split
            task(slot, self.partner[place], first, second)

    @ti.func
    def count_of(self, slot):
        """Number of candidate partners."""
        return self.middle[slot] - self.begin[slot] + self.earlier[slot + 1] - self.earlier[slot]

    @ti.func
    def partner_of(self, slot, k):
        """The k-th of them."""
        split = self.middle[slot] - self.begin[slot]
        place = self.begin[slot] + k
        if k >= split:
            place = self.earlier[slot] + k - split
        return self.partner[place]

    @ti.func
    def first_of(self, slot):
        """The first later and the first earlier partner together, if any: read ahead, it brings both lists close."""
        return self.partner[self.begin[slot]] + self.partner[self.earlier[slot]]
