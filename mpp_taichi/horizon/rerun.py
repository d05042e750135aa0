"""Rerun: the scene run once more from its start with coarser or finer steps, before the run itself begins.

A rerun uses the kernels of the run: the step, and the tolerance of a method that chooses its steps, are their arguments.
"""

from collections.abc import Generator, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from mpp_taichi.simulation.simulation import Simulation

TOLERANCE_FACTOR = 4.0  # of a method that chooses its steps
HAIR = 1e-6  # of a step: a rest that is rounding of the time
MOST_FOLLOWED = 1000  # particles whose positions are compared


class Rerun:
    """Follows the scene from its start; `coarseness` is 1 for the steps of the run, 2 for coarser and 1/2 for finer steps."""

    def __init__(self, simulation: "Simulation", coarseness: float) -> None:
        """Bind the parts; nothing moves yet."""
        self._simulation, self._coarseness = simulation, coarseness
        self._own_dt, self._first = simulation.dt, simulation.phase_number
        self.evaluations = 0  # of a method that chooses its steps
        moving = np.flatnonzero(simulation.start.free.any(axis=1))
        self._followed = moving[:: max(1, -(-len(moving) // MOST_FOLLOWED))]

    def positions(self, times: Sequence[float]) -> Generator[np.ndarray]:
        """Positions of the followed particles at each time, (followed, 3) [length]; it ends where the run cannot go on."""
        simulation = self._simulation
        own: dict[Any, float] = {}
        try:
            self._set_step(own)
            simulation.restart()  # takes the start for steps of this length
            for time in times:
                if not self._advance_to(time, own):
                    return
                place = simulation.state.read()[0][self._followed]
                if not np.isfinite(place).all():
                    return
                yield place
        finally:
            for integrator, tolerance in own.items():
                setattr(integrator, integrator.controlled_by, tolerance)
            self.evaluations = self._count()
            simulation.launcher.clear_trouble()
            if simulation.phase_number != self._first:
                simulation.restart()
            simulation.dt = self._own_dt
            simulation.restart()

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
            simulation.begin_phase(simulation.phase_number + 1)
            self._set_step(own)
        return self._advance_by(time - simulation.time)

    def _advance_by(self, span: float) -> bool:
        simulation = self._simulation
        if span <= HAIR * simulation.dt:
            return True
        if simulation.integrator.controlled_by:  # it takes its own steps to the time
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
