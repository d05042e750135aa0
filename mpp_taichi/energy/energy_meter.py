"""Energies, powers and momenta: terms on the device in its widest float, sums on the host in float64, in a fixed order."""

from dataclasses import replace
from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.arithmetic.force_numbers import wide_number
from mpp_taichi.arithmetic.particle_update import wide_velocity
from mpp_taichi.device.fast_taichi.serial_loops import on_cpu
from mpp_taichi.energy.mechanics import angular_momentum, kinetic_energies, mean_by_mass, momentum, sums, total
from mpp_taichi.forces._total_force import TotalForce
from mpp_taichi.neighbors.pair_energy import LEAST_COUNT, PairEnergy
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.state.state import State

BLOCK = 32  # particles whose powers one thread sums
HISTORY_STEPS = 256  # most steps of a launch whose powers are kept
HISTORY_ENTRIES = 2**18  # 6 MiB of them


@ti.data_oriented
class EnergyMeter:
    """Potential energy, one term per particle: of the first replica, or of each."""

    def __init__(self, state: State, total_force: TotalForce):
        """Bind the parts."""
        self.state = state
        self.total_force = total_force
        self._rows = PairEnergy(state, total_force.pair_sum.all_pairs) if is_in_rows(state, total_force) else None
        self._in_rows = self._rows is not None

    @ti.kernel
    def _measure(self, time: float, terms: ti.types.ndarray(ndim=1)):
        self.total_force.at_replica(0)
        for i in range(self.state.particle_count):
            if ti.static(self._in_rows):
                terms[i] = self.total_force.potential_energy_without_pairs(self.state, 0, i, time)
            else:
                terms[i] = self.total_force.potential_energy_of(self.state, 0, i, time)

    @ti.kernel
    def _measure_replicas(self, time: float, terms: ti.types.ndarray(ndim=1)):
        for i in range(self.state.total_count):
            replica = i // self.state.particle_count
            self.total_force.at_replica(replica)
            terms[i] = self.total_force.potential_energy_of(self.state, replica * self.state.particle_count, i, time)

    def potential_energies(self, time: float) -> np.ndarray:
        """Potential energy of each replica, (replica_count,)."""
        state = self.state
        if not self.total_force.forces:
            return np.zeros(state.replica_count)
        self.total_force.settle(state, time)
        terms = np.empty(state.total_count, np.float32 if state.wide == ti.f32 else np.float64)
        self._measure_replicas(time, terms)
        rows = terms.astype(np.float64).reshape(state.replica_count, state.particle_count)
        return sums(rows)

    def potential_energy(self, time: float) -> float:
        """Potential energy of all forces that have a potential."""
        if not self.total_force.forces:
            return 0.0
        self.total_force.settle(self.state, time)
        terms = np.empty(self.state.particle_count, np.float32 if self.state.wide == ti.f32 else np.float64)
        self._measure(time, terms)
        if self._rows is not None:
            self._rows.add_to(self.state, terms)
        terms = terms.astype(np.float64)
        if self.total_force.sums_apart:
            terms += self.total_force.pair_potentials(self.state)
        return total(terms)

    def pair_virial(self) -> float:
        """The virial Σ F_ij·(x_i − x_j) of all pairs [energy], where these are summed over lists of neighbours."""
        return total(self.total_force.pair_virial(self.state).astype(np.float64))

    def mechanics(self, snapshot: Snapshot, time: float) -> dict[str, Any]:
        """The conserved quantities of a snapshot of this state, with masses rounded as on the device, where forces use them."""
        kept = replace(snapshot, mass=self.state.as_kept(snapshot.mass))
        return mechanics(kept, self.potential_energy(time))


def is_in_rows(state: State, total_force: TotalForce) -> bool:
    """Whether the energy of pairs is summed in rows of lanes: for many bodies on a CPU, of which none merge."""
    many = total_force.has_pairs and total_force.pair_solver == "direct" and state.particle_count >= LEAST_COUNT
    return bool(many and on_cpu() and state.replica_count == 1 and not total_force.pair_sum.all_pairs.merges)


