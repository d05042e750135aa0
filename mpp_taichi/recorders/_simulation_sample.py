"""Simulation sample: a simulation at one moment, as quantities measure it."""

from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from mpp_taichi.snapshot import Snapshot
from mpp_taichi.state.tangent_growth import TangentGrowth

if TYPE_CHECKING:
    from mpp_taichi.simulation.simulation import Simulation


class SimulationSample:
    """A simulation at one moment. Entries that are expensive are computed when they are first read."""

    def __init__(self, simulation: "Simulation") -> None:
        """Read it before the simulation goes on."""
        self._simulation = simulation
        self.time, self.phase_number, self.phase_energy = simulation.time, simulation.phase_number, simulation.phase_energy
        self.contact_report, self.gravity = simulation.contact_report, simulation.spec.gravity

    @cached_property
    def snapshot(self) -> Snapshot:
        """The particles, with the masses that the device keeps, which the forces use."""
        snapshot = self._simulation.snapshot()
        return replace(snapshot, mass=self._simulation.state.as_kept(snapshot.mass))

    @cached_property
    def potential_energy(self) -> float:
        """The sum over all forces that have a potential."""
        if "mechanics" in vars(self):
            return self.mechanics["potential_energy"]
        return self._simulation.phase.energy_meter.potential_energy(self.time)

    @cached_property
    def pair_virial(self) -> float:
        """The virial of the pair forces of a periodic box [energy]."""
        return self._simulation.phase.energy_meter.pair_virial()

    @cached_property
    def acceleration(self) -> np.ndarray:
        """Accelerations of the particles by the forces, without rods and contacts, (particle_count, 3)."""
        found: np.ndarray = self._simulation.accelerations(self.snapshot)
        return found

    @cached_property
    def tangent(self) -> TangentGrowth:
        """The growth of a small deviation, with one entry."""
        return self._simulation.phase.read_tangent()

    @cached_property
    def mechanics(self) -> dict[str, Any]:
        """Energies, momenta and centre of mass together, as `Simulation.diagnostics` gives them."""
        return self._simulation.diagnostics()
