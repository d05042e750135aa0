"""TotalForce: the sum of the forces of a scene, and the only owner of the loops over particles and springs."""

import copy
from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.arithmetic.force_numbers import along_free_axes, is_not_zero, where, wide_number, zero_vector
from mpp_taichi.arithmetic.inverse_distance import (
    change_of_inverse_distance,
    inverse_root,
    second_change_of_inverse_distance,
)
from mpp_taichi.arithmetic.particle_update import velocity_seen, wide_velocity
from mpp_taichi.arithmetic.traced import traced
from mpp_taichi.device.fast_taichi.vector_fields import put_vector
from mpp_taichi.forces._base import BondForce, ExternalForce, Force, PairForce
from mpp_taichi.forces._between import parts_of
from mpp_taichi.forces._row_sum import row_sum
from mpp_taichi.snapshot import Springs
from mpp_taichi.state.half_springs import own_entry
from mpp_taichi.types import Template


@ti.data_oriented
class TotalForce:
    """The sum of the forces of a scene, as accelerations.

    `shape` says how the loop over pairs runs: "serial" inside a serial loop, "parallel" at the top of a kernel. All other
    loops are parallel at the top of a kernel and serial inside another loop. Loops over kinds of force that the scene lacks
    are not compiled.
    """

    def __init__(
        self,
        forces: tuple[Force, ...],
        particle_count: int,
        dimensions: int,
        *,
        merges: bool = False,
        derivatives: int = 0,
        two_parts: bool = False,
        rods: Any = None,
        given: tuple[Any, Any] = (None, None),
        fewer: Any = None,
        limits: Any = None,
    ):
        """Sort the forces by the loop that they need; `merges` says whether bodies may merge.

        `derivatives` says which derivatives of the acceleration are summed too: the jerk (1), or the jerk and the snap (2).
        `two_parts` says that sums are double-single numbers. `rods` are the constraints of rigid rods (RodProjection), whose
        forces are no part of the sum: the methods that keep the lengths of rods apply them. `given` are the functions of the
        time: bodies on paths (DrivenBodies), and masses and charges that change (ChangingNumbers). `fewer` says by which sum
        over fewer than all pairs they are summed (_fewer_pairs.py). `limits` breaks and stretches springs (SpringLimits).
        """
        self.derivatives, self.rods, self.has_rods = derivatives, rods, rods is not None
        self.given, (self.paths, self.changes) = given, given
        self.has_paths, self.has_changes = self.paths is not None, self.changes is not None
        self.has_given = self.has_paths or self.has_changes
        self.limits, self.has_limits = limits, limits is not None
        self.forces, self.two_parts = forces, two_parts
        self.live: Any = None  # LiveParameters of the forces, where replicas have values of their own
        self.particle_count = particle_count
        self.dimensions = dimensions
        pairs = tuple(part for force in forces if isinstance(force, PairForce) for part in parts_of(force))
        self.external = tuple(part for force in forces if isinstance(force, ExternalForce) for part in force.parts())
        self.looks = (*((limits,) if self.has_limits else ()), *(force for force in self.external if force.gathers))
        self.bonds = tuple(force for force in forces if isinstance(force, BondForce))
        self.has_pairs = len(pairs) > 0 and particle_count > 1
        self.pair_forces = pairs
        self.pair_solver, self.pair_sum = "", None  # the solver's name, and the solver, which owns the loops over pairs
        if self.has_pairs:
            from mpp_taichi.forces._pair_solver import pair_solver  # only for scenes that have pairs

            self.pair_solver, self.pair_sum = pair_solver(
                pairs, particle_count, dimensions, merges=merges, derivatives=derivatives, two_parts=two_parts, fewer=fewer
            )
        self.by_tree, self.by_lists = self.pair_solver == "tree", self.pair_solver == "lists"
        self.sums_apart = self.by_tree or self.by_lists  # pairs in launches of their own, by all threads together
        others = [force for force in (*self.external, *self.bonds) if not force.depends_on_velocity]
        self.has_pairs_alone = self.has_pairs and not others
        self.sets_pairs = self.has_pairs_alone and self.pair_sum.sets_directly
        self.pairs_in_tiles = self.has_pairs_alone and self.pair_sum.in_tiles
        self.depends_on_velocity = any(force.depends_on_velocity for force in forces)
        self.mixes_velocities = any(force.mixes_velocities for force in forces)
        self.has_velocity_independent = len(pairs) > 0 or len(others) > 0
        self.slices: Any = None  # SpringSlices, where the springs are summed for all particles at once

    @property
    def has_slices(self) -> bool:
        """Whether springs are summed in slices."""
        return self.slices is not None

    @property
    def sums_ahead(self) -> bool:
        """Whether undamped slices are the only forces, so that a loop may kick and drift: others may read other places."""
        return self.has_slices and not self.depends_on_velocity and not self.external

    def slice_loops(self, velocity_dependent: bool) -> int:
        """Parallel loops over slices before a loop over the forces that do, or do not, depend on velocity."""
        return int(self.slices is not None and self.slices.damped == velocity_dependent)

    def with_pairs_in_turn(self) -> "TotalForce":
        """The same sum for a state of dual numbers or lanes, which takes one pair after the other."""
        result = copy.copy(self)
        result.slices = None
        if self.has_pairs:
            from mpp_taichi.neighbors.pairs_in_turn import PairsInTurn  # only where a state has such numbers

            result.pair_sum = PairsInTurn(self.pair_sum)
            result.sets_pairs = result.pairs_in_tiles = False
        return result

    @traced
    def at_replica(self, replica, lanes=1):
        """Say in a kernel over replicas for which of them the forces are evaluated from here on: one, or as many as `lanes`."""
        if self.live is not None:
            self.live.at_replica(replica, lanes)

    def pair_loops(self, state: Any) -> int:
        """Number of parallel loops over pairs in one sum on the cores of a CPU."""
        return self.pair_sum.loops(state) if self.has_pairs else 1

    def is_symmetric_alone(self, state: Any) -> bool:
        """Whether a launched sum of symmetric pairs is the whole force, so that it may overwrite the accelerations."""
        return self.has_pairs_alone and bool(self.pair_sum.is_symmetric(state))

    def work_fields(self) -> dict[str, tuple[str, int]]:
        """The fields that the sum needs in the state: kind and count by name."""
        owners = (self.rods, self.pair_sum if self.by_lists else None, self.limits, *self.external)
        found = {name: field for each in owners if each is not None for name, field in each.work_fields().items()}
        found |= {"kick_slope": ("vector", self.particle_count)} if self.mixes_velocities else {}
        return found | (self.slices.work_fields(self.dimensions) if self.has_slices else {})

    @property
    def memory(self) -> tuple[str, ...]:
        """The fields of `work_fields` that a saved state has."""
        parts = (self.pair_sum if self.by_lists else None, self.limits, self.rods)
        return tuple(name for part in parts if part is not None for name in part.memory)

    def begin(self, state: Any) -> None:
        """Forget what earlier sums have left."""
        if self.by_lists:
            self.pair_sum.begin(state)

    def fill(self, state: Any) -> None:
        """Fill the fields that stay the same in the whole run: of rods and of slices."""
        if self.rods is not None:
            self.rods.fill(state)
        if self.slices is not None:
            self.slices.fill(state)

    def place_springs(self, state: Any, springs: Springs) -> None:
        """Give springs with limits the lengths that they have at a start, and slices the numbers of the springs."""
        if self.has_limits:
            self.limits.place(state, springs)
        self.place_slices(state, springs)

    def place_slices(self, state: Any, springs: Springs) -> None:
        """Give slices the numbers of the springs, where there are slices."""
        if self.slices is not None:
            self.slices.place(state, springs)

    def settle(self, state: Any, time: float) -> None:
        """Put the masses and charges of a time, where they change, before something is measured or a step is prepared."""
        if self.has_changes:
            self.changes.settle(state, time)

    def destroy(self) -> None:
        """Free the memory of the sums."""
        if self.has_pairs:
            self.pair_sum.destroy()

    @property
    def longest_loop(self) -> int:
        """Most iterations that a thread makes for one particle of the parallel plan."""
        return self.pair_sum.longest_loop if self.has_pairs else 0

    @property
    def conserves_energy(self) -> bool:
        """Whether every force has a potential, so that energy is conserved; not where springs break or agents act."""
        return not (self.has_limits or self.has_given) and all(force.conserves_energy for force in self.forces)

    @property
    def gains_no_energy(self) -> bool:
        """Whether every force has a potential or brakes, so that energy must not grow.

        Drag and friction brake; tides, formulas of the velocity and forces without a potential may give energy.
        """
        brakes = (force.conserves_energy or (force.depends_on_velocity and not force.may_give_energy) for force in self.forces)
        return not self.has_given and all(brakes)

    @property
    def needs(self) -> frozenset:
        """Union of the needs of all forces."""
        return frozenset().union(
            *(each.needs for each in (*self.forces, self.rods, self.limits, self.changes) if each is not None)
        )

    def pair_potentials(self, state: Any) -> np.ndarray:
        """Shares of the particles of the first replica in the potential energy of pairs that are summed in launches apart."""
        return self.pair_sum.potential_terms(state)

    def pair_virial(self, state: Any) -> np.ndarray:
        """Shares of the particles in the virial of the pairs, where these are summed `by_lists`."""
        return self.pair_sum.virial_terms(state)

    @ti.func
    def sum_slices(self, state: Template, velocity: Template, velocity_dependent: Template, elastic: Template = True):
        """Where there are slices: sum the springs of all particles, for the loop over particles that follows.

        That loop passes `sliced` to `local_acceleration` with the same `velocity_dependent`, or to `acceleration_gained` where
        the sums have no `elastic` forces.
        """
        if ti.static(self.slice_loops(velocity_dependent) > 0):
            self.slices.add_up(state, velocity, elastic, velocity_dependent)

    @ti.func
    def local_acceleration(self, state: Template, first, i, time, velocity_dependent: Template, sliced: Template = False):
        """Acceleration of particle i from the external forces and springs that do (or do not) depend on velocity.

        `first` is the first particle of the replica, from which the springs count their particles. `sliced` says that
        `sum_slices` has been called, so that springs in slices are not summed again.
        """
        result = zero_vector(state)
        for force in ti.static(self.external):
            if ti.static(force.depends_on_velocity == velocity_dependent):
                result += force.accelerate(state, i, velocity_seen(state, i), time)
        for bond in ti.static(self.bonds):
            if ti.static(bond.depends_on_velocity == velocity_dependent):
                if ti.static(sliced and self.has_slices):
                    result += self.slices.pull(state, i) * (1.0 / state.mass[i])
                else:
                    result += row_sum(state, first, i, bond, False) * (1.0 / state.mass[i])
        if ti.static(state.has_fixed_axes):
            result = along_free_axes(state, i, result)  # a product would give NaN for F/0 of a fixed particle
        return result

    @ti.func
    def acceleration_gained(self, state: Template, slopes: Template, h, first, i, time, sliced: Template = False):
        """Change of the acceleration of particle i when all velocities change by h times the velocities of the state `slopes`.

        Of springs only the friction changes, which is linear in velocity and needs neither stiffness nor length.
        """
        result = zero_vector(state)
        for force in ti.static(self.external):
            if ti.static(force.depends_on_velocity):
                result += force.acceleration_gained(state, slopes, h, i, time)
        for bond in ti.static(self.bonds):
            if ti.static(bond.depends_on_velocity):
                if ti.static(sliced and self.has_slices):
                    result += self.slices.pull(state, i) * (h / state.mass[i])
                else:
                    result += row_sum(slopes, first, i, bond, True) * (h / state.mass[i])
        if ti.static(state.has_fixed_axes):
            result = along_free_axes(state, i, result)
        return result

    @ti.func
    def accumulate(self, state: Template, first, time, shape: Template):
        """state.acceleration = the sum of all forces that do not depend on velocity."""
        if ti.static(shape == "serial" and self.sets_pairs):
            self.pair_sum.set_serial(state, first)
        else:
            self.begin_sum(state, first, time)
            if ti.static(self.has_pairs and shape == "serial"):
                self.pair_sum.accumulate_serial(state, first)
            if ti.static(self.has_pairs and shape != "serial"):
                self.pair_sum.accumulate_parallel_gather(state)
        if ti.static(self.has_pairs):
            self.end_sum(state, first)

    @ti.func
    def look(self, state: Template, first, time):
        """Before a sum: break springs, and sum up the numbers of all particles that forces read."""
        for part in ti.static(self.looks):
            part.meet(state, first, time)

    @ti.func
    def begin_sum(self, state: Template, first, time):
        """state.acceleration = external forces and springs."""
        self.look(state, first, time)
        self.sum_slices(state, state.velocity, False)
        for i in range(first, first + self.particle_count):
            if ti.static(self.has_pairs_alone):
                put_vector(state.acceleration, i, zero_vector(state))
            else:
                state.acceleration[i] = self.local_acceleration(state, first, i, time, False, True)
            if ti.static(self.derivatives > 0):
                jerk, snap = self.local_derivatives(state, first, i, time)
                state.jerk[i] = jerk
                if ti.static(self.derivatives > 1):
                    state.snap[i] = snap

    @ti.func
    def end_sum(self, state: Template, first):
        """Remove the pair forces along the axes that are fixed."""
        if ti.static(state.has_fixed_axes):
            for i in range(first, first + self.particle_count):
                for k in ti.static(range(self.dimensions)):
                    state.acceleration[i][k] = where(is_not_zero(state.free[i][k]), state.acceleration[i][k], 0.0)
                if ti.static(self.derivatives > 0):
                    state.jerk[i] = ti.select(state.free[i] != 0.0, state.jerk[i], 0.0)
                if ti.static(self.derivatives > 1):
                    state.snap[i] = ti.select(state.free[i] != 0.0, state.snap[i], 0.0)

    @ti.func
    def local_derivatives(self, state: Template, first, i, time):
        """Jerk and snap of particle i from external forces and springs, none of which depends on velocity."""
        jerk = ti.Vector.zero(float, state.dimensions)
        snap = ti.Vector.zero(float, state.dimensions)
        for force in ti.static(self.external):
            first_derivative, second_derivative = force.derivatives(state, i, time)
            jerk += first_derivative
            snap += second_derivative
        for bond in ti.static(self.bonds):
            for h in range(state.spring_start[i - first], state.spring_start[i - first + 1]):
                j, own = first + state.spring_neighbor[h], own_entry(state, first, h)
                pull, second_pull = self.half_spring_derivatives(state, i, j, own, bond)
                jerk += pull / state.mass[i]
                snap += second_pull / state.mass[i]
        if ti.static(state.has_fixed_axes):
            jerk = ti.select(state.free[i] != 0.0, jerk, 0.0)
            snap = ti.select(state.free[i] != 0.0, snap, 0.0)
        return jerk, snap

    @ti.func
    def half_spring_derivatives(self, state: Template, i, j, h, bond: Template):
        """First and second derivative in time of the force of half-spring h on particle i; 0 where both ends coincide."""
        d = state.position[j] - state.position[i]
        w = state.velocity[j] - state.velocity[i]
        q = ti.Vector.zero(float, state.dimensions)
        if ti.static(self.derivatives > 1):
            q = state.estimate[j] - state.estimate[i]
        squared, approach = d.dot(d), d.dot(w)
        inverse = ti.select(squared > 0.0, inverse_root(squared), 0.0)
        shape = bond.within(state, i, j, bond.shape(state, h, inverse))
        slope = bond.within(state, i, j, bond.slope(state, h, inverse))
        rate = slope * change_of_inverse_distance(inverse, approach)
        curve = slope * second_change_of_inverse_distance(inverse, approach, w.dot(w) + d.dot(q))
        if ti.static(bond.has_curvature):
            change = change_of_inverse_distance(inverse, approach)
            curve += bond.within(state, i, j, bond.curvature(state, h, inverse)) * change * change
        return shape * w + rate * d, shape * q + 2.0 * rate * w + curve * d

    @ti.func
    def powers_of(self, state: Template, i, time):
        """Shares of particle i in the power dissipated and in the power of the driving forces, [energy / time], in f64.

        A force without a potential dissipates where it depends on velocity, and drives where it does not. The power of a damped
        spring is split evenly between its ends, so that the common motion of both ends does not enter.
        """
        dissipated, driving = ti.cast(0.0, state.wide), ti.cast(0.0, state.wide)
        for force in ti.static(self.external):
            if ti.static(not force.conserves_energy):
                # A particle without mass is fixed here, and no force does work on it.
                if state.mass[i] > 0.0:
                    acceleration = force.accelerate(state, i, velocity_seen(state, i), time)
                    power = ti.cast(0.0, state.wide)
                    velocity = wide_velocity(state, i)
                    for k in ti.static(range(state.dimensions)):
                        power += wide_number(state, acceleration[k]) * velocity[k]
                    power *= wide_number(state, state.mass[i])
                    if ti.static(force.depends_on_velocity):
                        dissipated -= power
                    else:
                        driving += power
        for bond in ti.static(self.bonds):
            if ti.static(not bond.conserves_energy):
                for h in range(state.spring_start[i], state.spring_start[i + 1]):
                    dissipated += 0.5 * bond.dissipation(state, i, state.spring_neighbor[h], h)
        return ti.Vector([dissipated, driving], state.wide)

    @ti.func
    def potential_energy_of(self, state: Template, first, i, time):
        """Share of particle i in the potential energy, in f64: a pair's or a spring's energy is split evenly between its ends.

        Without pairs that are summed in launches apart, whose energies `pair_potentials` computes for all particles at once.
        """
        result = self.potential_energy_without_pairs(state, first, i, time)
        if ti.static(self.has_pairs and not self.sums_apart):
            result += self.pair_sum.potential_energy_of(state, i)
        return result

    @ti.func
    def potential_energy_without_pairs(self, state: Template, first, i, time):
        """Share of particle i in the potential energy of external forces and bonds."""
        result = ti.cast(0.0, state.wide)
        for force in ti.static(self.external):
            result += force.potential(state, i, time)
        for bond in ti.static(self.bonds):
            for h in range(state.spring_start[i - first], state.spring_start[i - first + 1]):
                result += 0.5 * bond.potential(state, i, first + state.spring_neighbor[h], own_entry(state, first, h))
        return result
