"""Cell grid of a GPU: the same cells and the same order as on a CPU, built by one thread for each sphere."""

from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.neighbors._levels import BINS, BINS_PER_OCTAVE
from mpp_taichi.neighbors._sphere_grid import CHUNKS, SphereGrid
from mpp_taichi.neighbors.prefix_sum import PrefixSum
from mpp_taichi.state.field_group import FieldGroup
from mpp_taichi.types import Template

STRIPES = 64  # of the spheres, for each of the CHUNKS: a thread measures each stripe
EDGE = 1e-3  # of a bin; f32 holds 8 · 24 octaves to 2e-5


@ti.data_oriented
class DeviceGrid(SphereGrid):
    """A SphereGrid whose inner loops have no more iterations than a cell has spheres, or a thread its share.

    An atomic count gives each sphere a place in its cell, in any order. Then a thread for each sphere counts the spheres of the
    cell that have a lower index. So the order is the same as on the CPU, whatever the order of the threads. An inner loop has
    no atomic, because software Vulkan (Mesa 22.3) ends a thread at an atomic in an inner loop.
    """

    def __init__(self, particle_count: int, dimensions: int, period: Any = (0.0, 0.0, 0.0), origin: Any = (0.0, 0.0, 0.0)):
        """Allocate; needs a started Taichi."""
        SphereGrid.__init__(self, particle_count, dimensions, period, origin, sorter_count=1)
        self.sums = PrefixSum(self.tally.shape[0])
        self.arrival, self.arrived = ti.field(ti.i32), ti.field(ti.i32)
        self.stripe = ti.Vector.field(2 * dimensions + 2, float)
        self._sort_memory = FieldGroup((particle_count, self.arrival, self.arrived), (CHUNKS * STRIPES, self.stripe))

    def destroy(self) -> None:
        """Free the memory."""
        self.free_cells()
        self.sums.destroy()
        self._sort_memory.destroy()

    def measure(self, position: Any, reach: Any) -> tuple[np.ndarray, np.ndarray, float, float]:
        """Lower and upper corner of the bounding box, least and largest reach."""
        self._measure_stripes(position, reach)
        found = self.bounds.to_numpy().astype(float)
        d = self.dimensions
        return found[:, :d].min(0), found[:, d : 2 * d].max(0), float(found[:, 2 * d].min()), float(found[:, 2 * d + 1].max())

    @ti.kernel
    def _measure_stripes(self, position: Template, reach: Template):
        for stripe in range(CHUNKS * STRIPES):
            lower = ti.Vector([ti.math.inf] * self.dimensions, float)
            upper = -lower
            least, largest = ti.math.inf, 0.0
            for turn in range((self.particle_count - stripe + CHUNKS * STRIPES - 1) // (CHUNKS * STRIPES)):
                i = stripe + turn * (CHUNKS * STRIPES)
                lower = ti.min(lower, position[i])
                upper = ti.max(upper, position[i])
                least = ti.min(least, reach[i])
                largest = ti.max(largest, reach[i])
            for axis in ti.static(range(self.dimensions)):
                self.stripe[stripe][axis] = lower[axis]
                self.stripe[stripe][self.dimensions + axis] = upper[axis]
            self.stripe[stripe][2 * self.dimensions] = least
            self.stripe[stripe][2 * self.dimensions + 1] = largest
        for chunk in range(CHUNKS):
            found = self.stripe[chunk]
            for turn in range(1, STRIPES):
                other = self.stripe[chunk + turn * CHUNKS]
                for k in ti.static(range(2 * self.dimensions + 2)):
                    if ti.static(k < self.dimensions or k == 2 * self.dimensions):
                        found[k] = ti.min(found[k], other[k])
                    else:
                        found[k] = ti.max(found[k], other[k])
            self.bounds[chunk] = found

    @ti.func
    def _bin(self, reach, largest):
        """Bin of a reach, by a logarithm in f32, the only logarithm of Vulkan.

        A reach near the edge of two bins takes the bin of the larger reaches.
        """
        below = ti.cast(BINS - 1, ti.f32)
        if reach > 0.0:
            octaves = ti.log(ti.cast(largest / reach, ti.f32)) / ti.log(ti.cast(2.0, ti.f32))
            below = ti.min(below, BINS_PER_OCTAVE * octaves - EDGE)
        return ti.cast(ti.max(below, 0.0), ti.i32)

    def _sort(self, position: Any, reach: Any, skin: float, largest: float, buckets: int) -> None:
        self._enter(position, reach, skin, largest, buckets)
        self.sums.run(self.tally, self.start, buckets)
        self._leave(position, reach, skin)

    @ti.kernel
    def _enter(self, position: Template, reach: Template, skin: float, largest: float, buckets: ti.i32):
        for k in range(buckets):
            self.tally[k] = 0
        for i in range(self.particle_count):
            bucket = self._bucket_of(position[i], reach[i] + skin, largest)
            self.key[i] = bucket
            self.arrival[i] = ti.atomic_add(self.tally[bucket], 1)

    @ti.kernel
    def _leave(self, position: Template, reach: Template, skin: float):
        for i in range(self.particle_count):
            self.arrived[self.start[self.key[i]] + self.arrival[i]] = i
        for place in range(self.particle_count):
            i = self.arrived[place]
            begin, end = self.start[self.key[i]], self.start[self.key[i] + 1]
            slot = begin
            for other in range(begin, end):
                if self.arrived[other] < i:
                    slot += 1
            self.order[slot] = i
            self.sorted_position[slot] = self.inside(position[i])
            self.sorted_reach[slot] = reach[i] + skin
