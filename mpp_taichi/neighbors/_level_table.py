"""The levels of a cell grid, as fields that kernels read."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.neighbors._levels import MAXIMUM_LEVELS, Level
from mpp_taichi.state.field_group import FieldGroup

BUCKETS_PER_SPHERE = 4


@ti.data_oriented
class LevelTable:
    """The levels of one grid.

    table           the levels on the host (`_levels.py`), smallest reaches first
    bucket_count    number of the buckets of all levels
    count           (1,) number of levels
    offset …        the numbers of a Level, one entry for each level
    corner, slack   (1,) the lower corner of the box and the rounding error of coordinates, which all levels share
    """

    def __init__(self, dimensions: int, repeats: Sequence[bool]) -> None:
        """Allocate; `repeats` says for each axis whether the box repeats along the axis. Needs a started Taichi."""
        self.dimensions, self.repeats = dimensions, tuple(repeats)
        self.count, self.offset, self.mask, self.buckets = (ti.field(ti.i32) for _ in range(4))
        self.reach, self.slack = ti.field(float), ti.field(float)
        self.inverse, self.corner = (ti.Vector.field(dimensions, float) for _ in range(2))
        self.cells, self.strides = ti.Vector.field(dimensions, ti.i32), ti.Vector.field(2, ti.u32)
        numbers = (self.reach, self.slack, self.inverse, self.corner)
        integers = (self.count, self.offset, self.mask, self.buckets, self.cells, self.strides)
        self._memory = FieldGroup((MAXIMUM_LEVELS, *numbers, *integers))
        self.table: list[Level] = []
        self.bucket_count = 0
        self._wanted: Any = None  # the arguments that the present table was made from

    def destroy(self) -> None:
        """Free the memory."""
        self._memory.destroy()

    def set(self, reaches: list, counts: list, extent: np.ndarray, corner: np.ndarray, slack: float) -> None:
        """Make levels with these largest reaches and numbers of spheres, smallest first, for a box.

        Nothing happens where the arguments are the same as in the last call.
        """
        wanted = (reaches, counts, extent.tolist(), corner.tolist(), slack)
        if wanted == self._wanted:
            return
        self._wanted, self.table = wanted, []
        offset = 0
        for reach, count in zip(reaches, counts, strict=True):
            level = Level.fitted(reach + slack, count, extent, self.repeats, BUCKETS_PER_SPHERE, offset)
            offset += level.buckets
            self.table.append(level)
        self.bucket_count = offset
        lower = _three(corner.tolist())
        for k, level in enumerate(self.table):
            # Numbers, not arrays: a launch with arrays takes five times as long.
            whole = (k, len(self.table), level.offset, level.mask, level.buckets, *level.strides)
            cells, inverse = _three([int(count) for count in level.cells]), _three(level.inverse.tolist())
            self._store(*whole, *cells, level.reach, *inverse, *lower, slack)

    @ti.kernel
    def _store(
        self,
        k: ti.i32,
        levels: ti.i32,
        offset: ti.i32,
        mask: ti.i32,
        buckets: ti.i32,
        stride_y: ti.i32,
        stride_z: ti.i32,
        cells_x: ti.i32,
        cells_y: ti.i32,
        cells_z: ti.i32,
        reach: float,
        inverse_x: float,
        inverse_y: float,
        inverse_z: float,
        corner_x: float,
        corner_y: float,
        corner_z: float,
        slack: float,
    ):
        ti.loop_config(serialize=True)
        for _ in range(1):
            self.count[0] = levels
            self.offset[k], self.mask[k], self.buckets[k] = offset, mask, buckets
            self.strides[k] = ti.Vector([ti.cast(stride_y, ti.u32), ti.cast(stride_z, ti.u32)])
            self.reach[k], self.slack[0] = reach, slack
            cells = ti.Vector([cells_x, cells_y, cells_z])
            inverse, corner = ti.Vector([inverse_x, inverse_y, inverse_z]), ti.Vector([corner_x, corner_y, corner_z])
            for axis in ti.static(range(self.dimensions)):
                self.cells[k][axis], self.inverse[k][axis] = cells[axis], inverse[axis]
                self.corner[0][axis] = corner[axis]


def _three(numbers: list) -> list:
    """The numbers of all axes, with a 0 for each axis that the scene lacks."""
    return [*numbers, *[0] * (3 - len(numbers))]
