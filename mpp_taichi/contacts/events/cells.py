"""Cells of an event-driven run: which spheres may meet before one of them leaves its cell."""

from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.contacts.events.grid import Grid
from mpp_taichi.contacts.events.lines import Lines
from mpp_taichi.contacts.events.spheres import FlyingSpheres
from mpp_taichi.device.fast_taichi.prefetch import prefetch
from mpp_taichi.walls._roots import first_contact

# In place of the bits of an image: the nearest image.
NEAREST = -1


@ti.data_oriented
class EventCells:
    """The cell of a grid that each sphere is in, and the time at which the sphere leaves it."""

    def __init__(self, grid: Grid, spheres: FlyingSpheres, lines: Lines, builder: Any) -> None:
        """Place the fields; `write` fills them."""
        self.grid, self.spheres, self.count, self.dimensions = grid, spheres, spheres.count, spheres.dimensions
        # In two dimensions the third axis has one cell. Along an axis whose cells all touch, no crossing needs an event.
        self.cells = (*grid.cells, 1)[:3]
        self.periodic = (*(p > 0 for p in grid.period), False)[:3]
        self.crossed = tuple(p or m > 3 for p, m in zip(self.periodic, self.cells))
        self.first_step = tuple(-1 if c or m == 3 else 0 for c, m in zip(self.crossed, self.cells))
        self.last_step = tuple(0 if m == 1 and not c else 1 for c, m in zip(self.crossed, self.cells))
        self.small_count = self.count - len(grid.big)
        self.head = ti.field(ti.i32)
        builder.dense(ti.i, int(np.prod(grid.cells))).place(self.head)
        self.next, self.cell = lines.field(ti.i32), lines.field(ti.i32)
        self.turns = lines.field(ti.i32, self.dimensions, seldom=True)
        self.lasting = (self.head, self.next, self.cell, self.turns)
        self.near, self.image = ti.field(ti.i32), ti.field(ti.i32)
        # In a periodic box of one or two cells the same sphere is a neighbour on several sides.
        most = 27 if any(p and m < 3 for p, m in zip(self.periodic, self.cells)) else 1
        # One entry more, as `follow` writes an entry before it is known whether the list of the cell goes on.
        builder.dense(ti.i, most * self.count + 1).place(self.near, self.image)

    def write(self, cell: np.ndarray, turns: np.ndarray) -> None:
        """Put every sphere into its cell; arrays (n, dimensions) in the spheres' own order."""
        number = np.ravel_multi_index(tuple(cell.T), self.grid.cells).astype(np.int32)
        self.cell.from_numpy(number)
        self.turns.from_numpy(np.ascontiguousarray(turns))
        self._link()

    @ti.kernel
    def _link(self):
        ti.loop_config(serialize=True)
        for c in self.head:
            self.head[c] = -1
        for k in range(self.small_count, self.count):
            self.next[k] = -1  # big spheres are in no list
        ti.loop_config(serialize=True)
        for k in range(self.small_count):
            self._enter(self.small_count - 1 - k)

    @ti.func
    def steps(self, number):
        """Place of a cell along each axis, from its number."""
        result = ti.Vector([0, 0, 0])
        for k in ti.static(range(self.dimensions - 1, 0, -1)):
            result[k] = number % self.cells[k]
            number //= self.cells[k]
        result[0] = number
        return result

    @ti.func
    def number(self, steps):
        """Number of the cell at these places along the axes."""
        result = steps[0]
        for k in ti.static(range(1, self.dimensions)):
            result = result * self.cells[k] + steps[k]
        return result

    @ti.func
    def gather(self, i, side):
        """Begin the list `near` of the spheres that i may meet, with their `image` in a periodic box; returns its length.

        It holds the first sphere of each cell; `follow` adds the others. After a crossing of `side` only the cells that are
        new neighbours are listed. Big spheres are in no cell: they may meet all spheres, and are in every list.
        """
        count = 0
        if i < self.small_count:
            count = self._gather_cells(i, side)
        for j in range(self.small_count if i < self.small_count else 0, self.count):
            self.near[count], self.image[count] = j, NEAREST
            count += 1
        return count

    @ti.func
    def follow(self, i, m, count):
        """Add the sphere that follows the m-th of `near` in the list of its cell; returns the new length of `near`."""
        after = self.next[self.near[m]] if i < self.small_count else -1
        prefetch(self.next, ti.max(after, 0))
        self.near[count], self.image[count] = after, self.image[m]
        return count + ti.cast(after >= 0, ti.i32)

    @ti.func
    def _gather_cells(self, i, side):
        cell, first, last = self.steps(self.cell[i]), ti.Vector([0, 0, 0]), ti.Vector([0, 0, 0])
        for k in ti.static(range(self.dimensions)):
            first[k], last[k] = self.first_step[k], self.last_step[k]
            if side // 2 == k:
                first[k] = last[k] = 2 * (side % 2) - 1
        count = 0
        for dx in range(first[0], last[0] + 1):
            for dy in range(first[1], last[1] + 1):
                for dz in range(first[2], last[2] + 1):
                    index, image = 0, 0
                    for k in ti.static(range(self.dimensions)):
                        c = cell[k] + (dx if ti.static(k == 0) else (dy if ti.static(k == 1) else dz))
                        if c < 0:
                            c += self.cells[k]
                            image += ti.static(1 if self.periodic[k] else 0) << (2 * k)
                        elif c >= self.cells[k]:
                            c -= self.cells[k]
                            image += ti.static(2 if self.periodic[k] else 0) << (2 * k)
                        index = index * self.cells[k] + c
                    self.near[count], self.image[count] = self.head[index], image
                    count += 1 if self.head[index] >= 0 else 0
        return count

    @ti.func
    def seen(self, separation, image):
        """The separation of an image: two bits for each axis say whether it is a period higher (1) or lower (2)."""
        result = separation
        if image == NEAREST:
            result = self.nearest_image(separation)
        else:
            for k in ti.static(range(self.dimensions)):
                if ti.static(self.periodic[k]):
                    way = (image >> (2 * k)) & 3
                    if way == 1:
                        result[k] += ti.static(self.grid.period[k])
                    elif way == 2:
                        result[k] -= ti.static(self.grid.period[k])
        return result

    @ti.func
    def crossing(self, x, v, a, i):
        """When a sphere at x leaves its cell, and through which side: 2 × axis + (1 if upwards)."""
        soonest = ti.math.inf
        side = 0
        steps = self.steps(self.cell[i])
        for k in ti.static(range(self.dimensions)):
            if ti.static(self.crossed[k]):
                step = ti.cast(steps[k], float)
                if ti.static(not self.periodic[k]):
                    step += ti.cast(self.turns[i][k], float) * self.cells[k]
                below = x[k] - (ti.static(self.grid.low[k]) + step * ti.static(self.grid.edge[k]))
                above = (ti.static(self.grid.low[k]) + (step + 1) * ti.static(self.grid.edge[k])) - x[k]
                if ti.static(self.spheres.has_gravity):
                    down = first_contact(below, v[k], a[k], soonest)
                    if down < soonest:
                        soonest, side = down, 2 * k
                    up = first_contact(above, -v[k], -a[k], soonest)
                    if up < soonest:
                        soonest, side = up, 2 * k + 1
                elif v[k] != 0:
                    out = ti.max((above if v[k] > 0 else below) / ti.abs(v[k]), 0)
                    if out < soonest:
                        soonest, side = out, 2 * k + ti.cast(v[k] > 0, ti.i32)
        return soonest, side

    @ti.func
    def cross(self, i, side):
        """Move sphere i into the next cell; along a periodic axis its position stays in the box."""
        if i < self.small_count:
            self._leave(i)
        steps = self.steps(self.cell[i])
        for k in ti.static(range(self.dimensions)):
            if side // 2 == k:
                cell = steps[k] + (1 if side % 2 == 1 else -1)
                turn = 0
                if cell < 0:
                    turn = -1
                elif cell >= self.cells[k]:
                    turn = 1
                steps[k] = cell - turn * self.cells[k]
                if turn != 0:
                    self.turns[i][k] += turn
                    if ti.static(self.periodic[k]):
                        self.spheres.position[i][k] -= turn * ti.static(self.grid.period[k])
        self.cell[i] = self.number(steps)
        if i < self.small_count:
            self._enter(i)

    @ti.func
    def shown_position(self, i, time):
        """Position of sphere i at `time`, with its turns around a periodic box."""
        result = self.spheres.position_at(i, time)
        for k in ti.static(range(self.dimensions)):
            if ti.static(self.periodic[k]):
                result[k] += ti.cast(self.turns[i][k], float) * ti.static(self.grid.period[k])
        return result

    @ti.func
    def nearest_image(self, separation):
        """The separation to the nearest image in a periodic box."""
        result = separation
        for k in ti.static(range(self.dimensions)):
            if ti.static(self.periodic[k]):
                result[k] -= ti.static(self.grid.period[k]) * ti.round(result[k] / ti.static(self.grid.period[k]))
        return result

    @ti.func
    def _enter(self, i):
        c = self.cell[i]
        self.next[i] = self.head[c]
        self.head[c] = i

    @ti.func
    def _leave(self, i):
        c = self.cell[i]
        if self.head[c] == i:
            self.head[c] = self.next[i]
        else:
            before = self.head[c]
            while self.next[before] != i:
                before = self.next[before]
            self.next[before] = self.next[i]
