"""The log of an event-driven run: every contact, kept on the device until the host takes it."""

from typing import Any

import numpy as np
import taichi as ti

RECORD = np.dtype([("time", "f8"), ("i", "i4"), ("j", "i4"), ("impulse", "f8")])


@ti.data_oriented
class ContactLog:
    """Time, spheres and momentum of each contact; j is −1 − w for surface w. A full log must be emptied before it is used."""

    def __init__(self, capacity: int, builder: Any, wide: Any) -> None:
        """Place the fields, with room for `capacity` contacts; 0: no contact is logged."""
        self.capacity = capacity
        self.time, self.impulse = ti.field(wide), ti.field(float)
        self.i, self.j = ti.field(ti.i32), ti.field(ti.i32)
        builder.dense(ti.i, max(capacity, 1)).place(self.time, self.impulse)
        builder.dense(ti.i, max(capacity, 1)).place(self.i, self.j)
        self.size = ti.field(ti.i32)
        builder.place(self.size)
        self._taken: list[np.ndarray] = []

    @ti.func
    def note(self, time, i, j, impulse):
        """Log one contact."""
        if ti.static(self.capacity > 0):
            k = self.size[None]
            self.time[k], self.i[k], self.j[k], self.impulse[k] = time, i, j, impulse
            self.size[None] = k + 1

    @ti.func
    def is_full(self):
        """Whether there is no room for the next contact."""
        result = False
        if ti.static(self.capacity > 0):
            result = self.size[None] >= self.capacity
        return result

    def empty(self) -> None:
        """Move the contacts on the device to the host."""
        if self.capacity and self.size[None]:
            records = np.empty(self.size[None], RECORD)
            for name in ("time", "i", "j", "impulse"):
                records[name] = getattr(self, name).to_numpy()[: len(records)]
            self._taken.append(records)
            self.size[None] = 0

    def take(self) -> np.ndarray:
        """All contacts since the last call, in order of time: records of time, i, j, impulse."""
        self.empty()
        result = np.concatenate([*self._taken, np.empty(0, RECORD)])
        self._taken = []
        return result
