"""Candidate pairs of a piece of a drift: found on the cell grid, and listed where the list serves several drifts."""

from typing import Any

import taichi as ti

from mpp_taichi.contacts.shared.field_trees import FieldTrees
from mpp_taichi.contacts.sweep.drift_planning import DriftPlanner, Piece
from mpp_taichi.contacts.sweep.played_spheres import PlayedSpheres
from mpp_taichi.contacts.sweep.slots import Slots
from mpp_taichi.neighbors.partner_list import PartnerList
from mpp_taichi.types import Template

# How much wider than the margins of the listed pairs the margins of a piece may be. It is less than SLACK of the planner, by
# which margins are wider than the way of the fastest sphere, so that no sphere leaves them.
WIDER = 1.1


@ti.data_oriented
class Candidates:
    """The pairs that may touch in a piece: their reaches, radius and margin together, overlap.

    The grid is built with a skin, by which it reaches farther than the margins, and its pairs are listed. Both stay good
    until some sphere has moved or sped up so far that its reach leads out of the skin.

    is_listed   whether the pairs of the grid are listed
    partners    the list, or None for a sweep that uses only the grid
    """

    def __init__(self, slots: Slots, played: PlayedSpheres, planner: DriftPlanner, grid: Any, *, lists: bool) -> None:
        """Bind the parts; `lists` allocates the list."""
        self.slots, self.played, self.planner, self.grid = slots, played, planner, grid
        self.particle_count = slots.particle_count
        self.lists, self.is_listed = lists, False
        self.partners = PartnerList(grid) if lists else None
        self._common = 0.0  # margin that all spheres had when the grid was built; 0: their margins were different
        self._skin = 0.0  # with which the grid was built
        self._flown = 0.0  # longest way of a sphere since then
        self.stale = ti.field(ti.i32)
        self._trees = FieldTrees()
        self._trees.place(1, integers=[self.stale])
        self._trees.finish()

    def destroy(self) -> None:
        """Give the memory back."""
        self._trees.destroy()
        if self.partners is not None:
            self.partners.destroy()

    @ti.func
    def visit(self, k, task: Template, first, second):
        """Call task(k, other slot, first, second) for each candidate partner; a kernel is compiled for each `is_listed`."""
        if ti.static(self.is_listed):
            self.partners.visit(k, task, first, second)
        else:
            self.grid.visit(k, task, first, second)

    # Whether the candidates are valid for a piece

    def find(self, piece: Piece) -> None:
        """Make the grid show every pair that may touch in the piece, and the slots hold the spheres."""
        if self._are_known(piece):
            return
        margins = piece.common, piece.time, piece.rounding
        is_good = False
        if self.is_listed or self.slots.holds:
            is_good = self._set_reaches(*margins, self.slots.holds) == 0 and self.is_listed
        self._common = 0.0
        if not is_good:
            skin = piece.skin if self.lists else 0.0
            if self.slots.holds:
                self._remember_spheres()
                self.grid.build(self.slots.position, self.slots.reach, piece.bounds, skin)
                self._sort_slots()
            else:
                self.planner.set_reaches(piece)
                self.grid.build(self.slots.state.position, self.planner.reach, piece.bounds, skin)
                self.slots.take_radii()
                self._set_reaches(*margins, False)
            self.is_listed = skin > 0.0 and self.partners is not None and self.partners.write()
            if piece.is_uniform:
                self._common, self._skin, self._flown = piece.common, skin, 0.0

    def _are_known(self, piece: Piece) -> bool:
        """Whether the listed pairs are good for this piece without a test of any sphere."""
        is_there = self.is_listed and self.slots.holds and piece.is_uniform
        return is_there and piece.common <= WIDER * self._common and self._flown <= self._skin

    def add_way(self, way: float) -> None:
        """Note the longest way of a sphere in a piece after which the spheres stayed in their slots."""
        self._flown += way

    def forget(self) -> None:
        """List the pairs anew before the next drift, since the state was changed from outside.

        The old list may still be good, but sums of a report are taken in its order, and a run that begins here shall give the
        same bits.
        """
        self.is_listed = False

    # Sorting the slots

    @ti.kernel
    def _remember_spheres(self):
        """Keep which sphere is in each slot, before the grid sorts the slots."""
        for k in range(self.particle_count):
            self.played.touched[k] = self.grid.order[k]

    @ti.kernel
    def _sort_slots(self):
        """Move the spheres from their old slots to the places where the grid has sorted them, which are mostly near."""
        for k in range(self.particle_count):
            old = self.grid.order[k]
            self.played.position[k] = self.slots.position[old]
            self.played.velocity[k] = self.slots.velocity[old]
            self.played.clock[k] = self.slots.radius[old]
            self.played.excursion[k] = self.slots.reach[old]
            self.played.stamp[k] = self.played.touched[old]
        for k in range(self.particle_count):
            self.slots.position[k] = self.played.position[k]
            self.slots.velocity[k] = self.played.velocity[k]
            self.slots.radius[k] = self.played.clock[k]
            self.slots.reach[k] = self.played.excursion[k]
            self.grid.order[k] = self.played.stamp[k]

    @ti.kernel
    def _set_reaches(self, common: float, time: float, rounding: float, are_there: Template) -> ti.i32:
        """Set the reaches in the slots, to which the spheres are copied from the state unless they `are_there`.

        Return 1 if some sphere has moved or sped up beyond the margin for which the grid was built, so that the grid must be
        rebuilt.
        """
        self.stale[0] = 0
        if ti.static(not are_there):  # a loop of its own: the shorter a loop, the more spheres the processor fetches at a time
            for k in range(self.particle_count):
                i = self.grid.order[k]
                self.slots.position[k] = self.slots.state.position[i]
                self.slots.velocity[k] = self.slots.state.velocity[i]
        for k in range(self.particle_count):
            x, i = self.slots.position[k], self.grid.order[k]
            reach = self.slots.radius[k] + self.planner.margin(i, self.slots.velocity[k], common, time, rounding)
            self.slots.reach[k] = reach
            skin = self.grid.sorted_reach[k] - reach
            if not (skin > 0.0 and self.slots.bounce.separation(self.grid.sorted_position[k], x).norm_sqr() <= skin * skin):
                self.stale[0] = 1
        return self.stale[0]
