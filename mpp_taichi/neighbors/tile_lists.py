"""Tile lists: for each tile of particles the particles, and copies of particles in a box that repeats, that are near it."""

from itertools import product

import numpy as np
import taichi as ti

from mpp_taichi.errors import CapacityError
from mpp_taichi.neighbors.prefix_sum import PrefixSum
from mpp_taichi.neighbors.tile_boxes import TileBoxes
from mpp_taichi.state.field_group import FieldGroup, SideBySide
from mpp_taichi.types import Template

FIRST_ROOM = 256  # entries of a tile, on average, before the first list says how many there are
SPARE = 1.1  # room of a new list, by the length of the list for which it is made
COPY_BITS = 5  # of an entry: 27 copies of a box
MOST_SLOTS = 1 << (31 - COPY_BITS)  # that an entry can tell apart


@ti.data_oriented
class TileLists:
    """The particles that are nearer than a reach to the box around a tile, without the particles of the tile itself.

    entry   (room,) an entry is a slot and a copy, slot · 32 + copy; those of tile t from begin[t] to end[t]
    copy    `dimensions` fields (27,): the shift of each copy of the box [length]

    A tile has an even number of entries: the last may be the slot `empty`, in which there is no particle. The lists are in the
    order of copies and slots. A thread for each tile walks down the tree of boxes twice: to count the particles of near tiles,
    for which there must be room, and to write those of them that are near.
    """

    def __init__(self, boxes: TileBoxes, reach: float) -> None:
        """Allocate; needs a started Taichi."""
        self.boxes, self.reach_squared, self.dimensions = boxes, reach * reach, boxes.dimensions
        self.tile_count, self.empty = boxes.tile_count, boxes.tile_count * boxes.lanes
        if self.empty >= MOST_SLOTS:
            raise CapacityError(f"lists of neighbours have room for {MOST_SLOTS:,} particles, not for {boxes.particle_count:,}")
        self.repeats = any(edge > 0.0 for edge in boxes.period)
        shifts = [(0.0,) if edge == 0.0 else (0.0, edge, -edge) for edge in boxes.period]
        table = np.array(list(product(*shifts)))  # the first copy is the box itself
        self.copy_count = len(table)
        self.begin, self.end, self.count = (ti.field(ti.i32) for _ in range(3))
        self.copy = tuple(ti.field(float) for _ in range(self.dimensions))
        self._memory = FieldGroup(
            (self.tile_count + 1, self.begin, self.end, self.count), (1 << COPY_BITS, SideBySide(self.copy))
        )
        for axis, field in enumerate(self.copy):
            for number, shift in enumerate(table[:, axis]):
                field[number] = shift
        self.sums = PrefixSum(self.tile_count)
        self._entry_memory: FieldGroup | None = None
        self._allocate(FIRST_ROOM * self.tile_count)

    def _allocate(self, room: int) -> None:
        if self._entry_memory is not None:
            self._entry_memory.destroy()
        self.room, self.entry = room, ti.field(ti.i32)
        self._entry_memory = FieldGroup((room, self.entry))

    def destroy(self) -> None:
        """Free the memory."""
        for part in (self._memory, self.sums, self._entry_memory):
            if part is not None:
                part.destroy()

    def write(self) -> None:
        """Write the lists for the boxes as they were measured last."""
        self._count()
        self.sums.run(self.count, self.begin, self.tile_count)
        length = self._length()
        if length < 0:
            raise CapacityError(f"the lists of neighbours of {self.boxes.particle_count:,} particles are too long to count")
        if length > self.room:
            self._allocate(int(SPARE * length))
        self._write(self.entry)

    @ti.kernel
    def _length(self) -> ti.i32:
        return self.begin[self.tile_count]

    @ti.kernel
    def _count(self):
        for tile in range(self.tile_count):
            self.count[tile] = self._walk(tile, self.entry, 0, False)

    @ti.kernel
    def _write(self, entry: Template):
        for tile in range(self.tile_count):
            end = self._walk(tile, entry, self.begin[tile], True)
            if end % 2 == 1:
                entry[end] = self.empty << COPY_BITS
                end += 1
            self.end[tile] = end

    @ti.func
    def _walk(self, tile, entry: Template, first, writes: Template):
        """Write the entries of a tile from the place `first` on, or only the room for them; returns the place after the last.

        The tree is walked without a stack: after a box and all boxes within it comes the next number, without its zeros at the
        end in binary digits.
        """
        lower, upper = self.boxes.lower[self.boxes.leaf_count + tile], self.boxes.upper[self.boxes.leaf_count + tile]
        place = first
        for number in range(self.copy_count):
            shift = ti.Vector([ti.static(self.copy[axis])[number] for axis in ti.static(range(self.dimensions))])
            box = 1
            while box > 0:
                near = self.boxes.is_near(lower, upper, box, shift, self.reach_squared)
                if near and box < self.boxes.leaf_count:
                    box = 2 * box
                else:
                    if near and not (number == 0 and box == self.boxes.leaf_count + tile):
                        place = self._take(lower, upper, box - self.boxes.leaf_count, shift, number, entry, place, writes)
                    box += 1
                    while box % 2 == 0:
                        box = box // 2
                    if box == 1:
                        box = 0
        return place

    @ti.func
    def _take(self, lower, upper, other, shift, number, entry: Template, first, writes: Template):
        """The entries of the particles of another tile, or the room for them."""
        place = first
        if ti.static(writes):
            for slot in range(other * self.boxes.lanes, ti.min((other + 1) * self.boxes.lanes, self.boxes.particle_count)):
                x = self.boxes.placed[slot] + shift
                gap = ti.max(x - upper, lower - x, 0.0)
                # Each entry is written, and the place moves on if it is near: a branch would be mispredicted.
                entry[place] = (slot << COPY_BITS) + number
                place += ti.cast(gap.dot(gap) <= self.reach_squared, ti.i32)
        else:
            place += ti.static(self.boxes.lanes)
        return place
