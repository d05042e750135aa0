"""Machine: a problem compiled for one method on one device, run with any step, and timed.

The step is an argument of the kernels, so that one compilation of a method serves all step sizes.
"""

import functools
import math
import time as clock
from collections.abc import Callable

import numpy as np

from mpp_taichi.accuracy.budget import Budget
from mpp_taichi.accuracy.conserved import PhaseLooks, judge
from mpp_taichi.accuracy.contact_methods import exact_solvers
from mpp_taichi.accuracy.measuring import Measurement, measure, shifted_start
from mpp_taichi.accuracy.observer import Observer
from mpp_taichi.accuracy.problem import AS_WRITTEN, Problem
from mpp_taichi.accuracy.sample import Configuration, Sample
from mpp_taichi.accuracy.stepper import StepCost, Stepper
from mpp_taichi.accuracy.stretches import LOOKS, Leg, Stretch, legs
from mpp_taichi.accuracy.trace import PhasePoint, Trace, followed
from mpp_taichi.errors import CapacityError, MppError
from mpp_taichi.simulation.simulation import Simulation

SHORT = 2e-3  # seconds over which runs are repeated for their time, at most MOST_REPEATS times
MOST_REPEATS = 8
LOST = 1e9  # times the initial extent of the system: a run that goes beyond it is stopped


