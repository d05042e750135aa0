"""Shared part of the cell grids of a CPU and of a GPU: the levels of cells, and the visit of the cells around a sphere.

Two spheres are candidates where |x_j − x_i| ≤ reach_i + reach_j. Spheres are grouped in levels of reach, each a factor of two
wide (`_levels.py`), and the cells of a level are as wide as its largest sphere. So a few huge spheres among many small spheres
cost each small sphere one visit to the cells of the huge spheres, and nothing else. No pair is missed at any ratio of reaches.
"""

from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.neighbors._level_table import BUCKETS_PER_SPHERE, LevelTable
from mpp_taichi.neighbors._levels import BINS, MAXIMUM_LEVELS, choose_levels
from mpp_taichi.neighbors.periodic import inside_box, nearest_image
from mpp_taichi.state.field_group import FieldGroup
from mpp_taichi.types import Template

CHUNKS = 64  # of a reduction; a fixed number, so that sums do not depend on the threads
FARTHEST = 1e300  # that a box reaches; another check finds coordinates that lie farther out or are NaN
FINEST_LATTICE = 2.0**20  # parts of a box
ROUNDINGS = 8  # of a coordinate on its way to a cell, a generous count


@ti.data_oriented
class SphereGrid:
    """Abstract: spheres in the order of their cells, and of their index within a cell, whatever the number of threads.

    order             (n,) index of the sphere in each slot
    sorted_position   (n,) positions by slot, inside the box that repeats [length]
    sorted_reach      (n,) reaches by slot [length]
    levels            the levels of reach and their cells

    The domain is the present bounding box, on a lattice of cells, or the box that repeats. In a box that repeats, separations
    are separations of the nearest images, which is right while reach_i + reach_j is below half a period. A final class measures
    and sorts the spheres: `measure`, `_sort` and `_bin`.
    """

    def __init__(self, particle_count: int, dimensions: int, period: Any, origin: Any, *, sorter_count: int):
        """Allocate for so many sorters, each of which counts its spheres in all buckets; needs a started Taichi."""
        config = ti.lang.impl.current_cfg()
        self.particle_count, self.dimensions = particle_count, dimensions
        self.period = tuple(float(edge) for edge in period)
        self.origin = np.array(origin, float)[:dimensions]
        self.repeats = tuple(edge > 0.0 for edge in self.period)
        self.epsilon = float(np.finfo(np.float32 if config.default_fp == ti.f32 else np.float64).eps)
        self.sorter_count = sorter_count
        self.most_buckets = BUCKETS_PER_SPHERE * particle_count + 4 * MAXIMUM_LEVELS
        self.levels = LevelTable(dimensions, self.repeats)
        self.order, self.key, self.start, self.tally = (ti.field(ti.i32) for _ in range(4))
        self.sorted_position = ti.Vector.field(dimensions, float)
        self.sorted_reach = ti.field(float)
        self.bounds = ti.Vector.field(2 * dimensions + 2, float)
        self.bin_count, self.level_of_bin = ti.field(ti.i32), ti.field(ti.i32)
        self._memory = FieldGroup(
            (particle_count, (self.sorted_position, self.sorted_reach)),  # read together
            (CHUNKS, self.bounds),
            (particle_count, self.order, self.key),
            (self.most_buckets + 1, self.start),
            (sorter_count * self.most_buckets, self.tally),
            (BINS, self.bin_count, self.level_of_bin),
        )

    def free_cells(self) -> None:
        """Free the memory that this class allocated."""
        self.levels.destroy()
        self._memory.destroy()

    def measure(self, position: Any, reach: Any) -> tuple[np.ndarray, np.ndarray, float, float]:
        """Lower and upper corner of the bounding box, least and largest reach."""
        raise NotImplementedError

    def _sort(self, position: Any, reach: Any, skin: float, largest: float, buckets: int) -> None:
        raise NotImplementedError

    # Construction of the grid

    def build(self, position: Any, reach: Any, bounds: Any = None, skin: float = 0.0) -> None:
        """Sort the spheres into cells; the skin is added to the reach of each sphere.

        `bounds`: (lower corner, upper corner, least reach, largest reach) of the spheres without the skin, where the caller
        knows them; else the grid measures them.
        """
        lower, upper, least, largest = bounds or self.measure(position, reach)
        least, largest = least + skin, largest + skin
        # The box lies on a lattice of the widest cells, so that most builds find the box of the build before.
        lower, upper = (np.clip(np.nan_to_num(bound), -FARTHEST, FARTHEST) for bound in (lower, upper))
        lattice = min(max(float((upper - lower).max()) / FINEST_LATTICE, 2.0 * largest), FARTHEST) or 1.0
        lower, upper = np.floor(lower / lattice) * lattice, np.ceil(upper / lattice) * lattice
        extent = np.where(self.repeats[: self.dimensions], self.period[: self.dimensions], upper - lower)
        corner = np.where(self.repeats[: self.dimensions], self.origin, lower)
        if 2.0 * least >= largest:
            reaches, counts = [largest], [self.particle_count]
        else:
            self._count_bins(reach, skin, largest)
            reaches, counts, level_of_bin = choose_levels(self.bin_count.to_numpy(), largest)
            self.level_of_bin.from_numpy(level_of_bin)
        size = float(np.abs([corner, corner + extent, lower, upper]).max())
        self.levels.set(reaches, counts, extent, corner, ROUNDINGS * self.epsilon * size)
        self._sort(position, reach, skin, largest, self.levels.bucket_count)

    @ti.func
    def begin_of(self, chunk):
        """First slot of a chunk."""
        return self._begin(chunk, CHUNKS)

    @ti.func
    def _begin(self, part, parts):
        """Index of the first sphere of a part; in 64 bits, because the product may not fit 32."""
        return ti.cast(ti.cast(part, ti.i64) * self.particle_count // parts, ti.i32)

    @ti.kernel
    def _count_bins(self, reach: Template, skin: float, largest: float):
        for b in self.bin_count:
            self.bin_count[b] = 0
        for i in range(self.particle_count):
            # A sum of integers does not depend on the order of the additions.
            ti.atomic_add(self.bin_count[self._bin(reach[i] + skin, largest)], 1)

    @ti.func
    def _bin(self, reach, largest):
        """Bin of a reach: eighths of an octave below the largest reach. A final class says how it takes the logarithm."""
        return 0

    @ti.func
    def _bucket_of(self, x, reach, largest):
        level = 0
        if self.levels.count[0] > 1:
            level = self.level_of_bin[self._bin(reach, largest)]
        return self._bucket(self.cell_of(self.inside(x), level), level)

    @ti.func
    def _coordinate(self, x, level):
        """Place inside the box, in units of the cells of a level."""
        return (x - self.levels.corner[0]) * self.levels.inverse[level]

    @ti.func
    def cell_of(self, x, level):
        """The cell of a level in which a place inside the box lies."""
        place = self._coordinate(x, level)
        cell = ti.Vector.zero(ti.i32, 3)
        for axis in ti.static(range(self.dimensions)):
            last = self.levels.cells[level][axis] - 1
            cell[axis] = ti.max(0, ti.min(ti.cast(place[axis], ti.i32), last))
        return cell

    @ti.func
    def _bucket(self, cell, level):
        """Bucket of a cell. Cells in a row along x have buckets in a row, except at the end of a folded table."""
        strides = self.levels.strides[level]
        folded = ti.cast(cell[0], ti.u32) + ti.cast(cell[1], ti.u32) * strides[0] + ti.cast(cell[2], ti.u32) * strides[1]
        return self.levels.offset[level] + ti.cast(folded & ti.cast(self.levels.mask[level], ti.u32), ti.i32)

    # Candidates

    @ti.func
    def visit_later(self, slot, task: Template, first, second):
        """Call task(slot, other slot, first, second) for each candidate partner of a slot that comes after the slot.

        The slots are in the order of the levels, small reaches first, so that all slots together visit each pair once.
        """
        self._visit(self.sorted_position[slot], self.sorted_reach[slot], slot, task, slot, first, second)

    @ti.func
    def visit(self, slot, task: Template, first, second):
        """Call task(slot, other slot, first, second) for each candidate partner of a slot, and for the slot itself."""
        self._visit(self.sorted_position[slot], self.sorted_reach[slot], -1, task, slot, first, second)

    @ti.func
    def _visit(self, x, reach, after, task: Template, subject, first, second):
        for level in range(self.levels.count[0]):
            level_end = self.start[self.levels.offset[level] + self.levels.buckets[level]]
            if level_end > after + 1:
                self._visit_level(level, x, reach, after, task, subject, first, second)

    @ti.func
    def _visit_level(self, level, x, reach, after, task: Template, subject, first, second):
        # Local variables, because a task that writes fields would make the kernel read the table again for each row.
        offset, cells, strides = self.levels.offset[level], self.levels.cells[level], self.levels.strides[level]
        mask = ti.cast(self.levels.mask[level], ti.u32)
        level_begin, level_end = self.start[offset], self.start[offset + self.levels.buckets[level]]
        lowest, highest = self._cells_within(level, x, reach + self.levels.reach[level] + self.levels.slack[0])
        spans = ti.cast(highest - lowest + 1, float)
        everything = spans[0] * spans[1] * spans[2] > level_end - level_begin
        folded = self.levels.mask[level] >= 0 and not everything
        # Cells in a row along x have buckets in a row, except where the box repeats and where cells share a bucket.
        west, east = ti.max(lowest[0], 0), ti.min(highest[0], cells[0] - 1)
        first_row = ti.Vector([lowest[1], lowest[2]])
        runs = 1
        if everything:
            highest[1], highest[2] = lowest[1], lowest[2]
        elif folded:
            runs = highest[0] - lowest[0] + 1
        else:
            if lowest[0] < 0 or highest[0] >= cells[0]:
                runs = 2
            if after >= level_begin and first_row.min() >= 0:
                own = self.cell_of(x, level)
                first_row = ti.Vector([own[1], own[2]])  # rows before this row hold only earlier slots
        for z in range(first_row[1], highest[2] + 1):
            for y in range(first_row[0] if z == first_row[1] else lowest[1], highest[1] + 1):
                cell = self.wrapped(ti.Vector([west, y, z]), cells)
                row = ti.cast(cell[1], ti.u32) * strides[0] + ti.cast(cell[2], ti.u32) * strides[1]
                for run in range(runs):
                    last = east
                    if folded:
                        cell[0] = self.wrapped(ti.Vector([lowest[0] + run, y, z]), cells)[0]
                        last = cell[0]
                    elif run == 1:
                        cell[0] = lowest[0] + cells[0] if lowest[0] < 0 else 0
                        last = cells[0] - 1 if lowest[0] < 0 else highest[0] - cells[0]
                    begin, end = level_begin, level_end
                    if not everything:
                        bucket = offset + ti.cast((ti.cast(cell[0], ti.u32) + row) & mask, ti.i32)
                        begin, end = self.start[bucket], self.start[bucket + last - cell[0] + 1]
                    for slot in range(ti.max(begin, after + 1), end):
                        together = reach + self.sorted_reach[slot]
                        if self.square_distance(x, self.sorted_position[slot]) <= together * together:
                            # A pair whose cells share a bucket would be visited twice without this test.
                            if not folded or (self.cell_of(self.sorted_position[slot], level) == cell).all():
                                task(subject, slot, first, second)

    @ti.func
    def separation(self, slot, other):
        """Vector from a slot to the nearest image of another slot, with a rounding error of the size of the box."""
        return nearest_image(self.sorted_position[other] - self.sorted_position[slot], self.period)

    @ti.func
    def square_distance(self, x, y):
        """Squared distance between the nearest images of two places inside the box."""
        separation = y - x
        for axis in ti.static(range(self.dimensions)):
            if ti.static(self.repeats[axis]):
                # The places are less than a period apart, so a comparison will do; a division would cost more than the rest.
                way = ti.abs(separation[axis])
                back = self.period[axis] - way
                separation[axis] = ti.select(way < back, way, back)
        return separation.dot(separation)

    @ti.func
    def inside(self, x):
        """The image of a place that lies inside the box."""
        return inside_box(x, self.levels.corner[0], self.period)

    @ti.func
    def _cells_within(self, level, x, distance):
        """First and last cell along each axis within a distance. Along an axis that repeats they may lie beyond the ends of the
        axis, but no cell occurs twice.
        """
        place = self._coordinate(x, level)
        lowest = ti.Vector.zero(ti.i32, 3)
        highest = ti.Vector.zero(ti.i32, 3)
        for axis in ti.static(range(self.dimensions)):
            cells = self.levels.cells[level][axis]
            width = ti.cast(cells, float)
            around = distance * self.levels.inverse[level][axis]
            if ti.static(self.repeats[axis]):
                # A cast rounds towards zero, so the count starts a period below. The limits catch places that are NaN.
                low = ti.cast(ti.max(0.0, ti.min(place[axis] - around + width, 2.0 * width)), ti.i32) - cells
                high = ti.cast(ti.max(0.0, ti.min(place[axis] + around, 2.0 * width)), ti.i32)
                few = high - low + 1 < cells
                lowest[axis] = low if few else 0
                highest[axis] = high if few else cells - 1
            else:
                lowest[axis] = ti.cast(ti.max(0.0, ti.min(place[axis] - around, width - 1.0)), ti.i32)
                highest[axis] = ti.cast(ti.max(0.0, ti.min(place[axis] + around, width - 1.0)), ti.i32)
        return lowest, highest

    @ti.func
    def wrapped(self, cell, cells):
        """The cell inside the box of which a cell beyond the end of an axis that repeats is an image."""
        result = cell
        for axis in ti.static(range(self.dimensions)):
            if ti.static(self.repeats[axis]):
                if result[axis] < 0:
                    result[axis] += cells[axis]
                elif result[axis] >= cells[axis]:
                    result[axis] -= cells[axis]
        return result
