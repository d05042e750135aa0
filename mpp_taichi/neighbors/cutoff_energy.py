"""Cutoff energy: potential energy and virial of the pairs in lists of neighbours, in the widest float of the device."""

import taichi as ti

from mpp_taichi.arithmetic.force_numbers import parameter, wide_number
from mpp_taichi.arithmetic.inverse_distance import inverse_distance
from mpp_taichi.arithmetic.particle_update import wide_position
from mpp_taichi.neighbors.cutoff_loops import CutoffLoops
from mpp_taichi.neighbors.tile_lists import COPY_BITS
from mpp_taichi.types import Template


@ti.data_oriented
class CutoffEnergy:
    """Half of the energy, or of the virial, of each particle with all others, of the forces of some CutoffLoops."""

    def __init__(self, loops: CutoffLoops) -> None:
        """For these forces and lists."""
        self.loops, self.boxes, self.lists = loops, loops.boxes, loops.lists
        self.particle_count, self.dimensions, self.lanes = loops.particle_count, loops.dimensions, loops.lanes

    @ti.kernel
    def measure(self, state: Template, entry: Template, terms: ti.types.ndarray(ndim=1), virial: Template):
        """Set the terms of all particles."""
        for slot in range(self.particle_count):
            i, tile = self.boxes.order[slot], slot // self.lanes
            place = self.loops.place_of(wide_position(state, i), i)
            total = ti.cast(0.0, state.wide)
            for k in range(self.lists.begin[tile], self.lists.end[tile]):
                other = entry[k] >> COPY_BITS
                if other < self.particle_count:
                    shift = [
                        ti.cast(ti.static(self.lists.copy[axis])[entry[k] & ((1 << COPY_BITS) - 1)], state.wide)
                        for axis in ti.static(range(self.dimensions))
                    ]
                    total += self._term(state, i, self.boxes.order[other], place - ti.Vector(shift), virial)
            for other in range(tile * self.lanes, ti.min((tile + 1) * self.lanes, self.particle_count)):
                if other != slot:
                    total += self._term(state, i, self.boxes.order[other], place, virial)
            terms[i] = total

    @ti.func
    def _term(self, state: Template, i, j, place, virial: Template):
        """Half of the energy or of the virial of particle i at a place with particle j."""
        result = ti.cast(0.0, state.wide)
        way = self.loops.place_of(wide_position(state, j), j) - place
        squared = way.dot(way)
        if squared <= self.loops.reach * self.loops.reach:
            if ti.static(virial):
                result = -0.5 * self._pull(state, i, j, squared) * squared
            else:
                result = 0.5 * self.loops.pairs.potential_between(state, i, j, way)
        return result

    @ti.func
    def _pull(self, state: Template, i, j, squared):
        """The factor of d_ij in the force on particle i by particle j."""
        weight = ti.cast(0.0, state.wide)
        for group in ti.static(self.loops.groups):
            inverse = inverse_distance(squared, wide_number(state, parameter(state, group.softening_squared)))
            for member in ti.static(group.members):
                ends = wide_number(state, member.force.response(state, i) * member.force.source(state, j))
                weight += ends * member.force.shape(inverse)
        return wide_number(state, state.mass[i]) * weight
