"""The levels of a cell grid as kernels know them."""

from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.neighbors._levels import Level

BUCKETS_PER_SPHERE = 4


@ti.data_oriented
class LevelTable:
    """Part of a CellGrid, whose `particle_count`, `dimensions` and `repeats` it uses.

    table           the levels (`_levels.py`), smallest reaches first
    bucket_count    of all of them
    level_offset …  their fields, one entry for each level; all know the `corner` of the box and the `slack` of coordinates
    """

    def _make_level_fields(self) -> tuple[tuple, tuple]:
        """Fields of numbers and of integers, to be placed."""
        self.level_count, self.level_offset, self.level_mask, self.level_buckets = (ti.field(ti.i32) for _ in range(4))
        self.level_reach, self.slack = ti.field(float), ti.field(float)
        self.level_inverse, self.corner = (ti.Vector.field(self.dimensions, float) for _ in range(2))
        self.level_cells, self.level_strides = ti.Vector.field(self.dimensions, ti.i32), ti.Vector.field(2, ti.u32)
        self.table: list[Level] = []
        self.bucket_count = 0
        self._wanted: Any = None  # what the table was made for
        integers = (self.level_count, self.level_offset, self.level_mask, self.level_buckets, self.level_cells)
        return (self.level_reach, self.slack, self.level_inverse, self.corner), (*integers, self.level_strides)

    def set_levels(self, reaches: list, counts: list, extent: np.ndarray, corner: np.ndarray, slack: float) -> None:
        """Levels of these largest reaches and numbers of spheres, smallest first, for a box; the last are there already."""
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
            self._store_level(*whole, *cells, level.reach, *inverse, *lower, slack)

    @ti.kernel
    def _store_level(
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
            self.level_count[0] = levels
            self.level_offset[k], self.level_mask[k], self.level_buckets[k] = offset, mask, buckets
            self.level_strides[k] = ti.Vector([ti.cast(stride_y, ti.u32), ti.cast(stride_z, ti.u32)])
            self.level_reach[k], self.slack[0] = reach, slack
            cells = ti.Vector([cells_x, cells_y, cells_z])
            inverse, corner = ti.Vector([inverse_x, inverse_y, inverse_z]), ti.Vector([corner_x, corner_y, corner_z])
            for axis in ti.static(range(self.dimensions)):
                self.level_cells[k][axis], self.level_inverse[k][axis] = cells[axis], inverse[axis]
                self.corner[0][axis] = corner[axis]


def _three(numbers: list) -> list:
    """Of as many axes as there are, and 0 for those that are not."""
    return [*numbers, *[0] * (3 - len(numbers))]
