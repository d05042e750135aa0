"""Samples: members at one step, all together for quantities that are measured in arrays, and one by one for the others."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from mpp_taichi.contacts._report import ContactReport
from mpp_taichi.simulation.simulation import Simulation
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.state.tangent_growth import TangentGrowth
from mpp_taichi.sweep.member import Member


@dataclass(frozen=True, eq=False)
class MemberParticles:
    """The particles of several members, with an entry for each: position, velocity (members, n, 3) and mass (members, n)."""

    position: np.ndarray
    velocity: np.ndarray
    mass: np.ndarray


class MemberMoment:
    """All members at one step; positions and energies are read from the device once, when they are first asked for."""

    def __init__(self, simulation: Simulation, members: Sequence[Member], mass: np.ndarray) -> None:
        """`mass` as the device keeps it, (members, particle_count)."""
        self.simulation, self.members, self.mass = simulation, members, mass
        self.time = simulation.time

    @cached_property
    def vectors(self) -> tuple[np.ndarray, np.ndarray]:
        """Positions and velocities, each (members, particle_count, 3)."""
        position, velocity = (each[:: self.simulation.phase.copies] for each in self.simulation.state.read_replicas())
        return position[: len(self.members)], velocity[: len(self.members)]

    @cached_property
    def potential_energies(self) -> np.ndarray:
        """Potential energy of each member."""
        energies = self.simulation.phase.energy_meter.potential_energies(self.time)
        return energies[:: self.simulation.phase.copies][: len(self.members)]

    @cached_property
    def tangent(self) -> TangentGrowth:
        """The growth of the deviation of each member."""
        return self.simulation.phase.read_tangent().of(slice(len(self.members)))

    @cached_property
    def broken(self) -> np.ndarray:
        """For each member the first particle that is not finite, or −1."""
        with np.errstate(over="ignore", invalid="ignore"):
            if np.isfinite(self.vectors[0].sum() + self.vectors[1].sum()):  # so that none is
                return np.full(len(self.members), -1)
        finite = np.isfinite(self.vectors[0]).all(axis=2) & np.isfinite(self.vectors[1]).all(axis=2)
        return np.where(finite.all(axis=1), -1, np.argmin(finite, axis=1))

    def of(self, who: np.ndarray) -> "MemberSamples":
        """The sample of these members."""
        return MemberSamples(self, who)


class MemberSamples:
    """Some members at one moment, as `Quantity.measure_many` takes them; `one` is the sample of a single member."""

    def __init__(self, moment: MemberMoment, who: np.ndarray) -> None:
        """Nothing is read from the device before a quantity asks for it."""
        self._moment, self._who, self.time = moment, who, moment.time

    @cached_property
    def snapshot(self) -> MemberParticles:
        """The particles."""
        position, velocity = self._moment.vectors
        return MemberParticles(position[self._who], velocity[self._who], self._moment.mass[self._who])

    @cached_property
    def potential_energy(self) -> np.ndarray:
        """The sum over all forces that have a potential, of each member."""
        return self._moment.potential_energies[self._who]

    @cached_property
    def tangent(self) -> TangentGrowth:
        """The growth of the deviation of each of them."""
        return self._moment.tangent.of(self._who)

    def one(self, number: int) -> "ReplicaSample":
        """A single member."""
        return ReplicaSample(self._moment, self._moment.members[number], number)


class ReplicaSample:
    """One replica at one moment, as quantities measure it."""

    phase_number = 0
    phase_energy = None

    def __init__(self, moment: MemberMoment, member: Member, replica: int) -> None:
        """Nothing is read from the device before a quantity asks for it."""
        self._moment, self._member, self._replica = moment, member, replica
        self.time, self.gravity, self.contact_report = moment.time, member.spec.gravity, ContactReport()

    @cached_property
    def snapshot(self) -> Snapshot:
        """The particles, with the masses that the device keeps."""
        position, velocity = (values[self._replica] for values in self._moment.vectors)
        moved = self._member.start.moved(position=position, velocity=velocity, time=self.time, step=0)
        return replace(moved, mass=self._moment.mass[self._replica])

    @cached_property
    def potential_energy(self) -> float:
        """The sum over all forces that have a potential."""
        return float(self._moment.potential_energies[self._replica])

    @cached_property
    def tangent(self) -> TangentGrowth:
        """The growth of the deviation, with one entry."""
        return self._moment.tangent.of(slice(self._replica, self._replica + 1))

    @property
    def pair_virial(self) -> float:
        """Forces in a periodic box are those of a single simulation."""
        raise NotImplementedError("the virial of pairs is measured of members that run alone")

    @property
    def acceleration(self) -> np.ndarray:
        """Accelerations are measured of a single simulation only."""
        raise NotImplementedError("quantities that need accelerations are measured of members that run alone")
