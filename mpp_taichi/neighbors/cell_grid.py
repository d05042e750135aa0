"""Cell grid: which spheres may touch, by cells that spheres are sorted into.

Two spheres are candidates where |x_j − x_i| ≤ reach_i + reach_j. Spheres are grouped in levels of reach, a factor of two wide
(`_levels.py`), each with cells as wide as its largest sphere: a few huge spheres among many small ones cost each small
one a look at the huge ones' cells, and nobody else anything. No pair is missed at any ratio of reaches.
"""

from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.device.fast_taichi.serial_loops import loop_grain
from mpp_taichi.neighbors._level_table import BUCKETS_PER_SPHERE, LevelTable
from mpp_taichi.neighbors._levels import BINS, BINS_PER_OCTAVE, MAXIMUM_LEVELS, choose_levels
from mpp_taichi.neighbors.periodic import nearest_image
from mpp_taichi.types import Template

CHUNKS = 64  # of a reduction; fixed, so that sums do not depend on the threads
FARTHEST = 1e300  # that a box reaches; what is lost beyond, or is no number, is found out elsewhere
FINEST_LATTICE = 2.0**20  # parts of a box
ROUNDINGS = 8  # of a coordinate on its way to a cell, as a generous count


@ti.data_oriented
class CellGrid(LevelTable):
    """Spheres in the order of their cells, and of their index within a cell, whatever the number of threads.

    order             (n,) which sphere is in a slot
    sorted_position   (n,) positions by slot, inside the box that repeats [length]
    sorted_reach      (n,) reaches by slot [length]

    The domain is the bounding box of the moment, on a lattice of cells, or the box that repeats; in that separations are the
    nearest images, which is right while reach_i + reach_j stays below half a period.
    """

    most_sorters = 8

    def __init__(self, particle_count: int, dimensions: int, period: Any = (0.0, 0.0, 0.0), origin: Any = (0.0, 0.0, 0.0)):
        """Allocate; needs a started Taichi, whose precision and thread count it takes."""
        config = ti.lang.impl.current_cfg()
        self.particle_count, self.dimensions = particle_count, dimensions
        self.period = tuple(float(edge) for edge in period)
        self.origin = np.array(origin, float)[:dimensions]
        self.repeats = tuple(edge > 0.0 for edge in self.period)
        self.epsilon = float(np.finfo(np.float32 if config.default_fp == ti.f32 else np.float64).eps)
        self.sorter_count = min(config.cpu_max_num_threads, self.most_sorters)
        self.scan_count = 8 * config.cpu_max_num_threads
        buckets = BUCKETS_PER_SPHERE * particle_count + 4 * MAXIMUM_LEVELS
        self.order, self.key, self.start, self.tally, self.scan = (ti.field(ti.i32) for _ in range(5))
        self.sorted_position = ti.Vector.field(dimensions, float)
        self.sorted_reach = ti.field(float)
        self.bounds = ti.Vector.field(2 * dimensions + 2, float)
        self.bin_count, self.level_of_bin = ti.field(ti.i32), ti.field(ti.i32)
        level_numbers, level_integers = self._make_level_fields()
        numbers, integers = ti.FieldsBuilder(), ti.FieldsBuilder()  # apart: see State._builder
        numbers.dense(ti.i, particle_count).place(self.sorted_position, self.sorted_reach)  # read together
        for builder, count, fields in (
            (numbers, CHUNKS, (self.bounds,)),
            (numbers, MAXIMUM_LEVELS, level_numbers),
            (integers, particle_count, (self.order, self.key)),
            (integers, buckets + 1, (self.start,)),
            (integers, self.sorter_count * buckets, (self.tally,)),
            (integers, self.scan_count + 1, (self.scan,)),
            (integers, BINS, (self.bin_count, self.level_of_bin)),
            (integers, MAXIMUM_LEVELS, level_integers),
        ):
            for field in fields:
                builder.dense(ti.i, count).place(field)
        self._trees = [numbers.finalize(), integers.finalize()]

    def destroy(self) -> None:
        """Give the memory back."""
        for tree in self._trees:
            tree.destroy()

    # Building ----------------------------------------------------------------------------------------------------------

    def build(self, position: Any, reach: Any, bounds: Any = None, skin: float = 0.0) -> None:
        """Sort the spheres, each with its reach and `skin` more.

        `bounds`: (lower, upper, least reach, largest reach) without the skin, if known; else they are measured.
        """
        lower, upper, least, largest = bounds or self.measure(position, reach)
        least, largest = least + skin, largest + skin
        # On a lattice of the widest cells, so that most of the time it is the box of the time before.
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
        self.set_levels(reaches, counts, extent, corner, ROUNDINGS * self.epsilon * size)
        self._sort(position, reach, skin, largest, self.bucket_count)

    def measure(self, position: Any, reach: Any) -> tuple[np.ndarray, np.ndarray, float, float]:
        """Bounding box, least and largest reach."""
        found = self._measure(position, reach)
        d = self.dimensions
        return np.array(found[:d]), np.array(found[3 : 3 + d]), found[6], found[7]

    @ti.kernel
    def _measure(self, position: Template, reach: Template) -> ti.types.vector(8, ti.f64):
        grain = ti.static(loop_grain())
        for q in range(CHUNKS * grain):
            if q % grain == 0:
                chunk = q // grain
                lower = ti.Vector([ti.math.inf] * self.dimensions, float)
                upper = -lower
                least, largest = ti.math.inf, 0.0
                for i in range(self._begin(chunk, CHUNKS), self._begin(chunk + 1, CHUNKS)):
                    lower = ti.min(lower, position[i])
                    upper = ti.max(upper, position[i])
                    least = ti.min(least, reach[i])
                    largest = ti.max(largest, reach[i])
                for axis in ti.static(range(self.dimensions)):
                    self.bounds[chunk][axis] = lower[axis]
                    self.bounds[chunk][self.dimensions + axis] = upper[axis]
                self.bounds[chunk][2 * self.dimensions] = least
                self.bounds[chunk][2 * self.dimensions + 1] = largest
        lower, upper = ti.Vector([ti.math.inf] * 3, ti.f64), ti.Vector([-ti.math.inf] * 3, ti.f64)
        least, largest = ti.cast(ti.math.inf, ti.f64), ti.cast(0.0, ti.f64)
        ti.loop_config(serialize=True)
        for chunk in range(CHUNKS):
            found = ti.cast(self.bounds[chunk], ti.f64)
            for axis in ti.static(range(self.dimensions)):
                lower[axis] = ti.min(lower[axis], found[axis])
                upper[axis] = ti.max(upper[axis], found[self.dimensions + axis])
            least = ti.min(least, found[2 * self.dimensions])
            largest = ti.max(largest, found[2 * self.dimensions + 1])
        return ti.Vector([lower[0], lower[1], lower[2], upper[0], upper[1], upper[2], least, largest])

    @ti.func
    def begin_of(self, chunk):
        """First slot of a chunk."""
        return self._begin(chunk, CHUNKS)

    @ti.func
    def _begin(self, part, parts):
        """First of the spheres of a part; 64 bits, because the product may not fit 32."""
        return ti.cast(ti.cast(part, ti.i64) * self.particle_count // parts, ti.i32)

    @ti.kernel
    def _count_bins(self, reach: Template, skin: float, largest: float):
        for b in self.bin_count:
            self.bin_count[b] = 0
        for i in range(self.particle_count):
            ti.atomic_add(self.bin_count[self._bin(reach[i] + skin, largest)], 1)  # whole numbers: their sum has no order

    @ti.func
    def _bin(self, reach, largest):
        """Eighths of an octave below the largest reach."""
        below = BINS - 1.0
        if reach > 0.0:
            below = ti.min(below, BINS_PER_OCTAVE * (ti.log(largest / reach) / ti.log(2.0)))
        return ti.cast(ti.max(below, 0.0), ti.i32)

    @ti.kernel
    def _sort(self, position: Template, reach: Template, skin: float, largest: float, buckets: ti.i32):
        for k in range(buckets * self.sorter_count):
            self.tally[k] = 0
        # Each sorter takes a run of spheres, so that within a bucket spheres stay in the order of their index.
        grain = ti.static(loop_grain())
        for q in range(self.sorter_count * grain):
            if q % grain == 0:
                sorter = q // grain
                for i in range(self._begin(sorter, self.sorter_count), self._begin(sorter + 1, self.sorter_count)):
                    bucket = self._bucket_of(position[i], reach[i] + skin, largest)
                    self.key[i] = bucket
                    self.tally[sorter * buckets + bucket] = self.tally[sorter * buckets + bucket] + 1
        for q in range(self.scan_count * grain):
            if q % grain == 0:
                part = q // grain
                total = 0
                for bucket in range(self._part(part, buckets), self._part(part + 1, buckets)):
                    for sorter in range(self.sorter_count):
                        total += self.tally[sorter * buckets + bucket]
                self.scan[part + 1] = total
        ti.loop_config(serialize=True)
        for part in range(self.scan_count):
            if part == 0:
                self.scan[0] = 0
            self.scan[part + 1] = self.scan[part + 1] + self.scan[part]
        for q in range(self.scan_count * grain):
            if q % grain == 0:
                part = q // grain
                slot = self.scan[part]
                for bucket in range(self._part(part, buckets), self._part(part + 1, buckets)):
                    self.start[bucket] = slot
                    for sorter in range(self.sorter_count):
                        k = sorter * buckets + bucket
                        here = self.tally[k]
                        self.tally[k] = slot
                        slot += here
                if part == self.scan_count - 1:
                    self.start[buckets] = slot
        for q in range(self.sorter_count * grain):
            if q % grain == 0:
                sorter = q // grain
                for i in range(self._begin(sorter, self.sorter_count), self._begin(sorter + 1, self.sorter_count)):
                    k = sorter * buckets + self.key[i]
                    slot = self.tally[k]
                    self.tally[k] = slot + 1
                    self.order[slot] = i
        for slot in range(self.particle_count):
            i = self.order[slot]
            self.sorted_position[slot] = self._inside(position[i])
            self.sorted_reach[slot] = reach[i] + skin

    @ti.func
    def _bucket_of(self, x, reach, largest):
        level = 0
        if self.level_count[0] > 1:
            level = self.level_of_bin[self._bin(reach, largest)]
        return self._bucket(self._cell(self._inside(x), level), level)

    @ti.func
    def _part(self, part, buckets):
        return ti.cast(ti.cast(part, ti.i64) * buckets // self.scan_count, ti.i32)

    @ti.func
    def _coordinate(self, x, level):
        """Place inside the box in units of cells."""
        return (x - self.corner[0]) * self.level_inverse[level]

    @ti.func
    def _cell(self, x, level):
        place = self._coordinate(x, level)
        cell = ti.Vector.zero(ti.i32, 3)
        for axis in ti.static(range(self.dimensions)):
            last = self.level_cells[level][axis] - 1
            cell[axis] = ti.max(0, ti.min(ti.cast(place[axis], ti.i32), last))
        return cell

    @ti.func
    def _bucket(self, cell, level):
        """Of cells in a row along x the buckets follow each other, but at the end of a folded table."""
        strides = self.level_strides[level]
        folded = ti.cast(cell[0], ti.u32) + ti.cast(cell[1], ti.u32) * strides[0] + ti.cast(cell[2], ti.u32) * strides[1]
        return self.level_offset[level] + ti.cast(folded & ti.cast(self.level_mask[level], ti.u32), ti.i32)

    # Looking -----------------------------------------------------------------------------------------------------------

    @ti.func
    def visit_later(self, slot, task: Template, first, second):
        """task(slot, other slot, first, second) for each candidate partner of a slot that comes after it.

        Levels follow each other in the slots, small reaches first, so that all slots together see each pair once.
        """
        self._visit(self.sorted_position[slot], self.sorted_reach[slot], slot, task, slot, first, second)

    @ti.func
    def visit(self, slot, task: Template, first, second):
        """The same for every candidate partner, and for the slot itself."""
        self._visit(self.sorted_position[slot], self.sorted_reach[slot], -1, task, slot, first, second)

    @ti.func
    def _visit(self, x, reach, after, task: Template, subject, first, second):
        for level in range(self.level_count[0]):
            level_end = self.start[self.level_offset[level] + self.level_buckets[level]]
            if level_end > after + 1:
                self._visit_level(level, x, reach, after, task, subject, first, second)

    @ti.func
    def _visit_level(self, level, x, reach, after, task: Template, subject, first, second):
        # In local variables, because a task that writes fields would have them read again for each row.
        offset, cells, strides = self.level_offset[level], self.level_cells[level], self.level_strides[level]
        mask = ti.cast(self.level_mask[level], ti.u32)
        level_begin, level_end = self.start[offset], self.start[offset + self.level_buckets[level]]
        lowest, highest = self._cells_within(level, x, reach + self.level_reach[level] + self.slack[0])
        spans = ti.cast(highest - lowest + 1, float)
        everything = spans[0] * spans[1] * spans[2] > level_end - level_begin
        folded = self.level_mask[level] >= 0 and not everything
        # Cells in a row along x follow each other, but where the box repeats and where far ones share a bucket.
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
                own = self._cell(x, level)
                first_row = ti.Vector([own[1], own[2]])  # rows before it hold earlier slots only
        for z in range(first_row[1], highest[2] + 1):
            for y in range(first_row[0] if z == first_row[1] else lowest[1], highest[1] + 1):
                cell = self._wrapped(ti.Vector([west, y, z]), cells)
                row = ti.cast(cell[1], ti.u32) * strides[0] + ti.cast(cell[2], ti.u32) * strides[1]
                for run in range(runs):
                    last = east
                    if folded:
                        cell[0] = self._wrapped(ti.Vector([lowest[0] + run, y, z]), cells)[0]
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
                        if self._square_distance(x, self.sorted_position[slot]) <= together * together:
                            # Without this a pair whose cells share a bucket would be seen twice.
                            if not folded or (self._cell(self.sorted_position[slot], level) == cell).all():
                                task(subject, slot, first, second)

    @ti.func
    def separation(self, slot, other):
        """From a slot to the nearest image of another, to round-off of the box."""
        return nearest_image(self.sorted_position[other] - self.sorted_position[slot], self.period)

    @ti.func
    def _square_distance(self, x, y):
        """Between nearest images of two places inside the box."""
        separation = y - x
        for axis in ti.static(range(self.dimensions)):
            if ti.static(self.repeats[axis]):
                # Less than a period apart: a fold, where a quotient would cost more than all the rest.
                way = ti.abs(separation[axis])
                back = self.period[axis] - way
                separation[axis] = ti.select(way < back, way, back)
        return separation.dot(separation)

    @ti.func
    def _inside(self, x):
        """The image of a place inside the box."""
        result = x
        for axis in ti.static(range(self.dimensions)):
            if ti.static(self.repeats[axis]):
                edge = self.period[axis]
                beyond = result[axis] - self.corner[0][axis]
                if not (0.0 <= beyond and beyond < edge):
                    result[axis] -= edge * ti.floor(beyond / edge)
        return result

    @ti.func
    def _cells_within(self, level, x, distance):
        """First and last cell along each axis; before 0 or beyond the last only where the axis repeats, and none twice."""
        place = self._coordinate(x, level)
        lowest = ti.Vector.zero(ti.i32, 3)
        highest = ti.Vector.zero(ti.i32, 3)
        for axis in ti.static(range(self.dimensions)):
            cells = self.level_cells[level][axis]
            width = ti.cast(cells, float)
            around = distance * self.level_inverse[level][axis]
            if ti.static(self.repeats[axis]):
                # A cast rounds down what is counted from a period below; limits first, for places that are no number.
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
    def _wrapped(self, cell, cells):
        result = cell
        for axis in ti.static(range(self.dimensions)):
            if ti.static(self.repeats[axis]):
                if result[axis] < 0:
                    result[axis] += cells[axis]
                elif result[axis] >= cells[axis]:
                    result[axis] -= cells[axis]
        return result
