"""Prefix sums of integers on a device of many threads: the first entries of rows, from the lengths of the rows."""

from typing import Any

import taichi as ti

from mpp_taichi.state.field_group import FieldGroup
from mpp_taichi.types import Template

MOST_PARTS = 4096
GROUP = 64  # parts of a group
SHARE = 16  # fewest numbers that are worth a thread


@ti.data_oriented
class PrefixSum:
    """begin[k] = Σ_{l < k} length[l] for k = 0 … count, in three loops without atomics.

    The first loop sums parts of the row, the second sums groups of parts, and the third gives each part its start.
    """

    def __init__(self, capacity: int) -> None:
        """Allocate for up to `capacity` numbers; needs a started Taichi."""
        self.groups = max(1, min(MOST_PARTS, capacity // SHARE) // GROUP)
        self.parts = self.groups * GROUP
        self.part, self.group = ti.field(ti.i32), ti.field(ti.i32)
        self._memory = FieldGroup((self.parts, self.part), (self.groups, self.group))

    def destroy(self) -> None:
        """Free the memory."""
        self._memory.destroy()

    def run(self, length: Any, begin: Any, count: int) -> None:
        """Set the first count + 1 numbers of `begin`."""
        self._run(length, begin, count)

    @ti.kernel
    def _run(self, length: Template, begin: Template, count: ti.i32):
        for part in range(self.parts):
            total = 0
            for k in range(self._first(part, count), self._first(part + 1, count)):
                total += length[k]
            self.part[part] = total
        for group in range(self.groups):
            total = 0
            for part in range(group * GROUP, (group + 1) * GROUP):
                total += self.part[part]
            self.group[group] = total
        for part in range(self.parts):
            place = 0
            for group in range(part // GROUP):
                place += self.group[group]
            for earlier in range(part // GROUP * GROUP, part):
                place += self.part[earlier]
            for k in range(self._first(part, count), self._first(part + 1, count)):
                here = length[k]
                begin[k] = place
                place += here
            if part == self.parts - 1:
                begin[count] = place

    @ti.func
    def _first(self, part, count):
        """Index of the first number of a part, without a product that might not fit 32 bits."""
        share, rest = count // self.parts, count % self.parts
        return part * share + ti.min(part, rest)
