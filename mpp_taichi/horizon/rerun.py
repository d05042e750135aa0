"""Rerun: the scene run once more from its start with coarser or finer steps, before the run itself begins.

A rerun uses the kernels of the run: the step, and the tolerance of a method that chooses its steps, are their arguments.
Where spheres touch, a rerun may also begin at a start that is shifted by one rounding.
"""

from collections.abc import Generator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from mpp_taichi.horizon.cause import ROUND_OFF, SINGLE

if TYPE_CHECKING:
    from mpp_taichi.simulation.simulation import Simulation

TOLERANCE_FACTOR = 4.0  # of a method that chooses its steps
HAIR = 1e-6  # of a step: a rest that is rounding of the time
MOST_FOLLOWED = 1000  # particles whose positions are compared
MOST_SPHERES = 100_000  # the same where spheres touch: the sphere with the most collisions loses its place first
SEED = 20261123


class Rerun:
    """Follows the scene from its start; `coarseness` is 1 for the steps of the run, 2 for coarser and 1/2 for finer steps.

    `shift` moves the start by so many roundings of the largest coordinate, in a direction that is the same in every rerun.
    """

    def __init__(self, simulation: "Simulation", coarseness: float, shift: float = 0.0) -> None:
        """Bind the parts; nothing moves yet."""
        self._simulation, self._coarseness, self._shift = simulation, coarseness, shift
        self._own_dt, self._first = simulation.dt, simulation.phase_number
        self.evaluations = 0  # of a method that chooses its steps
        self.meetings = 0  # of a sphere with another or with a wall; two for the contact of two spheres
        most = MOST_FOLLOWED if simulation.contacts is None else MOST_SPHERES
        moving = np.flatnonzero(simulation.start.free.any(axis=1))
        self._followed = moving[:: max(1, -(-len(moving) // most))]

    def positions(self, times: Sequence[float]) -> Generator[np.ndarray]:
        """Positions of the followed particles at each time, (followed, 3) [length]; it ends where the run cannot go on."""
        simulation = self._simulation
        own: dict[Any, float] = {}
        try:
            self._set_step(own)
            simulation.restart()  # takes the start for steps of this length
            self._move_start()
            for time in times:
                if not self._advance_to(time, own):
                    return
                place = self._places()
                if not np.isfinite(place).all():
                    return
                yield place
        finally:
            for integrator, tolerance in own.items():
                setattr(integrator, integrator.controlled_by, tolerance)
            self.evaluations = self._count()
            self._count_contacts()
            simulation.launcher.clear_trouble()
            if simulation.phase_number != self._first:
                simulation.restart()
            simulation.dt = self._own_dt
            simulation.restart()

    def _move_start(self) -> None:
        """Shift the start, at random and along the axes on which a particle is free."""
        if not self._shift:
            return
        simulation, start = self._simulation, self._simulation.start
        rounding = ROUND_OFF.get(simulation.device.precision, SINGLE) * float(np.abs(start.position).max())
        shift = rounding * self._shift * np.random.default_rng(SEED).uniform(-1.0, 1.0, start.position.shape) * start.free
        shift[:, simulation.spec.dimensions :] = 0.0
        simulation.state.write(start.position + shift, start.velocity * start.moving)

    def _places(self) -> np.ndarray:
        """Positions of the followed particles; of a sphere that has become a part of another, the position of the latter."""
        state = self._simulation.state
        place: np.ndarray = state.read()[0]
        if state.merges:
            from mpp_taichi.device import bulk_copy  # it imports Taichi

            into = bulk_copy.read([state.merged_into], np.int32)[0].ravel()
            whole = np.where(into < 0, np.arange(len(into)), into)
            while (whole[whole] != whole).any():
                whole = whole[whole]
            place = place[whole]
        return place[self._followed]

    def _count_contacts(self) -> None:
        """Take the contacts of the present phase out of the counts of its solver, which belong to the run."""
        contacts = self._simulation.contacts
        if contacts is None:
            return
        found = contacts.collect()
        self.meetings += 2 * found.pair_count + found.wall_count
        if contacts.logs:
            contacts.take_log()

    def _set_step(self, own: dict[Any, float]) -> None:
        """Give the present phase the step, or the tolerance, of this rerun."""
        simulation = self._simulation
        integrator = simulation.integrator
        if integrator.controlled_by:
            if integrator not in own:
                own[integrator] = getattr(integrator, integrator.controlled_by)
            factor = TOLERANCE_FACTOR if self._coarseness > 1.0 else 1.0 / TOLERANCE_FACTOR if self._coarseness < 1.0 else 1.0
            setattr(integrator, integrator.controlled_by, own[integrator] * factor)
        else:
            dt = self._own_dt if simulation.phase_number == self._first else simulation.phases[simulation.phase_number].dt
            simulation.dt = dt * self._coarseness

    def _advance_to(self, time: float, own: dict[Any, float]) -> bool:
        """Go on to a time, through the phases before it; False where the state is not sound."""
        simulation = self._simulation
        while simulation.time_to_next_phase <= time - simulation.time + HAIR * simulation.dt:
            if not self._advance_by(simulation.time_to_next_phase):
                return False
            self._count_contacts()
            simulation.begin_phase(simulation.phase_number + 1)
            self._set_step(own)
        return self._advance_by(time - simulation.time)

    def _advance_by(self, span: float) -> bool:
        simulation = self._simulation
        if span <= HAIR * simulation.dt:
            return True
        if simulation.integrator.controlled_by or not simulation.launcher.takes_steps:  # it takes its own way to the time
            return simulation.try_steps(1, span)
        whole = int(span / simulation.dt + HAIR)
        rest = span - whole * simulation.dt
        judged = "linear_solver" in simulation.launcher.facts()  # other steps fail only by numbers that are not finite
        sound = simulation.try_steps(whole, judged=judged) if whole else True
        return simulation.try_steps(1, rest, judged=judged) if sound and rest > HAIR * simulation.dt else sound

    def _count(self) -> int:
        """Evaluations of the force since the start of the phase, of a method that chooses its steps."""
        control = self._simulation.launcher.facts().get("step_control", {})
        return int(control.get("force_evaluations", 0))
