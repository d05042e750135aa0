"""Stepper: advances a simulation by launches that are short enough to stop, and keeps the cost of a step in each phase."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from mpp_taichi.accuracy.budget import Budget
from mpp_taichi.accuracy.step_clock import LaunchTime, StepClock
from mpp_taichi.accuracy.stretches import Leg
from mpp_taichi.device import backends
from mpp_taichi.simulation.course import Phase
from mpp_taichi.simulation.simulation import Simulation

LAUNCH_SECONDS = 0.1  # of one launch: short enough to stop when the budget ends
STEPS_WITH_CONTACTS = 16  # of a launch: a step may take much longer than the step before
LONG_LAUNCH = 0.02  # of a launch that measures the time of a step
TRIAL = 8  # part of the time between two samples for which an adaptive method is tried out
TRIALS = 3  # of an adaptive method
TINY = 1e-6  # of the scene's own step: explicit methods take the same time for a step of any length


@dataclass(eq=False)
class StepCost:
    """The cost of a step in the phases that have the same kernels.

    counted   evaluations of the forces, as last counted for implicit and adaptive methods; collisions of an event-driven flight
    kept      the conserved quantities that these phases keep
    """

    clock: StepClock
    counted: float
    kept: frozenset[str]
    seconds: float = 0.0


class Stepper:
    """The steps of one simulation, in whatever phase it is.

    costs   by the kernels of the phases
    """

    def __init__(self, simulation: Simulation, phases: Sequence[Phase]) -> None:
        """Begin without a step."""
        self.simulation, self.phases = simulation, phases
        self.costs: dict[object, StepCost] = {}

    def begin_cost(self, kept: frozenset[str]) -> None:
        """Begin to count the cost of the present phase, which keeps these quantities."""
        forces = float(self.simulation.integrator.evaluations_per_step or 1.0)
        self.costs[self._kernels] = StepCost(StepClock(self._threads()), forces, kept)

    @property
    def cost(self) -> StepCost:
        """The cost of a step in the present phase."""
        return self.costs[self._kernels]

    @property
    def chooses_steps(self) -> bool:
        """Whether the method of the present phase chooses its steps."""
        return "step_control" in self.simulation.launcher.facts()

    @property
    def counts_collisions(self) -> bool:
        """Whether the present phase has no steps, but collisions."""
        return not self.simulation.launcher.takes_steps

    @property
    def solves(self) -> bool:
        """Whether a step of the present phase solves equations."""
        return "linear_solver" in self.simulation.launcher.facts()

    def launch(self, time: float, dt: float, steps: int) -> LaunchTime:
        """Some steps of the present phase; their times."""
        ti = backends.import_taichi()
        ti.sync()

        def launch() -> None:
            self.simulation.launcher.advance(time, dt, 0, steps)
            ti.sync()

        return self.cost.clock.time(launch)

    def advance(self, leg: Leg, before: int, stop: int, budget: Budget) -> tuple[float, int, bool]:
        """Advance; returns the seconds, the solver's iterations or the collisions, and whether every step was solved."""
        seconds, iterations, done = 0.0, 0, before
        cost, simulation = self.cost, self.simulation
        while done < stop:
            budget.check()
            most = max(1, min(simulation.phase.launch_limit, int(LAUNCH_SECONDS / cost.seconds)))
            if simulation.contacts is not None:
                most = min(most, STEPS_WITH_CONTACTS)
            count = min(stop - done, most)
            launch = self.launch(leg.time(done), leg.dt, count)
            took = cost.clock.seconds(launch)
            seconds += took
            self._learn(took / count, took)
            if not simulation.device.on_cpu:
                budget.wait(launch.waited)
            done += count
            if simulation.contacts is not None:
                found = simulation.contacts.collect()
                iterations += found.pair_count + found.wall_count
                if found.unresolved:
                    return seconds, iterations, False
            report = simulation.launcher.collect()
            if report is not None:
                iterations += report.newton_iterations + report.linear_iterations
                if report.unsolved:
                    return seconds, iterations, False
        return seconds, iterations, True

    def cost_of_trial(self, enter: Callable[[], None], leg: Leg, between_samples: float) -> None:
        """Keep the seconds per step of trials that begin with `enter`.

        The trial of an adaptive method is one launch, which may hold the end of a compilation or the work of other threads:
        a short one is repeated, and the shortest counts.
        """
        shortest = math.inf
        for _ in range(TRIALS):
            enter()
            shortest = min(shortest, self.try_out(leg, between_samples))
            if not self.chooses_steps or shortest > TRIAL * LONG_LAUNCH:
                break
        self.cost.seconds = shortest

    def try_out(self, leg: Leg, between_samples: float) -> float:
        """Seconds per step, from launches of more and more steps until the clock can resolve them.

        An adaptive method is tried over a part of the time between two samples.
        """
        began = leg.stretch.began
        if self.chooses_steps:
            return TRIAL * self._launch_seconds(began, between_samples / TRIAL, 1)
        steps, limit = 1, self.simulation.phase.launch_limit
        dt = leg.dt if self.solves or self.simulation.contacts else TINY * leg.dt
        if self.simulation.contacts is not None:  # beyond the span the motion may fail
            limit = min(limit, max(4, leg.steps))
        while (seconds := self._launch_seconds(began, dt, steps)) < 2e-3 and 4 * steps <= limit:
            steps *= 4
        return min(seconds, self._launch_seconds(began, dt, steps)) / steps

    # Internals

    @property
    def _kernels(self) -> object:
        return self.phases[self.simulation.phase_number].kernels

    def _launch_seconds(self, time: float, dt: float, steps: int) -> float:
        return self.cost.clock.seconds(self.launch(time, dt, steps))

    def _learn(self, seconds_per_step: float, seconds: float) -> None:
        """Keep the shortest time of a step, since a busy machine only adds; the steps of implicit methods differ in length."""
        differs = self.chooses_steps or self.simulation.contacts or (self.solves and seconds > LONG_LAUNCH)
        self.cost.seconds = seconds_per_step if differs else min(self.cost.seconds, seconds_per_step)

    def _threads(self) -> int:
        """Threads that work on a step of the present phase; 0 on another device than the CPU."""
        device = self.simulation.device
        return (device.threads if self.simulation.plan == "parallel" else 1) if device.on_cpu else 0
