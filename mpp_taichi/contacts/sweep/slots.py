"""Slots of the cell grid: where the spheres are when a piece of a drift begins."""

from typing import Any

import taichi as ti

from mpp_taichi.contacts.shared.bounce import Bounce
from mpp_taichi.contacts.shared.field_trees import FieldTrees
from mpp_taichi.contacts.sweep.drift_planning import Flight, Motion, Piece
from mpp_taichi.neighbors.cell_grid import CellGrid
from mpp_taichi.neighbors.partner_list import PartnerList
from mpp_taichi.types import Template

WIDER = 1.1  # margins that a piece may ask for than are there; less than SLACK, so that nobody is as fast as they allow for


@ti.data_oriented
class Slots:
    """Positions, velocities, radii and reaches at the start of a piece, by slots: near in memory where they are near in space.

    Where nothing but contacts changes the motion (`ContactSetup.force_free`) spheres stay in their slots from one drift to the
    next, and the state follows when asked to. Else they are taken over from the state before each piece.

    plays_in_turn   islands are played one after the other, by what looks into the grid and needs no list of partners
    keeps_slots     whether a sweep of this kind can leave spheres in their slots
    is_listed       whether the candidate partners of the grid are written down
    in_slots        whether the spheres stay
    """

    plays_in_turn = False
    keeps_slots = True
    is_listed = False
    _holds = False  # whether what is in the slots is where the spheres are
    _leads = False  # and the state is not yet
    _motion: Motion | None = None  # of what is in them
    _common = 0.0  # margin of all spheres when they were sorted, or 0: they had different ones
    _skin = 0.0  # beyond it, up to which the partners were written down
    _flown = 0.0  # since then by no sphere more than this
    # Of the rest of the sweep:
    particle_count: int
    all_pairs: bool
    state: Any
    bounce: Bounce
    flight: Flight
    grid: CellGrid
    partners: PartnerList
    local_position: Any
    local_velocity: Any
    clock: Any
    excursion: Any
    stamp: Any
    touched: Any

    def _place_slots(self, trees: FieldTrees, dimensions: int) -> None:
        """Allocate, as the first of these trees: there a line of memory begins, and in f64 and space a sphere fills one."""
        count = 1 if self.all_pairs else self.particle_count
        self.start_position, self.start_velocity = (ti.Vector.field(dimensions, float) for _ in range(2))
        self.start_radius, self.start_reach = ti.field(float), ti.field(float)
        self.stale = ti.field(ti.i32)
        trees.place(count, self.start_position, self.start_velocity, self.start_radius, self.start_reach)
        trees.place(1, integers=[self.stale])

    # What is in them -----------------------------------------------------------------------------------------------------

    @ti.func
    def index(self, k):
        """Which sphere is in slot k."""
        result = k
        if ti.static(not self.all_pairs):
            result = self.grid.order[k]
        return result

    @ti.func
    def visit(self, k, task: Template, first, second):
        """task(k, other slot, first, second) for each candidate partner; kernels that look are compiled per `is_listed`."""
        if ti.static(self.is_listed):
            self.partners.visit(k, task, first, second)
        else:
            self.grid.visit(k, task, first, second)

    @ti.func
    def radius_of(self, k):
        """Radius of the sphere in slot k; of the following too."""
        return self.bounce.radius[k] if ti.static(self.all_pairs) else self.start_radius[k]

    @ti.func
    def start_of(self, k):
        """Position at the start of the piece."""
        return self.state.position[k] if ti.static(self.all_pairs) else self.start_position[k]

    @ti.func
    def start_velocity_of(self, k):
        """Velocity at the start of the piece."""
        return self.state.velocity[k] if ti.static(self.all_pairs) else self.start_velocity[k]

    # Taking over, and giving back --------------------------------------------------------------------------------------------

    def _look_around(self, piece: Piece) -> None:
        """See to it that the grid shows every pair that may touch in the piece: sort the spheres anew if some went too far."""
        if self._is_known(piece):
            return
        margins = piece.common, piece.time, piece.rounding
        is_good = False
        if self.is_listed or self._holds:
            is_good = self._take_over(*margins, self._holds) == 0 and self.is_listed
        self._common = 0.0
        if not is_good:
            skin = 0.0 if self.plays_in_turn else piece.skin
            if self._holds:
                self._keep_order()
                self.grid.build(self.start_position, self.start_reach, piece.bounds, skin)
                self._follow_order()
            else:
                self.flight.set_reaches(piece)
                self.grid.build(self.state.position, self.flight.reach, piece.bounds, skin)
                self._take_radii()
                self._take_over(*margins, False)
            self.is_listed = skin > 0.0 and self.partners.write()
            if piece.is_uniform:
                self._common, self._skin, self._flown = piece.common, skin, 0.0

    def _is_known(self, piece: Piece) -> bool:
        """Whether the margins and partners that were written down are good for this piece, without a look at any sphere."""
        is_there = self.is_listed and self._holds and piece.is_uniform
        return is_there and piece.common <= WIDER * self._common and self._flown <= self._skin

    def _stay(self, motion: Motion) -> None:
        """The spheres have moved on, in their slots."""
        self._motion = motion
        self._holds = self._leads = True
        self._flown += motion.way

    @ti.kernel
    def _keep_order(self):
        for k in range(self.particle_count):
            self.touched[k] = self.grid.order[k]

    @ti.kernel
    def _follow_order(self):
        """Move on from old slots, most of which lie near the new ones, to those into which the grid has sorted them."""
        for k in range(self.particle_count):
            old = self.grid.order[k]
            self.local_position[k] = self.start_position[old]
            self.local_velocity[k] = self.start_velocity[old]
            self.clock[k] = self.start_radius[old]
            self.excursion[k] = self.start_reach[old]
            self.stamp[k] = self.touched[old]
        for k in range(self.particle_count):
            self.start_position[k] = self.local_position[k]
            self.start_velocity[k] = self.local_velocity[k]
            self.start_radius[k] = self.clock[k]
            self.start_reach[k] = self.excursion[k]
            self.grid.order[k] = self.stamp[k]

    @ti.kernel
    def _take_radii(self):
        """To be called when the grid has sorted the spheres of the state."""
        for k in range(self.particle_count):
            self.start_radius[k] = self.bounce.radius[self.grid.order[k]]

    @ti.kernel
    def _take_over(self, common: float, time: float, rounding: float, is_there: Template) -> ti.i32:
        """Returns whether the grid may miss a pair: whether there is a sphere whose reach now leads out of that then."""
        self.stale[0] = 0
        if ti.static(not is_there):  # by itself: the less there is beside, the more of them are fetched at a time
            for k in range(self.particle_count):
                i = self.grid.order[k]
                self.start_position[k] = self.state.position[i]
                self.start_velocity[k] = self.state.velocity[i]
        for k in range(self.particle_count):
            x, i = self.start_position[k], self.grid.order[k]
            reach = self.start_radius[k] + self.flight.margin(i, self.start_velocity[k], common, time, rounding)
            self.start_reach[k] = reach
            skin = self.grid.sorted_reach[k] - reach
            if not (skin > 0.0 and self.bounce.separation(self.grid.sorted_position[k], x).norm_sqr() <= skin * skin):
                self.stale[0] = 1
        return self.stale[0]

    def forget(self) -> None:
        """The state was set from outside: what is in the slots holds no more.

        Nor do the partners that were written down: a report is summed in their order, though no motion depends on it.
        """
        self.is_listed = self._holds = self._leads = False
        self._motion = None

    def write_back(self) -> None:
        """Bring the state up to date, where positions and velocities were left in their slots."""
        if self._leads:
            self._write_back()
            self._leads = False

    @ti.kernel
    def _write_back(self):
        for k in range(self.particle_count):
            i = self.grid.order[k]
            self.state.position[i] = self.start_position[k]
            self.state.velocity[i] = self.start_velocity[k]
