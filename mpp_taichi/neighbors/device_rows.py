"""Partner rows of a GPU: for each slot of a cell grid the slots that are near enough, written by a thread for each slot."""

import taichi as ti

from mpp_taichi.neighbors.device_grid import DeviceGrid
from mpp_taichi.neighbors.prefix_sum import PrefixSum
from mpp_taichi.state.field_group import FieldGroup
from mpp_taichi.types import Template

FIRST_ROOM = 64  # places of a slot, on average
SPARE = 1.1  # room of a new list, by the length of the list for which it is made


@ti.data_oriented
class DeviceRows:
    """The partners of each slot, without the slot itself, in the order of the grid.

    partner   (places,) slots; those of slot k from begin[k] to begin[k + 1]

    Each thread counts the partners of its slot, and after a prefix sum it searches them again and writes them down.
    """

    def __init__(self, grid: DeviceGrid) -> None:
        """Allocate; needs a started Taichi."""
        self.grid, self.slot_count = grid, grid.particle_count
        self.begin, self.count = ti.field(ti.i32), ti.field(ti.i32)
        self._memory = FieldGroup((self.slot_count + 1, self.begin, self.count))
        self.sums = PrefixSum(self.slot_count)
        self._list_memory: FieldGroup | None = None
        self._allocate(FIRST_ROOM * self.slot_count)

    def _allocate(self, room: int) -> None:
        if self._list_memory is not None:
            self._list_memory.destroy()
        self.room, self.partner = room, ti.field(ti.i32)
        self._list_memory = FieldGroup((room, self.partner))

    def destroy(self) -> None:
        """Free the memory."""
        for part in (self._memory, self.sums, self._list_memory):
            if part is not None:
                part.destroy()

    def write(self) -> None:
        """Write the list for the grid as it was built last."""
        self._count_partners()
        self.sums.run(self.count, self.begin, self.slot_count)
        length = self._length()
        if length > self.room:
            self._allocate(int(SPARE * length))
        self._write(self.partner)

    @ti.kernel
    def _length(self) -> ti.i32:
        return self.begin[self.slot_count]

    @ti.kernel
    def _count_partners(self):
        for slot in range(self.slot_count):
            self.count[slot] = 0
            self.grid.visit(slot, self._count, 0, 0)

    @ti.func
    def _count(self, slot, other, _first, _second):
        if other != slot:
            self.count[slot] = self.count[slot] + 1

    @ti.kernel
    def _write(self, partner: Template):
        for slot in range(self.slot_count):
            self.count[slot] = self.begin[slot]
            self.grid.visit(slot, self._note, 0, 0)

    @ti.func
    def _note(self, slot, other, _first, _second):
        if other != slot:
            self.partner[self.count[slot]] = other
            self.count[slot] = self.count[slot] + 1
