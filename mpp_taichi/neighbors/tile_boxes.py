"""Tile boxes: particles in tiles along Hilbert's curve, the boxes around tiles, and a binary tree of the boxes."""

from typing import Any

import taichi as ti

from mpp_taichi.neighbors.periodic import inside_box
from mpp_taichi.neighbors.tree_order import TreeOrder
from mpp_taichi.state.field_group import FieldGroup
from mpp_taichi.types import Template


@ti.data_oriented
class TileBoxes:
    """Tiles of `lanes` particles that follow each other along Hilbert's curve, so that they are near each other.

    order      (count,) index of the particle in each slot; tile t has the slots from t · lanes on
    inside     (count,) position of each particle in the box that repeats, or anywhere where none repeats [length]
    placed     (count,) the same by slot
    lower      (2 · leaf_count,) lower corners of boxes: box leaf_count + t is the box of tile t, and box k holds the boxes 2 k
               and 2 k + 1. A box without particles is empty: its lower corner is at +∞, its upper corner at −∞.
    upper      (2 · leaf_count,) upper corners
    """

    def __init__(self, particle_count: int, dimensions: int, lanes: int, period: Any, origin: Any, *, on_cpu: bool) -> None:
        """Allocate; needs a started Taichi."""
        self.particle_count, self.dimensions, self.lanes = particle_count, dimensions, lanes
        self.period, self.origin = tuple(period)[:dimensions], tuple(origin)[:dimensions]
        self.tile_count = -(-particle_count // lanes)
        self.leaf_count = 1 << max(1, (self.tile_count - 1).bit_length())
        self.curve = TreeOrder(particle_count, self.tile_count * lanes, dimensions, on_cpu=on_cpu)
        self.order = self.curve.order
        self.inside, self.placed, self.lower, self.upper = (ti.Vector.field(dimensions, float) for _ in range(4))
        self.weight = ti.field(float)  # of a particle in the sums by which the curve is laid
        self._memory = FieldGroup(
            (particle_count, self.inside, self.placed, self.weight), (2 * self.leaf_count, (self.lower, self.upper))
        )
        self.weight.fill(1.0)

    def destroy(self) -> None:
        """Free the memory."""
        self.curve.destroy()
        self._memory.destroy()

    def build(self, position: Any) -> bool:
        """Sort the particles and measure all boxes; False where a position is not finite."""
        self._fold(position)
        if not self.curve.build(self.inside, self.weight):
            return False
        self._measure_tiles()
        first = self.leaf_count // 2
        while first:
            self._join(first)
            first //= 2
        return True

    @ti.kernel
    def _fold(self, position: Template):
        for i in range(self.particle_count):
            self.inside[i] = inside_box(position[i], ti.Vector(self.origin, float), self.period)

    @ti.kernel
    def _measure_tiles(self):
        for tile in range(self.leaf_count):
            lower = ti.Vector([ti.math.inf] * self.dimensions, float)
            upper = -lower
            for slot in range(tile * self.lanes, ti.min((tile + 1) * self.lanes, self.particle_count)):
                place = self.inside[self.order[slot]]
                self.placed[slot] = place
                lower, upper = ti.min(lower, place), ti.max(upper, place)
            self.lower[self.leaf_count + tile] = lower
            self.upper[self.leaf_count + tile] = upper

    @ti.kernel
    def _join(self, first: ti.i32):
        """The boxes from `first` up to 2 `first` − 1, from those of the level below."""
        for k in range(first):
            box = first + k
            self.lower[box] = ti.min(self.lower[2 * box], self.lower[2 * box + 1])
            self.upper[box] = ti.max(self.upper[2 * box], self.upper[2 * box + 1])

    @ti.func
    def is_near(self, lower, upper, box, shift, reach_squared):
        """Whether a box with these corners is nearer than the reach to another box that is shifted."""
        gap = ti.max(self.lower[box] + shift - upper, lower - self.upper[box] - shift, 0.0)
        return gap.dot(gap) <= reach_squared
