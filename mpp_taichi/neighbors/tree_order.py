"""Tree order: bodies sorted along Hilbert's curve, in the frame that the tree works in.

The unit of length of the frame is a power of two above the largest coordinate, so that products of many lengths stay within the
range of f32. The frame changes no separation of two bodies, not even by a rounding: a product with a power of two is exact, and
along each axis the origin moves only where no coordinate is more than twice another; differences from the mean are then exact
(Sterbenz, Floating-Point Computation, 1974, theorem 4.3.1). Hilbert's curve visits 2^20 cells along each axis, and each step of
the curve leads to a neighbour cell: bodies that follow each other on the curve are near each other. Source of the index:
Skilling, AIP Conf. Proc. 707 (2004) 381.
"""

import math
from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.device.heavy_loops import CPU_GRAIN, is_heavy
from mpp_taichi.state.field_group import FieldGroup
from mpp_taichi.types import Template

CHUNKS = 256  # of a reduction; a fixed number, so that sums do not depend on the threads
AXIS_BITS = 20  # of a coordinate
DIGIT_BITS = 10  # bits of a key by which one pass sorts
WIDEST_FRAME = 64.0
"""Half width of the cells, in mean distances from the mean position. At most one body in 64 lies farther out, sorted less
well. If the cells had to hold all bodies, one distant body could leave no cells to the others."""


