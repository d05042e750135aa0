"""Cell grid of a CPU: finds the pairs of spheres that may touch, by cells that each thread sorts its spheres into."""

from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.device.heavy_loops import is_heavy, loop_grain
from mpp_taichi.neighbors._levels import BINS, BINS_PER_OCTAVE
from mpp_taichi.neighbors._sphere_grid import CHUNKS, SphereGrid
from mpp_taichi.state.field_group import FieldGroup
from mpp_taichi.types import Template

MOST_SORTERS = 8


@ti.data_oriented
class CellGrid(SphereGrid):
    """A SphereGrid whose spheres are measured in chunks and sorted by a few sorters, each with a run of spheres."""

    def __init__(self, particle_count: int, dimensions: int, period: Any = (0.0, 0.0, 0.0), origin: Any = (0.0, 0.0, 0.0)):
        """Allocate; needs a started Taichi, whose precision and thread count it takes."""
        threads = ti.lang.impl.current_cfg().cpu_max_num_threads
        SphereGrid.__init__(self, particle_count, dimensions, period, origin, sorter_count=min(threads, MOST_SORTERS))
        self.scan_count = 8 * threads
        self.scan = ti.field(ti.i32)
        self._scan_memory = FieldGroup((self.scan_count + 1, self.scan))

    def destroy(self) -> None:
        """Free the memory."""
        self.free_cells()
        self._scan_memory.destroy()

    def measure(self, position: Any, reach: Any) -> tuple[np.ndarray, np.ndarray, float, float]:
        """Lower and upper corner of the bounding box, least and largest reach."""
        found = self._measure(position, reach)
        d = self.dimensions
        return np.array(found[:d]), np.array(found[3 : 3 + d]), found[6], found[7]

    @ti.kernel
    def _measure(self, position: Template, reach: Template) -> ti.types.vector(8, ti.f64):
        grain = ti.static(loop_grain())
        for q in range(CHUNKS * grain):
            if is_heavy(q, grain):
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
    def _bin(self, reach, largest):
        """Bin of a reach: eighths of an octave below the largest reach."""
        below = BINS - 1.0
        if reach > 0.0:
            below = ti.min(below, BINS_PER_OCTAVE * (ti.log(largest / reach) / ti.log(2.0)))
        return ti.cast(ti.max(below, 0.0), ti.i32)

    @ti.kernel
    def _sort(self, position: Template, reach: Template, skin: float, largest: float, buckets: ti.i32):
        for k in range(buckets * self.sorter_count):
            self.tally[k] = 0
        # Each sorter takes a run of spheres, so that the spheres of a bucket stay in the order of their index.
        grain = ti.static(loop_grain())
        for q in range(self.sorter_count * grain):
            if is_heavy(q, grain):
                sorter = q // grain
                for i in range(self._begin(sorter, self.sorter_count), self._begin(sorter + 1, self.sorter_count)):
                    bucket = self._bucket_of(position[i], reach[i] + skin, largest)
                    self.key[i] = bucket
                    self.tally[sorter * buckets + bucket] = self.tally[sorter * buckets + bucket] + 1
        for q in range(self.scan_count * grain):
            if is_heavy(q, grain):
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
            if is_heavy(q, grain):
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
            if is_heavy(q, grain):
                sorter = q // grain
                for i in range(self._begin(sorter, self.sorter_count), self._begin(sorter + 1, self.sorter_count)):
                    k = sorter * buckets + self.key[i]
                    slot = self.tally[k]
                    self.tally[k] = slot + 1
                    self.order[slot] = i
        for slot in range(self.particle_count):
            i = self.order[slot]
            self.sorted_position[slot] = self.inside(position[i])
            self.sorted_reach[slot] = reach[i] + skin

    @ti.func
    def _part(self, part, buckets):
        return ti.cast(ti.cast(part, ti.i64) * buckets // self.scan_count, ti.i32)