@ti.data_oriented
class PowerMeter:
    """Power dissipated, power of the driving forces [energy / time] and kinetic energy of the first replica, step by step.

    `in_kernel`: the kernel of a serial launch measures after each step, with one thread for all particles.
    """

    def __init__(self, state: State, total_force: TotalForce, mass: np.ndarray, *, in_kernel: bool):
        """Allocate three numbers for each block of particles and each step of a launch.

        `mass` are the masses of the first replica, for a state without masses: where no force acts, a step needs none.
        """
        self.state = state
        self.total_force = total_force
        self.in_kernel = in_kernel
        self.particle_count = state.particle_count
        if "mass" in state.quantities:
            self.mass = state.mass
        else:
            self.mass = ti.field(state.wide, shape=state.particle_count)
            self.mass.from_numpy(mass.astype(np.float32 if state.wide == ti.f32 else np.float64))
        if total_force.has_changes:
            total_force.changes.bind(state)
        self.block = state.particle_count if in_kernel else BLOCK
        self.block_count = (state.particle_count + self.block - 1) // self.block
        self.longest_launch = max(1, min(HISTORY_STEPS, HISTORY_ENTRIES // self.block_count))
        self.history = ti.Vector.field(3, state.wide, shape=(self.longest_launch, self.block_count))

    def looks_at(self, state: State, total_force: TotalForce) -> bool:
        """Whether this meter measures this state and these forces."""
        return self.state is state and self.total_force is total_force

    @ti.func
    def store(self, s, b, time):
        """After step s of a launch, the sums over block b, one particle after the other."""
        sums = ti.Vector.zero(self.state.wide, 3)
        for i in range(b * self.block, ti.min((b + 1) * self.block, self.particle_count)):
            kinetic = 0.5 * wide_number(self.state, self.mass[i]) * wide_velocity(self.state, i).norm_sqr()
            powers = self.total_force.powers_of(self.state, i, time)
            sums += ti.Vector([powers[0], powers[1], kinetic], self.state.wide)
        if ti.static(self.total_force.has_paths):
            if b == 0:
                sums[1] += self.total_force.paths.power(self.state, self.total_force, self.mass, time)
        if ti.static(self.total_force.has_changes):
            if b == 0:
                sums[1] += self.total_force.changes.power(self.state, self.total_force, time)
        self.history[s, b] = sums

    @ti.kernel
    def keep(self, s: ti.i32, time: float):
        """Measure after step s of a launch."""
        self.total_force.at_replica(0)
        if ti.static(self.total_force.has_changes):
            self.total_force.changes.put(self.state, 0, time)
        for b in range(self.block_count):
            self.store(s, b, time)

    def kept(self, steps: int) -> np.ndarray:
        """The three numbers after each of the `steps` of the last launch, shape (steps, 3), in the frame of the scene."""
        blocks = self.history.to_numpy()[:steps].astype(np.float64)
        found = np.array([[total(column) for column in step.T] for step in blocks])
        if self.state.frame is not None:
            found[:, 2] += self.state.frame.kinetic_energy
        return found


def mechanics(snapshot: Snapshot, potential_energy: float) -> dict[str, Any]:
    """The conserved quantities of a snapshot.

    kinetic_energy ½ Σ m v², potential_energy, total_energy; momentum Σ m v, angular_momentum Σ m x × v (about the origin),
    center_of_mass Σ m x / Σ m, each (3,); momentum_scale Σ m |v| and angular_momentum_scale Σ m |x| |v| to measure errors by.
    Particles whose axes are all fixed do not enter the momenta: they belong to the laboratory.
    """
    kinetic = total(kinetic_energies(snapshot))
    moving = np.where(snapshot.free.any(axis=1), np.abs(snapshot.mass), 0.0)
    speed = np.linalg.norm(snapshot.velocity, axis=1)
    distance = np.linalg.norm(snapshot.position, axis=1)
    return {
        "time": snapshot.time,
        "step": snapshot.step,
        "kinetic_energy": kinetic,
        "potential_energy": potential_energy,
        "total_energy": kinetic + potential_energy,
        "momentum": momentum(snapshot),
        "angular_momentum": angular_momentum(snapshot),
        "center_of_mass": mean_by_mass(snapshot.position, snapshot.mass),
        "momentum_scale": float(moving @ speed),
        "angular_momentum_scale": float(moving @ (distance * speed)),
    }
