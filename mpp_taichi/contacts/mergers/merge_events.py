"""The agenda of a drift with mergers: a list of contacts that are to come, searched for the earliest one."""

from typing import Any

import taichi as ti


@ti.data_oriented
class Agenda:
    """Entries (time, i, j), with j < 0 for a surface. There are few at a time, so that a list is faster than a heap."""

    def __init__(self, capacity: int, builder: Any) -> None:
        """Room for so many entries, in the fields of a builder."""
        self.capacity = capacity
        self.time = ti.field(float)
        self.i, self.j, self.count = ti.field(ti.i32), ti.field(ti.i32), ti.field(ti.i32)
        for field in (self.time, self.i, self.j):
            builder.dense(ti.i, capacity).place(field)
        builder.place(self.count)

    @ti.func
    def clear(self):
        """Remove all entries."""
        self.count[None] = 0

    @ti.func
    def is_too_short(self):
        """Whether an entry had no room."""
        return self.count[None] > self.capacity

    @ti.func
    def add(self, time, i, j):
        """Add an entry. Several threads may add in any order: the result depends on times and numbers only."""
        k = ti.atomic_add(self.count[None], 1)
        if k < self.capacity:
            self.time[k] = time
            self.i[k] = i
            self.j[k] = j

    @ti.func
    def earliest(self):
        """The entry that comes first; of entries at one time the one with the lowest i, then j; −1 if there is none."""
        best = -1
        for k in range(ti.min(self.count[None], self.capacity)):
            comes_first = best < 0
            if not comes_first:
                comes_first = self.time[k] < self.time[best]
                if self.time[k] == self.time[best]:
                    comes_first = self.i[k] < self.i[best] or (self.i[k] == self.i[best] and self.j[k] < self.j[best])
            if comes_first:
                best = k
        return best

    @ti.func
    def take_off(self, i, j):
        """Remove every entry of sphere i, and of j if j is a sphere."""
        kept = 0
        for k in range(ti.min(self.count[None], self.capacity)):
            one, two = self.i[k], self.j[k]
            if one != i and two != i and one != j and (two != j or j < 0):
                self.time[kept] = self.time[k]
                self.i[kept] = one
                self.j[kept] = two
                kept += 1
        self.count[None] = kept
