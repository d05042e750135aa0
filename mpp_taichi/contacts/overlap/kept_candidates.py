"""Pairs of spheres that may overlap soon, in a list that serves several steps."""

from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.neighbors.cell_grid import CellGrid
from mpp_taichi.neighbors.partner_list import PartnerList
from mpp_taichi.neighbors.periodic import nearest_image
from mpp_taichi.state.field_group import FieldGroup
from mpp_taichi.types import Template

WIDEST = 0.5  # skin over the median radius: a list of this skin holds three times as many pairs as touch
FIRST = 0.1  # the same for the first list
STEPS = 10  # that a list is meant to serve
FEWEST_STEPS = 3  # that the list with the widest skin has to serve; to write a list that serves fewer takes longer
PAUSE = 100  # steps after which a list is tried again


@ti.data_oriented
class KeptCandidates:
    """The pairs whose distance was at most the sum of their radii and twice the skin when the list was written.

    A pair that is not in the list cannot overlap while each sphere is within the skin of the place that it had then. This is
    tested in each step, for all spheres, so that places may be changed by anything. The skin is chosen so that a list serves
    some STEPS steps, by the number of steps that the list before it has served (docs/decisions/kept_candidates.md).

    place   (n,) places by slot of the grid, inside the box that repeats [length]
    size    (n,) radii by slot [length]
    """

    def __init__(self, grid: CellGrid, position: Any, radius: Any) -> None:
        """Allocate for the spheres of fields of positions and radii."""
        self.grid, self.position, self.radius = grid, position, radius
        self.particle_count = grid.particle_count
        self.partners = PartnerList(grid, later_only=True)
        self.place, self.size = ti.Vector.field(grid.dimensions, float), ti.field(float)
        self._memory = FieldGroup((self.particle_count, (self.place, self.size)))
        middle = float(np.median(radius.to_numpy()[: self.particle_count]))
        self.skin, self.widest = FIRST * middle, WIDEST * middle
        self._is_listed, self._served, self._pause = False, 0, 0

    def destroy(self) -> None:
        """Free the memory."""
        self._memory.destroy()
        self.partners.destroy()

    def find(self) -> bool:
        """Make the list serve the present places, or sort the grid; returns whether there is a list."""
        if self._is_listed and self._gather(self.skin, False) == 0:
            self._served += 1
            return True
        self._choose_skin()
        self.grid.build(self.position, self.radius, skin=self.skin)
        self._is_listed, self._served = False, 1
        if self.skin > 0.0:
            if self.partners.write():
                self._is_listed = self._gather(self.skin, True) == 0
            else:  # no room for so many pairs
                self.widest = self.skin = 0.5 * self.skin
        return self._is_listed

    def _choose_skin(self) -> None:
        """The skin of the next list; 0 where no list would serve long enough."""
        if self._is_listed and self.skin >= self.widest and self._served < FEWEST_STEPS:
            self.skin, self._pause = 0.0, PAUSE
        elif self._is_listed:
            self.skin = min(self.widest, self.skin * STEPS / self._served)
        elif self._pause > 0:
            self._pause -= 1
            if self._pause == 0:
                self.skin = self.widest

    @ti.kernel
    def _gather(self, skin: float, is_new: Template) -> ti.i32:
        """Take the places into the slots; returns 1 where some sphere has left the skin."""
        stale, free = 0, skin - 2.0 * self.grid.levels.slack[0]  # without what rounding of places may hide
        for k in range(self.particle_count):
            i = self.grid.order[k]
            x = self.grid.inside(self.position[i])
            self.place[k] = x
            if ti.static(is_new):
                self.size[k] = self.radius[i]
            way = nearest_image(x - self.grid.sorted_position[k], self.grid.period)
            if not (free > 0.0 and way.norm_sqr() <= free * free):
                ti.atomic_max(stale, 1)
        return stale

    @ti.func
    def are_near(self, slot, other):
        """Whether the spheres of two slots overlap, or are apart by no more than rounding hides."""
        together = self.size[slot] + self.size[other] + self.grid.levels.slack[0]
        return self.grid.square_distance(self.place[slot], self.place[other]) <= together * together
