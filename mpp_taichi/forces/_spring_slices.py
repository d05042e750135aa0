"""Springs in slices: half-springs in the order in which a vector register sums them, with a particle in each lane."""

from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.device.fast_taichi import spring_lanes
from mpp_taichi.snapshot import Snapshot, Springs
from mpp_taichi.state.half_springs import half_springs
from mpp_taichi.types import Template

FEWEST = 500  # half-springs; with fewer, a step takes less than a microsecond, and its kernel 0.1 s more to compile
MOST_FILLING = 2.5  # entries of all slices for each half-spring; with more, lanes wait for the longest row


def spring_slices(phase: Any) -> "SpringSlices | None":
    """The slices of the springs of a CompiledPhase, where its step can sum slices and is faster with them, or None.

    They serve one system on a CPU with AVX-512, in f32 and f64. There must be no forces between pairs, since vectors then lie
    component by component. The force of the springs must be the only force along them, have no limits and no damping across
    its axis.
    """
    total, start, device = phase.total_force, phase.particles, phase.device
    one_system = phase.replica_count == 1 and not phase.has_tangent and not total.has_pairs
    if not (one_system and phase.integrator.sums_slices and device.on_cpu and spring_lanes.can_sum(device.precision)):
        return None
    return slices_of(start, total.bonds, device.precision)


def slices_of(start: Snapshot, bonds: tuple[Any, ...], precision: str) -> "SpringSlices | None":
    """The slices of some springs with these forces along them, where these are fit for slices, or None."""
    if 2 * len(start.springs) < FEWEST or len(bonds) != 1 or not bonds[0].fits_slices:
        return None
    slices = SpringSlices(start, bonds[0], spring_lanes.lanes(precision))
    return slices if slices.entry_count <= MOST_FILLING * 2 * len(start.springs) else None


@ti.data_oriented
class SpringSlices:
    """The rows of half-springs of as many particles as a vector has lanes, side by side; shorter rows are filled up.

    slice_start         the number of the first line of each slice; line h are the entries h × lanes to h × lanes + lanes − 1
                        of the following fields, an entry for each lane
    slice_neighbor      the particle at the other end; the particle itself where a row is filled up
    slice_stiffness     [force / length], slice_rest_length [length] and slice_damping [mass / time]; 0 where a row is filled up
    slice_pull          the sums: a component of all particles after the other [force]
    """

    def __init__(self, start: Snapshot, bond: Any, lanes: int) -> None:
        """Put the half-springs in order."""
        self.bond, self.lanes, self.particle_count = bond, lanes, start.particle_count
        self.damped = bond.depends_on_velocity
        rows = half_springs(start)
        first, counts = rows["spring_start"][:-1].astype(np.int64), np.diff(rows["spring_start"])
        self.slice_count = -(-start.particle_count // lanes)
        self.padded_count = self.slice_count * lanes
        filled = np.zeros(self.padded_count, np.int64)
        filled[: len(counts)] = counts
        longest = filled.reshape(-1, lanes).max(axis=1)
        self._start = np.concatenate([[0], np.cumsum(longest)]).astype(np.int32)
        self.entry_count = lanes * int(self._start[-1])
        owner = np.repeat(np.arange(start.particle_count), counts)  # of each half-spring, and its number in the row
        place = np.arange(len(owner)) - first[owner]
        self._entry = (self._start[owner // lanes] + place) * lanes + owner % lanes
        inside = np.minimum(np.arange(self.padded_count), start.particle_count - 1).reshape(-1, lanes)
        self._neighbor = np.repeat(inside, longest, axis=0).ravel()
        self._neighbor[self._entry] = rows["spring_neighbor"]
        self._number = rows["spring_number"]

    def work_fields(self, dimensions: int) -> dict[str, tuple[str, int]]:
        """Kind and count of the fields in the state, by name."""
        fields = {"slice_start": ("index", self.slice_count + 1), "slice_neighbor": ("index", self.entry_count)}
        numbers = ("slice_stiffness", "slice_rest_length", *(("slice_damping",) if self.damped else ()))
        fields |= {name: ("scalar", self.entry_count) for name in numbers}
        return fields | {"slice_pull": ("scalar", dimensions * self.padded_count)}

    def fill(self, state: Any) -> None:
        """Fill the fields that stay the same in the whole run; TypeError where the vectors do not lie particle by particle."""
        parents = [state.position.get_scalar_field(axis).parent() for axis in range(2)]
        if parents[0] != parents[1]:
            raise TypeError("springs in slices need positions and velocities that lie particle by particle")
        state.slice_start.from_numpy(self._start)
        state.slice_neighbor.from_numpy(self._neighbor.astype(np.int32))

    def place(self, state: Any, springs: Springs) -> None:
        """Give the slices the numbers of the springs."""
        for name in ("stiffness", "rest_length", *(("damping",) if self.damped else ())):
            field = getattr(state, f"slice_{name}")
            values = np.zeros(self.entry_count, np.float32 if field.dtype == ti.f32 else np.float64)
            values[self._entry] = getattr(springs, name)[self._number]
            field.from_numpy(values)

    @ti.func
    def add_up(self, state: Template, velocity: Template, elastic: Template, friction: Template):
        """Sum the elastic forces, the friction or both of all half-springs, with the velocities of a field."""
        for number in range(self.slice_count):
            spring_lanes.sum_slice(elastic, friction, state, velocity, self.particle_count, number)

    @ti.func
    def pull(self, state: Template, i):
        """The sum of particle i."""
        return ti.Vector([state.slice_pull[axis * self.padded_count + i] for axis in ti.static(range(state.dimensions))])
