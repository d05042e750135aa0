"""Cutoff sum: pair forces that end at a cutoff, summed over lists of neighbours; O(N)."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.device.fast_taichi.explicit_vectors import explicit_vectors, require_components_apart
from mpp_taichi.device.fast_taichi.serial_loops import on_cpu
from mpp_taichi.neighbors.all_pairs import AllPairs
from mpp_taichi.neighbors.cutoff_energy import CutoffEnergy
from mpp_taichi.neighbors.cutoff_loops import CutoffLoops
from mpp_taichi.neighbors.periodic import nearest_image
from mpp_taichi.neighbors.tile_boxes import TileBoxes
from mpp_taichi.neighbors.tile_lists import TileLists
from mpp_taichi.state.field_group import FieldGroup
from mpp_taichi.types import Template

OTHER_LISTS, MOVED_FROM_LISTS, MOVED_FROM_STATE = 1, 2, 4  # bits of the news about the lists
MARGIN = 0.15  # of the cutoff: how much farther than the cutoff a particle may be that is in a list
DEVICE_LANES = 8  # particles of a tile on a GPU, whose threads read one list
LISTED = "listed_position"
"""The field of the state with the positions for which the lists were made (CutoffSum.work_fields)."""


@ti.data_oriented
class CutoffSum:
    """The accelerations a_i = Σ_forces r_i Σ_j s_j g(1/ρ_ij) d_ij over the pairs nearer than the largest cutoff R.

    The lists hold all pairs nearer than R + m, with the margin m = `MARGIN` · R. They serve until a particle is more than m/2
    from where it was when they were made: until then no pair that is not in the lists can be nearer than R. The lists depend
    on the positions `listed_position` alone, which are a part of the state: a run that goes on from a saved state has the same
    bits as a run that was not interrupted.

    In a box that repeats, d_ij leads to the nearest copy of particle j, which is right while R is at most half a period.
    """

    sets_directly = False
    in_tiles = False
    memory = (LISTED,)

    def __init__(self, pair_forces: Sequence[Any], particle_count: int, dimensions: int, *, reach: float, box: Any) -> None:
        """Allocate; `reach` is the largest cutoff, `box` the enclosure of the scene, or None. Needs a started Taichi."""
        self.on_cpu = on_cpu()
        self.particle_count, self.dimensions = particle_count, dimensions
        self.margin = MARGIN * reach
        self.period = (0.0, 0.0, 0.0) if box is None else box.period
        origin = (0.0, 0.0, 0.0) if box is None else box.origin
        pairs = AllPairs(pair_forces, particle_count, dimensions)
        lanes = pairs.lane_count if self.on_cpu else DEVICE_LANES
        self.boxes = TileBoxes(particle_count, dimensions, lanes, self.period, origin, on_cpu=self.on_cpu)
        self.lists = TileLists(self.boxes, reach + self.margin)
        self.loops_over_lists = CutoffLoops(pairs, self.boxes, self.lists, reach)
        self.energy = CutoffEnergy(self.loops_over_lists)
        self.longest_loop = particle_count + 2 * self.boxes.leaf_count  # of a thread, where all particles are near each other
        self.listed, self.news = ti.Vector.field(dimensions, float), ti.field(ti.i32)
        self._memory = FieldGroup((particle_count, self.listed), (1, self.news))
        self.listed.fill(np.nan)
        self._checked_state: Any = None
        self._finite = True

    def destroy(self) -> None:
        """Free the memory."""
        for part in (self.loops_over_lists, self.lists, self.boxes, self._memory):
            part.destroy()

    def work_fields(self) -> dict[str, tuple[str, int]]:
        """The field that the state keeps for the sum, and saves."""
        return {LISTED: ("vector", self.particle_count)}

    def begin(self, state: Any) -> None:
        """Forget the lists: the next sum makes them anew."""
        getattr(state, LISTED).fill(np.nan)

    def is_symmetric(self, state: Any) -> bool:
        """No: each particle sums over its whole list."""
        return False

    def loops(self, state: Any) -> int:
        """Number of parallel loops of one sum: the look at the positions, the places and the sum."""
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
        if not self._finite:
            state.acceleration.fill(np.nan)
            return
        self.loops_over_lists.fill(state)
        if self.on_cpu:
            with explicit_vectors():
                self.loops_over_lists.add_in_lanes(state, self.lists.entry)
        else:
            self.loops_over_lists.add(state, self.lists.entry)

    def potential_terms(self, state: Any) -> np.ndarray:
        """Half of the potential energy of each particle with all others, (particle_count,); they add up to the whole."""
        return self._terms(state, virial=False)

    def virial_terms(self, state: Any) -> np.ndarray:
        """Half of the virial Σ_j F_ij·(x_i − x_j) of each particle with all others, (particle_count,) [energy]."""
        return self._terms(state, virial=True)

    def _terms(self, state: Any, *, virial: bool) -> np.ndarray:
        """A measurement leaves `listed_position` as it is, so that it does not change the bits of the run."""
        if self._look(state) & MOVED_FROM_LISTS:
            self._list(state.position)
        terms = np.full(self.particle_count, np.nan, np.float32 if state.wide == ti.f32 else np.float64)
        if self._finite:
            self.energy.measure(state, self.lists.entry, terms, virial)
        return terms

    def _list(self, position: Any) -> None:
        """Make the lists for these positions."""
        self._finite = self.boxes.build(position)
        if self._finite:
            self.lists.write()
        self._remember(position)

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

    @ti.kernel
    def _remember(self, position: Template):
        for i in range(self.particle_count):
            self.listed[i] = position[i]