class Machine:
    """One compiled method, in all phases of a scene."""

    def __init__(self, problem: Problem, integrator: str, *, backend: str, precision: str) -> None:
        """Compile, by one step and one sample of every phase; MppError where the scene does not allow the method."""
        began = clock.process_time()
        self.problem, self.name = problem, integrator
        self.simulation = Simulation(problem.with_method(integrator), backend=backend, precision=precision)
        self.integrator, self.contacts = self.simulation.integrator, self.simulation.contacts
        self.backend, self.precision = backend, precision
        self._is_adaptive = bool(self.integrator.controlled_by) and integrator != AS_WRITTEN
        self._own_tolerance = getattr(self.integrator, self.integrator.controlled_by) if self._is_adaptive else None
        self._tolerance = self._own_tolerance
        self.stepper, self._observer = Stepper(self.simulation, problem.phases), Observer(self.simulation)
        self.extent = float(np.abs(problem.start.position).max()) + problem.span * float(np.abs(problem.start.velocity).max())
        different = {self._kernels(leg.stretch): leg for leg in reversed(legs(problem.stretches, problem.own_steps))}
        for leg in different.values():
            self._enter(leg, begins=True)
            self.stepper.begin_cost(self._observer.kept())
            self.stepper.launch(leg.stretch.began, leg.dt, 1)
            self._observer.look(problem, leg.stretch.began, 0)
        self.compile_seconds = clock.process_time() - began
        for leg in different.values():
            self.stepper.cost_of_trial(functools.partial(self._enter, leg, begins=True), leg, problem.span / problem.samples)

    @property
    def order(self) -> int:
        """The order of the global error."""
        return self.integrator.order

    @property
    def seconds_per_step(self) -> float:
        """The time of a step on a quiet machine, the mean over the steps of a run [s]."""
        return self._mean(lambda cost: cost.seconds)

    @property
    def budget_per_step(self) -> float:
        """Seconds of a budget that a step takes: the processor time of all threads."""
        return self._mean(lambda cost: cost.seconds * cost.clock.parallelism)

    @property
    def evaluations(self) -> float:
        """Forces per step, as last counted for implicit and adaptive methods; collisions for event-driven flight."""
        return self._mean(lambda cost: cost.counted)

    @property
    def conserves_energy(self) -> bool:
        """Whether any phase of the problem keeps its energy."""
        return any("energy" in self._cost_of(stretch).kept for stretch in self.problem.stretches)

    def configuration(self, steps: int, tolerance: float | None = None) -> Configuration:
        """The configuration of so many steps, or of so many samples of an adaptive method, by default at its own tolerance."""
        here = (self.name, steps, self.precision, self.backend)
        if not self._is_adaptive:
            return Configuration(*here)
        return Configuration(*here, self.integrator.controlled_by, self._own_tolerance if tolerance is None else tolerance)

    def run(
        self,
        configuration: Configuration,
        budget: Budget,
        *,
        follow: bool = False,
        start: PhasePoint | None = None,
        looks: int = LOOKS,
    ) -> tuple[Sample, Trace | None]:
        """Run the span with the steps of a configuration of this method and device, and take samples on the way.

        From the problem's start, or from positions [length] and velocities [length / time] that are given. Each phase of a
        timeline begins with the state in which the phase before has ended.

        Relative errors: of the energy |E − E₀| / |E₀| (over kinetic + |potential| where E₀ is zero), of the momenta over the
        largest Σ m |v| and Σ m |x| |v| in the phase; the largest error of all phases, and the energy error of every sample.

        Raises:
            OutOfTime: the budget ended first.
        """
        parts = legs(self.problem.stretches, configuration.steps, looks)
        sample = Sample(
            configuration, self.problem.span / sum(leg.steps for leg in parts), compile_seconds=self.compile_seconds
        )
        self._tolerance = configuration.tolerance
        trace, conserved = Trace(np.zeros(0), np.zeros(0)), list[PhaseLooks]()
        places: list[tuple[float, np.ndarray, np.ndarray]] = []
        seconds, evaluations, own_steps, position = 0.0, 0.0, 0, self.problem.start.position
        for number, leg in enumerate(parts):
            self._enter(leg, start, begins=number == 0)
            conserved.append(PhaseLooks(self.stepper.cost.kept))
            if follow:
                trace.begins.append(self.simulation.state.read())
            took, counted, position = self._run_leg(
                leg, budget, sample, conserved[-1], places, follow=follow, is_first=number == 0
            )
            seconds += took
            evaluations += self._evaluations(leg, counted, sample)
            control = self.simulation.launcher.facts().get("step_control")
            own_steps += control["steps"] if control is not None else leg.steps
            if sample.status != "ok":
                break
        else:
            sample.end = self._observer.end(self.problem, position)
            sample.seconds.append(seconds)
        if self._is_adaptive:
            sample.dt = self.problem.span / max(1, own_steps)
        sample.evaluations = round(evaluations)
        judge(sample, conserved)
        if sample.status == "ok" and start is None and self.problem.wanted is not None:
            self._measure_wanted(sample, budget)
        if sample.status != "ok":
            return sample, None
        if not follow:
            return sample, None
        trace.times, trace.position, trace.velocity = (np.array(part) for part in zip(*places))
        return sample, trace

    def time(self, configuration: Configuration, budget: Budget) -> float:
        """Seconds of the steps on a quiet machine, without samples; see StepClock.

        A short run is repeated for SHORT, and its shortest time counts: other programs, which share the caches and the units of
        the processor, only add to the time.
        """
        shortest, spent = float("inf"), 0.0
        while spent < SHORT:
            seconds = self.steps_alone(configuration, budget)
            shortest, spent = min(shortest, seconds), spent + max(seconds, SHORT / MOST_REPEATS * len(self.problem.stretches))
            budget = Budget(float("inf"))  # repeats are too short to be broken off
        return shortest

    def steps_alone(self, configuration: Configuration, budget: Budget) -> float:
        """Run once without samples; seconds of the steps on a quiet machine."""
        self._tolerance = configuration.tolerance
        seconds = 0.0
        for number, leg in enumerate(legs(self.problem.stretches, configuration.steps)):
            self._enter(leg, begins=number == 0)
            seconds += self.stepper.advance(leg, 0, leg.steps, budget)[0]
        return seconds

    def enter(self, leg: Leg) -> None:
        """Go to the phase of a leg, whatever the state is, for `advance_from`."""
        self._enter(leg, begins=True)

    def advance_from(self, state: PhasePoint, leg: Leg, before: int, stop: int, budget: Budget) -> PhasePoint:
        """Positions [length] and velocities [length / time] at step `stop` of a leg that was entered, from step `before`."""
        self.simulation.state.write(*state)
        self.simulation.launcher.prepare(leg.time(before), leg.dt)
        self.stepper.advance(leg, before, stop, budget)
        return self.simulation.state.read()

    def measure(self, configuration: Configuration, budget: Budget, *, number: int = 0, finer: float = 1.0) -> Measurement:
        """Measure the wanted quantity in a run from shifted start `number`; see `measuring`."""
        self._tolerance = configuration.tolerance
        start, steps = shifted_start(self.problem, number, self.precision, configuration.key), configuration.steps
        lengths = None
        if len(self.problem.stretches) > 1 and (self._is_adaptive or self.name in exact_solvers()):
            lengths = {stretch.number: self.problem.span / steps for stretch in self.problem.stretches}
        elif len(self.problem.stretches) > 1:
            parts = legs(self.problem.stretches, steps)
            steps, lengths = sum(leg.steps for leg in parts), {leg.stretch.number: leg.dt for leg in parts}
        return measure(
            self.simulation, self.problem, steps, budget, finer=finer, start=start, lengths=lengths, begin=self._set_tolerance
        )

    def change(self, problem: Problem) -> None:
        """Go on with another span of the scene, or another number of samples."""
        if self._is_adaptive:
            for cost in self.stepper.costs.values():
                cost.seconds *= self.problem.samples / problem.samples
        self.problem = problem

    def close(self) -> None:
        """Free the memory."""
        self.simulation.close()

    # Internals

    asked_interval = math.inf  # the shortest time between samples for which the wanted quantity asked in the last run

    def _measure_wanted(self, sample: Sample, budget: Budget) -> None:
        """Add the values of the wanted quantity to a sample."""
        assert self.problem.wanted is not None
        for number in range(self.problem.wanted.runs):
            found = self.measure(sample.configuration, budget, number=number)
            if found.values is None:
                sample.status, sample.reason = "diverged" if found.broken else "undefined", found.reason
                sample.end, sample.values = None, []
                return
            sample.values.append(list(found.values))
            self.asked_interval = found.shortest

    def _set_tolerance(self) -> None:
        """Give the method of the present phase the tolerance of the present run."""
        integrator = self.simulation.integrator
        if self._is_adaptive:
            setattr(integrator, integrator.controlled_by, self._own_tolerance if self._tolerance is None else self._tolerance)

    def _kernels(self, stretch: Stretch) -> object:
        return self.problem.phases[stretch.number].kernels

    def _cost_of(self, stretch: Stretch) -> StepCost:
        """The cost of a step in the phase of a stretch."""
        return self.stepper.costs[self._kernels(stretch)]

    def _mean(self, of: Callable[[StepCost], float]) -> float:
        """The mean over the steps of a run."""
        return sum(stretch.share * of(self._cost_of(stretch)) for stretch in self.problem.stretches)

    def _enter(self, leg: Leg, start: PhasePoint | None = None, *, begins: bool = False) -> None:
        """Begin the problem in the phase of a leg; or go on with this phase, from the present state."""
        simulation, number, problem = self.simulation, leg.stretch.number, self.problem
        if begins:
            simulation.restart()
        if simulation.phase_number != number:
            simulation.begin_phase(number)
        if begins and start is None and problem.stretches[0].number:
            start = (problem.start.position, problem.start.velocity * problem.start.free)
        if begins and start is not None:
            simulation.state.write(*start)
        self._set_tolerance()
        simulation.launcher.prepare(leg.stretch.began, leg.dt)
        self.contacts = simulation.contacts
        if self.contacts is not None:
            self.contacts.collect()

    def _run_leg(
        self,
        leg: Leg,
        budget: Budget,
        sample: Sample,
        looks: PhaseLooks,
        places: list[tuple[float, np.ndarray, np.ndarray]],
        *,
        follow: bool,
        is_first: bool,
    ) -> tuple[float, int, np.ndarray]:
        """The steps of a leg with its samples: seconds, iterations of the solver or collisions, positions at the end."""
        seconds, solver_steps, position = 0.0, 0, self.problem.start.position
        kept = followed(self.problem) if follow else None
        for before, stop in zip((0, *leg.stops), leg.stops):
            try:
                took, iterations, solved = self.stepper.advance(leg, before, stop, budget)
            except MppError as error:  # a contact solver that no longer advances, or a method that needs too many steps
                if self.contacts is None and not isinstance(error, CapacityError):
                    raise
                sample.status, sample.reason = "diverged", str(error).splitlines()[0]
                break
            seconds += took
            solver_steps += iterations
            found, position, velocity = self._observer.look(self.problem, leg.time(stop), stop)
            if not solved or not np.isfinite(position).all() or float(np.abs(position).max()) > LOST * max(self.extent, 1e-300):
                unsolved = "contacts that it could not resolve" if self.contacts else "a step that its solver could not solve"
                what = "grew out of bounds" if solved else f"had {unsolved}"
                sample.status, sample.reason = "diverged", f"it {what} before t = {leg.time(stop):.4g}"
                break
            looks.rows.append(found)
            if follow and (is_first or stop):  # the end of the leg before is the begin of this leg
                places.append((found["time"], position[kept], velocity[kept]))
        trouble = self.simulation.launcher.trouble() if self.stepper.chooses_steps else None
        if trouble is not None and trouble.kind == "stalled":
            sample.status, sample.reason = "diverged", "its steps became too short for the time to go on"
        return seconds, solver_steps, position

    def _evaluations(self, leg: Leg, counted: int, sample: Sample) -> float:
        """Evaluations of the forces in a leg, of which `counted` are known."""
        control, cost = self.simulation.launcher.facts().get("step_control"), self.stepper.cost
        if control is not None:
            cost.counted = control["force_evaluations"] / leg.steps
        elif self.stepper.solves or self.stepper.counts_collisions:
            cost.counted = counted / leg.steps if self.stepper.counts_collisions else max(1.0, counted / leg.steps)
        else:
            declared = self.simulation.integrator.evaluations_per_step
            cost.counted = max(1.0, cost.counted) if declared is None else float(declared)
        return cost.counted * leg.steps
