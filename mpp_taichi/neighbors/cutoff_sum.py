"""Cutoff sum: pair forces that end at a cutoff, summed over lists of neighbours; O(N)."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.arithmetic.force_numbers import parameter, wide_number
from mpp_taichi.arithmetic.inverse_distance import inverse_distance, softened_square
from mpp_taichi.arithmetic.particle_update import wide_position
from mpp_taichi.arithmetic.unit_step import unit_step
from mpp_taichi.device.fast_taichi.explicit_vectors import explicit_vectors, require_components_apart
from mpp_taichi.device.fast_taichi.lane_arithmetic import VECTOR_BYTES, inverse_roots, multiply_add
from mpp_taichi.device.heavy_loops import is_heavy, loop_grain
from mpp_taichi.neighbors._pair_groups import grouped
from mpp_taichi.neighbors._sphere_grid import CHUNKS
from mpp_taichi.neighbors.cell_grid import CellGrid
from mpp_taichi.neighbors.device_grid import DeviceGrid
from mpp_taichi.neighbors.device_rows import DeviceRows
from mpp_taichi.neighbors.partner_rows import PartnerRows
from mpp_taichi.neighbors.periodic import nearest_image
from mpp_taichi.state.field_group import FieldGroup, SideBySide
from mpp_taichi.types import Template

OTHER_LISTS, MOVED_FROM_LISTS, MOVED_FROM_STATE = 1, 2, 4  # bits of the news about the lists
MARGIN = 0.12  # of the cutoff: how much farther than the cutoff a pair may be that is in the lists
LISTED = "listed_position"
"""The field of the state with the positions for which the lists were made (CutoffSum.work_fields)."""


@ti.data_oriented
class CutoffSum:
    """The accelerations a_i = Σ_forces r_i Σ_j s_j g(1/ρ_ij) d_ij over the pairs nearer than the largest cutoff R.

    The lists hold all pairs nearer than R + m, with the margin m = `MARGIN` · R. They serve until a particle is more than m/2
    from where it was when they were made: until then no pair that is not in the lists can be nearer than R. The lists depend
    on the positions `listed_position` alone, which are a part of the state: a run that goes on from a saved state has the same
    bits as a run that was not interrupted.

    In a box that repeats, d_ij leads to the nearest copy of particle j, which is right while R + m is at most half a period.
    """

    sets_directly = False
    in_tiles = False
    memory = (LISTED,)

    def __init__(self, pair_forces: Sequence[Any], particle_count: int, dimensions: int, *, reach: float, box: Any) -> None:
        """Allocate; `reach` is the largest cutoff, `box` the enclosure of the scene, or None. Needs a started Taichi."""
        config = ti.lang.impl.current_cfg()
        self.on_cpu = config.arch in (ti.x64, ti.arm64)
        self.particle_count, self.dimensions, self.reach = particle_count, dimensions, reach
        self.members, self.groups = grouped(pair_forces)
        self.period = (0.0, 0.0, 0.0) if box is None else box.period
        room = min((edge / 2.0 - reach for edge in self.period if edge > 0.0), default=math.inf)
        self.margin = max(0.0, min(MARGIN * reach, room))
        origin = (0.0, 0.0, 0.0) if box is None else box.origin
        single = config.default_fp == ti.f32
        self.lanes = VECTOR_BYTES // (4 if single else 8) if self.on_cpu else 1
        grid: Any = CellGrid if self.on_cpu else DeviceGrid
        self.grid = grid(particle_count, dimensions, self.period, origin)
        rows: Any = PartnerRows(self.grid, self.lanes) if self.on_cpu else DeviceRows(self.grid)
        self.rows = rows
        self.longest_loop = particle_count  # of a thread, where all particles are near each other
        self.farthest = (2.0 * reach) ** 2  # at which a formula is evaluated for places of a row without a particle
        self.place = tuple(ti.field(float) for _ in range(dimensions))
        self.source = tuple(ti.field(float) for _ in self.members)
        self.half_reach, self.listed, self.news = ti.field(float), ti.Vector.field(dimensions, float), ti.field(ti.i32)
        self._memory = FieldGroup(
            (particle_count + 1, SideBySide((*self.place, *self.source))),
            (particle_count, self.half_reach, self.listed),
            (1, self.news),
        )
        self.half_reach.fill(reach / 2.0)
        self.listed.fill(np.nan)
        self._checked_state: Any = None

    def destroy(self) -> None:
        """Free the memory."""
        for part in (self.rows, self.grid, self._memory):
            part.destroy()

    def work_fields(self) -> dict[str, tuple[str, int]]:
        """The field that the state keeps for the sum, and saves."""
        return {LISTED: ("vector", self.particle_count)}

    def begin(self, state: Any) -> None:
        """Forget the lists: the next sum makes them anew."""
        getattr(state, LISTED).fill(np.nan)

    def is_symmetric(self, state: Any) -> bool:
        """No: each particle sums over its whole row."""
        return False

    def loops(self, state: Any) -> int:
        """Number of parallel loops of one sum: the check, the places and the rows."""
        return 3

    def add_accelerations(self, state: Any) -> None:
        """Add all accelerations, in launches of its own."""
        if self.on_cpu and state is not self._checked_state:
            require_components_apart(state, ("acceleration",))
            self._checked_state = state
        news = self._look(state)
        if news & MOVED_FROM_STATE:
            self._keep_places(state)
        if news & (MOVED_FROM_STATE | OTHER_LISTS):
            self._list(state.listed_position)
        self._fill(state)
        if self.on_cpu:
            with explicit_vectors():
                self._sum_in_lanes(state, self.rows.partner)
        else:
            self._sum(state, self.rows.partner)

    def potential_terms(self, state: Any) -> np.ndarray:
        """Half of the potential energy of each particle with all others, (particle_count,); they add up to the whole."""
        if self._look(state) & MOVED_FROM_LISTS:
            self._list(state.position)
        terms = np.empty(self.particle_count, np.float32 if state.wide == ti.f32 else np.float64)
        self._energies(state, self.rows.partner, terms)
        return terms

    # Lists

    @ti.kernel
    def _look(self, state: Template) -> ti.i32:
        """Which reasons there are for new lists: OTHER_LISTS, MOVED_FROM_LISTS and MOVED_FROM_STATE."""
        self.news[0] = 0
        for i in range(self.particle_count):
            place, listed, mine = state.position[i], state.listed_position[i], self.listed[i]
            way, own_way = nearest_image(place - listed, self.period), nearest_image(place - mine, self.period)
            limit = ti.cast((self.margin / 2.0) ** 2, float)
            if not (mine == listed).all():
                ti.atomic_or(self.news[0], OTHER_LISTS)
            if not own_way.dot(own_way) <= limit:
                ti.atomic_or(self.news[0], MOVED_FROM_LISTS)
            if not way.dot(way) <= limit:
                ti.atomic_or(self.news[0], MOVED_FROM_STATE)
        return self.news[0]

    @ti.kernel
    def _keep_places(self, state: Template):
        for i in range(self.particle_count):
            state.listed_position[i] = state.position[i]

    def _list(self, position: Any) -> None:
        self.grid.build(position, self.half_reach, skin=self.margin / 2.0)
        self.rows.write()
        self._remember(position)

    @ti.kernel
    def _remember(self, position: Template):
        for i in range(self.particle_count):
            self.listed[i] = position[i]

    @ti.kernel
    def _fill(self, state: Template):
        """Positions and sources by slot; those of the slot that does not exist are 0."""
        for slot in range(self.particle_count):
            i = self.grid.order[slot]
            inside = self.grid._inside(state.position[i])
            for axis in ti.static(range(self.dimensions)):
                ti.static(self.place[axis])[slot] = inside[axis]
            for member in ti.static(self.members):
                ti.static(self.source[member.index])[slot] = member.force.source(state, i)

    # Sums

    @ti.kernel
    def _sum_in_lanes(self, state: Template, partner: Template):
        grain = ti.static(loop_grain())
        for q in range(CHUNKS * grain):
            if is_heavy(q, grain):
                chunk = q // grain
                for slot in range(self.grid.begin_of(chunk), self.grid.begin_of(chunk + 1)):
                    self._sum_row_in_lanes(state, partner, slot)

    @ti.func
    def _sum_row_in_lanes(self, state: Template, partner: Template, slot):
        i = self.grid.order[slot]
        response = [member.force.response(state, i) for member in ti.static(self.members)]
        own = [ti.static(self.place[axis])[slot] for axis in ti.static(range(self.dimensions))]
        total = [ti.Vector.zero(float, self.lanes) for axis in ti.static(range(self.dimensions))]
        for block in range(self.rows.begin[slot] // self.lanes, self.rows.end[slot] // self.lanes):
            j = [partner[block * self.lanes + lane] for lane in ti.static(range(self.lanes))]
            way = [self._ways(j, own, axis) for axis in ti.static(range(self.dimensions))]
            squared = way[0] * way[0]
            for axis in ti.static(range(1, self.dimensions)):
                squared = multiply_add(way[axis], way[axis], squared)
            squared = ti.min(squared, self.farthest)
            weight = ti.Vector.zero(float, self.lanes)
            for group in ti.static(self.groups):
                softened = softened_square(squared, group.softening_squared)
                inverse, _ = inverse_roots(softened, softened, False)
                for member in ti.static(group.members):
                    source = ti.Vector([ti.static(self.source[member.index])[j[lane]] for lane in ti.static(range(self.lanes))])
                    addend = source * self._shapes(member, inverse)
                    if ti.static(len(self.members) > 1):
                        addend = response[member.index] * addend
                    weight = weight + addend
            for axis in ti.static(range(self.dimensions)):
                total[axis] = multiply_add(weight, way[axis], total[axis])
        for axis in ti.static(range(self.dimensions)):
            part = [total[axis][lane] for lane in ti.static(range(self.lanes))]
            for level in ti.static(range(self.lanes.bit_length() - 1)):  # in halves, so that few additions wait for each other
                for lane in ti.static(range(self.lanes >> (level + 1))):
                    part[lane] = part[lane] + part[lane + ti.static(self.lanes >> (level + 1))]
            addend = part[0]
            if ti.static(len(self.members) == 1):
                addend = response[0] * addend
            state.acceleration[i][axis] = state.acceleration[i][axis] + addend

    @ti.func
    def _ways(self, j: Template, own: Template, axis: Template):
        """One component of the ways to the nearest copies of the particles of a vector."""
        result = ti.Vector([ti.static(self.place[axis])[j[lane]] for lane in ti.static(range(self.lanes))]) - own[axis]
        if ti.static(self.period[axis] > 0.0):
            edge, half = ti.static(self.period[axis]), ti.static(self.period[axis] / 2.0)
            result = result + edge * (unit_step(-1.0 * half - result) - unit_step(result - half))
        return result

    @ti.func
    def _shapes(self, member: Template, inverse):
        """Shape of a force for each of a vector of inverse distances."""
        shape = inverse
        if ti.static(member.elementwise):
            shape = member.force.shape(inverse)
        else:
            shape = ti.Vector([member.force.shape(inverse[lane]) for lane in ti.static(range(self.lanes))])
        return shape

    @ti.kernel
    def _sum(self, state: Template, partner: Template):
        """The sum on a GPU, by a thread for each particle."""
        for slot in range(self.particle_count):
            i = self.grid.order[slot]
            own = self._place(slot)
            total = ti.Vector.zero(float, self.dimensions)
            for k in range(self.rows.begin[slot], self.rows.begin[slot + 1]):
                j = partner[k]
                way = nearest_image(self._place(j) - own, self.period)
                weight = 0.0
                for group in ti.static(self.groups):
                    inverse = inverse_distance(way.dot(way), group.softening_squared)
                    for member in ti.static(group.members):
                        source = ti.static(self.source[member.index])[j]
                        weight += member.force.response(state, i) * (source * member.force.shape(inverse))
                total += weight * way
            state.acceleration[i] += total

    @ti.func
    def _place(self, slot):
        return ti.Vector([ti.static(self.place[axis])[slot] for axis in ti.static(range(self.dimensions))])

    # Energy

    @ti.kernel
    def _energies(self, state: Template, partner: Template, terms: ti.types.ndarray(ndim=1)):
        for slot in range(self.particle_count):
            i = self.grid.order[slot]
            energy = ti.cast(0.0, state.wide)
            place = wide_position(state, i)
            for k in range(self.rows.begin[slot], self._end(slot)):
                other = partner[k]
                if other < self.particle_count:
                    j = self.grid.order[other]
                    way = nearest_image(wide_position(state, j) - place, self.period)
                    for group in ti.static(self.groups):
                        softening_squared = wide_number(state, parameter(state, group.softening_squared))
                        inverse = inverse_distance(way.dot(way), softening_squared)
                        for member in ti.static(group.members):
                            energy += 0.5 * member.force.potential(state, i, j, inverse)
            terms[i] = energy

    @ti.func
    def _end(self, slot):
        result = 0
        if ti.static(self.on_cpu):
            result = self.rows.end[slot]
        else:
            result = self.rows.begin[slot + 1]
        return result
