"""Observer: energies, momenta and positions of a run at its samples, and the particles that are left at its end."""

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from mpp_taichi.accuracy.force_solvers import with_force_solver
from mpp_taichi.accuracy.problem import Problem
from mpp_taichi.simulation.simulation import Simulation

if TYPE_CHECKING:
    from mpp_taichi.energy.energy_meter import EnergyMeter


class Observer:
    """Takes samples of one simulation, in whatever phase it is."""

    def __init__(self, simulation: Simulation) -> None:
        """Begin without a meter."""
        self.simulation = simulation
        self._meters: dict[object, Any] = {}

    def look(self, problem: Problem, time: float, step: int) -> tuple[dict, np.ndarray, np.ndarray]:
        """Energies and momenta of the present state, the positions [length] and the velocities [length / time]."""
        position, velocity = self.simulation.state.read()
        particles = problem.phases[self.simulation.phase_number].particles
        there = particles.moved(position=position, velocity=velocity, time=time, step=step)
        if self.simulation.state.merges:
            there = replace(there, **self.simulation.state.read_spheres(particles))
        with np.errstate(over="ignore", invalid="ignore"):
            return self._energy_meter(problem).mechanics(there, time), position, velocity

    def end(self, problem: Problem, position: np.ndarray) -> np.ndarray:
        """Positions at the end [length]; a sphere that is a part of sphere k has the entries nan, k, nan."""
        state = self.simulation.state
        if not state.merges:
            return position
        into, end = state.read_spheres(problem.start)["merged_into"], position.copy()
        for number in np.flatnonzero(into >= 0):
            last = into[number]
            while into[last] >= 0:
                last = into[last]
            end[number] = np.nan, last, np.nan
        return end

    def kept(self) -> frozenset[str]:
        """The quantities that the present phase keeps."""
        phase = self.simulation.phase
        kept = {
            "energy": phase.conserves_energy,
            "momentum": phase.conserves_momentum,
            "angular_momentum": phase.conserves_angular_momentum,
        }
        return frozenset(name for name, stays in kept.items() if stays)

    # Internals

    def _energy_meter(self, problem: Problem) -> "EnergyMeter":
        """The meter of the present phase; with a tree a meter by direct sums, in which the errors of the tree show."""
        simulation = self.simulation
        if not simulation.total_force.by_tree:
            return simulation.phase.energy_meter
        from mpp_taichi.energy.energy_meter import EnergyMeter
        from mpp_taichi.forces._composition import compose
        from mpp_taichi.forces._total_force import TotalForce

        phase = problem.phases[simulation.phase_number]
        if phase.kernels not in self._meters:
            spec, start = with_force_solver(phase.spec, None), phase.particles
            forces = TotalForce(compose(spec, start), start.particle_count, spec.dimensions)
            self._meters[phase.kernels] = EnergyMeter(simulation.state, forces)
        return self._meters[phase.kernels]
