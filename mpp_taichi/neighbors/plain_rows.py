"""The visit of the cells around a slot of a plain cell grid, without the tests that only other grids need."""

from typing import Any

import taichi as ti

from mpp_taichi.neighbors._levels import UNFOLDED
from mpp_taichi.types import Template


def is_plain(grid: Any) -> bool:
    """Whether a CellGrid has one level, a bucket for each cell, and three cells or more along an axis that repeats."""
    level = grid.levels.table[0]
    few = any(repeats and count < 3 for repeats, count in zip(grid.repeats, level.cells))
    return len(grid.levels.table) == 1 and level.mask == UNFOLDED and not few


@ti.func
def visit_rows(grid: Template, slot, task: Template, carry, more):
    """carry = task(x, reach, carry, more, begin, end) for each run of later slots in the cells around; returns the last carry.

    `x` and `reach` are the position and the reach of the slot. The task itself tests which slots of a run are near enough.
    """
    x, reach = grid.sorted_position[slot], grid.sorted_reach[slot]
    cells, strides = grid.levels.cells[0], ti.cast(grid.levels.strides[0], ti.i32)
    own = grid.cell_of(x, 0)
    lowest, highest = own, own
    for axis in ti.static(range(grid.dimensions)):
        lowest[axis] -= 1
        highest[axis] += 1
        if ti.static(not grid.repeats[axis]):
            lowest[axis] = ti.max(lowest[axis], 0)
            highest[axis] = ti.min(highest[axis], cells[axis] - 1)
    # Cells in a row along x have buckets in a row; where the box repeats, a cell may lie at the other end of the row.
    west, east = ti.max(lowest[0], 0), ti.min(highest[0], cells[0] - 1)
    beyond = -1
    if lowest[0] < 0:
        beyond = cells[0] - 1
    if highest[0] >= cells[0]:
        beyond = 0
    first_y, first_z = own[1], own[2]  # rows before these hold only earlier slots
    if lowest[1] < 0 or lowest[2] < 0:
        first_y, first_z = lowest[1], lowest[2]
    result = carry
    for z in range(first_z, highest[2] + 1):
        for y in range(first_y if z == first_z else lowest[1], highest[1] + 1):
            cell = grid.wrapped(ti.Vector([west, y, z]), cells)
            row = cell[1] * strides[0] + cell[2] * strides[1]
            begin, stop = grid.start[row + west], grid.start[row + east + 1]
            if stop > slot + 1:
                result = task(x, reach, result, more, ti.max(begin, slot + 1), stop)
            if beyond >= 0:
                begin, stop = grid.start[row + beyond], grid.start[row + beyond + 1]
                result = task(x, reach, result, more, ti.max(begin, slot + 1), stop)
    return result