@ti.data_oriented
class TreeOrder:
    """The bodies in the order of the curve, and in the order of their index within a cell, whatever the number of threads.

    order      (count,) index of the body in each slot
    position   (dimensions × padded_count,) coordinates by slot in the frame, axis after axis
    mass       (padded_count,) by slot, in units of `mass_unit`

    Slots from `particle_count` on hold bodies without mass, each at a different place.
    """

    def __init__(self, particle_count: int, padded_count: int, dimensions: int, *, on_cpu: bool) -> None:
        """Allocate; needs a started Taichi, whose precision and thread count it takes."""
        config = ti.lang.impl.current_cfg()
        self.particle_count = particle_count
        self.padded_count = padded_count
        self.dimensions = dimensions
        self.grain = CPU_GRAIN if on_cpu else 1
        self.sorter_count = min(config.cpu_max_num_threads, 8) if on_cpu else 256
        self.buckets = 1 << DIGIT_BITS
        self.scan_count = 8
        self.words = -(-AXIS_BITS * dimensions // 30)
        self.order, self.other_order = ti.field(ti.i32), ti.field(ti.i32)
        self.key = tuple(ti.field(ti.u32) for _ in range(self.words))
        self.other_key = tuple(ti.field(ti.u32) for _ in range(self.words))
        self.tally, self.scan = ti.field(ti.i32), ti.field(ti.i32)
        self.position, self.mass, self.partial = ti.field(float), ti.field(float), ti.field(float)
        self._memory = FieldGroup(
            (particle_count, self.order, self.other_order, *self.key, *self.other_key),
            (self.sorter_count * self.buckets, self.tally),
            (self.scan_count + 1, self.scan),
            (padded_count * dimensions, self.position),
            (padded_count, self.mass),
            (CHUNKS * (3 * dimensions + 1), self.partial),
        )
        self.length = 1.0
        self.mass_unit = 1.0

    def destroy(self) -> None:
        """Free the memory."""
        self._memory.destroy()

    def build(self, position: Any, mass: Any) -> bool:
        """Sort the bodies; False, without a sort, where a position or a mass is not finite."""
        d = self.dimensions
        self._sum_up(position, mass)
        sums = self._partial_rows()
        total_mass = float(sums[:, 3 * d].sum())
        mean = sums[:, :d].sum(0) / self.particle_count
        if not (np.isfinite(mean).all() and math.isfinite(total_mass)):
            return False
        lowest, highest = sums[:, d : 2 * d].min(0), sums[:, 2 * d : 3 * d].max(0)
        mean = np.clip(mean, lowest, highest)
        self._deviate(position, *_in_space(mean))
        deviation = float(self._partial_rows()[:, :d].sum(0).max()) / self.particle_count
        largest = float(np.maximum(highest - mean, mean - lowest).max())
        origin = np.where(_is_narrow(lowest, highest), mean, 0.0)
        self.length = _power_of_two(float(np.maximum(highest - origin, origin - lowest).max()))
        self.mass_unit = _power_of_two(total_mass)
        width = min(largest, WIDEST_FRAME * deviation) or 1.0
        self._place(position, *_in_space(mean), 0.5 / width)
        for word in reversed(range(self.words)):
            for shift in range(0, 30, DIGIT_BITS):
                self._sort(word, shift)
        self._gather(position, mass, *_in_space(origin), 1.0 / self.length, 1.0 / self.mass_unit)
        return True

    def _partial_rows(self) -> np.ndarray:
        return self.partial.to_numpy().reshape(CHUNKS, -1).astype(float)

    @ti.func
    def _begin(self, part, parts):
        """Index of the first body of a part; in 64 bits, because the product may not fit 32."""
        return ti.cast(ti.cast(part, ti.i64) * self.particle_count // parts, ti.i32)

    @ti.kernel
    def _sum_up(self, position: Template, mass: Template):
        for q in range(CHUNKS * self.grain):
            if is_heavy(q, self.grain):
                chunk = q // self.grain
                total = ti.Vector.zero(float, self.dimensions)
                lowest, highest = total + ti.math.inf, total - ti.math.inf
                weight = 0.0
                for i in range(self._begin(chunk, CHUNKS), self._begin(chunk + 1, CHUNKS)):
                    total += position[i]
                    lowest, highest = ti.min(lowest, position[i]), ti.max(highest, position[i])
                    weight += mass[i]
                row = chunk * (3 * self.dimensions + 1)
                for axis in ti.static(range(self.dimensions)):
                    self.partial[row + axis] = total[axis]
                    self.partial[row + self.dimensions + axis] = lowest[axis]
                    self.partial[row + 2 * self.dimensions + axis] = highest[axis]
                self.partial[row + 3 * self.dimensions] = weight

    @ti.kernel
    def _deviate(self, position: Template, x: float, y: float, z: float):
        center = ti.Vector([x, y, z])
        for q in range(CHUNKS * self.grain):
            if is_heavy(q, self.grain):
                chunk = q // self.grain
                total = ti.Vector.zero(float, self.dimensions)
                for i in range(self._begin(chunk, CHUNKS), self._begin(chunk + 1, CHUNKS)):
                    for axis in ti.static(range(self.dimensions)):
                        total[axis] += ti.abs(position[i][axis] - center[axis])
                for axis in ti.static(range(self.dimensions)):
                    self.partial[chunk * (3 * self.dimensions + 1) + axis] = total[axis]

    @ti.kernel
    def _place(self, position: Template, x: float, y: float, z: float, stretch: float):
        """Set the key of each body; `stretch` maps the half width of the cells to half of them."""
        center = ti.Vector([x, y, z])
        for i in range(self.particle_count):
            cell = ti.Vector.zero(ti.u32, self.dimensions)
            for axis in ti.static(range(self.dimensions)):
                share = (position[i][axis] - center[axis]) * stretch + 0.5
                inside = ti.max(0.0, ti.min(share * (1 << AXIS_BITS), (1 << AXIS_BITS) - 1.0))
                cell[axis] = ti.cast(inside, ti.u32)
            index = self._hilbert(cell)
            for word in ti.static(range(self.words)):
                self.key[word][i] = index[word]
            self.order[i] = i

    @ti.func
    def _hilbert(self, cell):
        """Index on the curve as words of 30 bits, the most significant first."""
        x = cell
        last = ti.static(self.dimensions - 1)
        for step in range(AXIS_BITS - 1):
            bit = ti.cast(AXIS_BITS - 1 - step, ti.u32)
            lower = (ti.cast(1, ti.u32) << bit) - ti.cast(1, ti.u32)
            for axis in ti.static(range(self.dimensions)):
                chosen = ti.cast(0, ti.u32) - ((x[axis] >> bit) & ti.cast(1, ti.u32))  # all ones where the bit is set
                swap = (x[0] ^ x[axis]) & lower & ~chosen
                x[0] ^= swap ^ (lower & chosen)
                x[axis] ^= swap
        for axis in ti.static(range(1, self.dimensions)):
            x[axis] ^= x[axis - 1]
        turn = x[last]
        for shift in ti.static((1, 2, 4, 8, 16)):
            turn ^= turn >> ti.cast(shift, ti.u32)
        turn >>= ti.cast(1, ti.u32)
        words = ti.Vector.zero(ti.u32, self.words)
        for axis in ti.static(range(self.dimensions)):
            x[axis] ^= turn
        for word in ti.static(range(self.words)):
            bits = ti.static(30 // self.dimensions)
            below = ti.static(AXIS_BITS - bits * (word + 1))
            for k in ti.static(range(min(bits, AXIS_BITS - bits * word))):
                for axis in ti.static(range(self.dimensions)):
                    bit = (x[axis] >> ti.cast(max(below, 0) + k, ti.u32)) & ti.cast(1, ti.u32)
                    words[word] |= bit << ti.cast(k * self.dimensions + last - axis, ti.u32)
        return words

    @ti.kernel
    def _sort(self, word: Template, shift: ti.u32):
        """One stable pass by a digit. Each sorter takes a run of bodies, and equal digits stay in the order of the runs."""
        for k in range(self.sorter_count * self.buckets):
            self.tally[k] = 0
        for q in range(self.sorter_count * self.grain):
            if is_heavy(q, self.grain):
                sorter = q // self.grain
                row = sorter * self.buckets
                for slot in range(self._begin(sorter, self.sorter_count), self._begin(sorter + 1, self.sorter_count)):
                    digit = ti.cast((self.key[word][slot] >> shift) & ti.cast(self.buckets - 1, ti.u32), ti.i32)
                    self.tally[row + digit] = self.tally[row + digit] + 1
        share = ti.static(self.buckets // self.scan_count)
        for q in range(self.scan_count * self.grain):
            if is_heavy(q, self.grain):
                part = q // self.grain
                total = 0
                for bucket in range(part * share, (part + 1) * share):
                    for sorter in range(self.sorter_count):
                        total += self.tally[sorter * self.buckets + bucket]
                self.scan[part + 1] = total
        for q in range(self.scan_count * self.grain):
            if is_heavy(q, self.grain):
                part = q // self.grain
                slot = 0
                for earlier in range(part):
                    slot += self.scan[earlier + 1]
                for bucket in range(part * share, (part + 1) * share):
                    for sorter in range(self.sorter_count):
                        k = sorter * self.buckets + bucket
                        here = self.tally[k]
                        self.tally[k] = slot
                        slot += here
        for q in range(self.sorter_count * self.grain):
            if is_heavy(q, self.grain):
                sorter = q // self.grain
                row = sorter * self.buckets
                for slot in range(self._begin(sorter, self.sorter_count), self._begin(sorter + 1, self.sorter_count)):
                    digit = ti.cast((self.key[word][slot] >> shift) & ti.cast(self.buckets - 1, ti.u32), ti.i32)
                    target = self.tally[row + digit]
                    self.tally[row + digit] = target + 1
                    self.other_order[target] = self.order[slot]
                    for each in ti.static(range(word + 1)):
                        self.other_key[each][target] = self.key[each][slot]
        for slot in range(self.particle_count):
            self.order[slot] = self.other_order[slot]
            for each in ti.static(range(word + 1)):
                self.key[each][slot] = self.other_key[each][slot]

    @ti.kernel
    def _gather(self, position: Template, mass: Template, x: float, y: float, z: float, per_length: float, per_mass: float):
        origin = ti.Vector([x, y, z])
        for slot in range(self.padded_count):
            if slot < self.particle_count:
                i = self.order[slot]
                for axis in ti.static(range(self.dimensions)):
                    self.position[axis * self.padded_count + slot] = (position[i][axis] - origin[axis]) * per_length
                self.mass[slot] = mass[i] * per_mass
            else:
                # Outside the frame, and at different places, so that no distance is 0.
                for axis in ti.static(range(self.dimensions)):
                    self.position[axis * self.padded_count + slot] = 2.0 + ti.cast(slot - self.particle_count, float)
                self.mass[slot] = 0.0


def _power_of_two(size: float) -> float:
    """The least power of two above a size; 1 where there is none."""
    return math.ldexp(1.0, math.frexp(size)[1]) if size > 0.0 else 1.0


def _is_narrow(lowest: np.ndarray, highest: np.ndarray) -> np.ndarray:
    """Along which axes all coordinates have one sign, and none is more than twice another."""
    near, far = np.minimum(abs(lowest), abs(highest)), np.maximum(abs(lowest), abs(highest))
    return (lowest * highest > 0.0) & (far <= 2.0 * near)


def _in_space(vector: np.ndarray) -> tuple[float, float, float]:
    """The components of a vector, with zeros up to the third."""
    x, y, z = (*vector.tolist(), 0.0)[:3]
    return x, y, z
