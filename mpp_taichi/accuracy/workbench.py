"""Workbench: a problem compiled for several methods on one device, run with any step, and timed.

The step is an argument of the kernels, so that one compilation of a method serves all step sizes. A device has one precision
at a time: a workbench of another precision ends the present workbench.
"""

import math
import time as clock
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from mpp_taichi.accuracy.budget import Budget
from mpp_taichi.accuracy.force_solvers import with_force_solver
from mpp_taichi.accuracy.measuring import Measurement, measure, shifted_start
from mpp_taichi.accuracy.methods import LOOKS
from mpp_taichi.accuracy.problem import Problem, with_integrator
from mpp_taichi.accuracy.sample import Configuration, Sample
from mpp_taichi.accuracy.step_clock import LaunchTime, StepClock
from mpp_taichi.device import backends
from mpp_taichi.energy.energy_error import ratio, relative_error
from mpp_taichi.errors import MppError
from mpp_taichi.simulation.simulation import Simulation

if TYPE_CHECKING:
    from mpp_taichi.energy.energy_meter import EnergyMeter

Phase = tuple[np.ndarray, np.ndarray]
MOST_FOLLOWED = 1000  # particles whose positions are kept in every sample
LAUNCH_SECONDS = 0.1  # of one launch: short enough to stop when the budget ends
STEPS_WITH_CONTACTS = 16  # of a launch: a step may take much longer than the step before
LONG_LAUNCH = 0.02  # of a launch that measures the time of a step
SHORT = 2e-3  # seconds over which runs are repeated for their time, at most MOST_REPEATS times
MOST_REPEATS = 20
TRIAL = 8  # part of the time between two samples for which an adaptive method is tried out
TINY = 1e-6  # of the scene's own step: explicit methods take the same time for a step of any length
LOST = 1e9  # times the initial extent of the system: a run that goes beyond it is stopped


@dataclass(eq=False)
class Trace:
    """The path of a run, kept on demand: positions [length] of the followed particles, (samples, followed, 3)."""

    times: np.ndarray
    position: np.ndarray


class Machine:
    """One compiled method."""

    def __init__(self, problem: Problem, integrator: str, *, backend: str, precision: str) -> None:
        """Compile, by one step and one sample; MppError where the scene does not allow the method."""
        began = clock.process_time()
        self.problem, self.name = problem, integrator
        spec = with_integrator(problem.spec, integrator, problem.own_dt)
        self.simulation = Simulation(spec, backend=backend, precision=precision)
        self.integrator, self.contacts = self.simulation.integrator, self.simulation.contacts
        self.backend, self.precision = backend, precision
        launcher, device = self.simulation.launcher, self.simulation.device
        threads = device.threads if self.simulation.phase.plan == "parallel" else 1
        self.clock = StepClock(threads if device.on_cpu else 0)
        self._is_adaptive, self._counts_collisions = bool(self.integrator.controlled_by), not launcher.takes_steps
        self._solves = "linear_solver" in launcher.facts()
        self.energy_meter = self._direct_meter() if self.simulation.total_force.by_tree else self.simulation.phase.energy_meter
        self._own_tolerance = getattr(self.integrator, self.integrator.controlled_by) if self._is_adaptive else None
        self.extent = float(np.abs(problem.start.position).max()) + problem.span * float(np.abs(problem.start.velocity).max())
        self._begin(problem.own_dt)
        self._launch(0.0, problem.own_dt, 1)
        self._look(0.0, 0)
        self._begin(problem.own_dt)
        self.compile_seconds = clock.process_time() - began
        self.seconds_per_step = self._try_out()

    @property
    def order(self) -> int:
        """The order of the global error."""
        return self.integrator.order

    @property
    def budget_per_step(self) -> float:
        """Seconds of a budget that a step takes: the processor time of all threads."""
        return self.seconds_per_step * self.clock.parallelism

    @property
    def evaluations(self) -> float:
        """Forces per step, as last counted for implicit and adaptive methods; collisions for event-driven flight."""
        if self._counts_collisions:
            return self._counted
        declared = self.integrator.evaluations_per_step
        return max(1.0, self._counted) if declared is None else float(declared)

    def configuration(self, steps: int, tolerance: float | None = None) -> Configuration:
        """The configuration of so many steps, or of so many samples of an adaptive method, by default at its own tolerance."""
        here = (self.name, steps, self.precision, self.backend)
        if not self._is_adaptive:
            return Configuration(*here)
        return Configuration(*here, self.integrator.controlled_by, self._own_tolerance if tolerance is None else tolerance)

    def run(
        self, configuration: Configuration, budget: Budget, *, follow: bool = False, start: Phase | None = None
    ) -> tuple[Sample, Trace | None]:
        """Run the span with the steps of a configuration of this method and device, and take samples on the way.

        From the scene's start, or from positions [length] and velocities [length / time] that are given.

        Relative errors: of the energy |E − E₀| / |E₀| (over kinetic + |potential| where E₀ is zero), of the momenta over the
        largest Σ m |v| and Σ m |x| |v| in the run; the largest error of the run, and the energy error of every sample.

        Raises:
            OutOfTime: the budget ended first.
        """
        steps = configuration.steps
        dt = self.problem.span / steps
        sample = Sample(configuration, dt, compile_seconds=self.compile_seconds)
        stops = sorted({round(k * steps / LOOKS) for k in range(LOOKS + 1)})
        self._begin(dt, configuration.tolerance, start)
        rows, places, seconds, solver_steps = [], [], 0.0, 0
        for before, stop in zip((0, *stops), stops):
            try:
                took, iterations, solved = self._advance(before, stop, dt, budget)
            except MppError as error:  # a contact solver that no longer advances
                if self.contacts is None:
                    raise
                sample.status, sample.reason = "diverged", str(error).splitlines()[0]
                break
            seconds += took
            solver_steps += iterations
            found, position = self._look(stop * dt, stop)
            if not solved or not np.isfinite(position).all() or float(np.abs(position).max()) > LOST * max(self.extent, 1e-300):
                unsolved = "contacts that it could not resolve" if self.contacts else "a step that its solver could not solve"
                what = "grew out of bounds" if solved else f"had {unsolved}"
                sample.status, sample.reason = "diverged", f"it {what} before t = {stop * dt:.4g}"
                break
            rows.append(found)
            if follow:
                places.append(position[self._followed()])
        else:
            sample.end = position
            sample.seconds.append(seconds)
        if self._solves or self._counts_collisions:
            self._counted = solver_steps / max(1, steps)
        control = self.simulation.launcher.facts().get("step_control")
        if control is not None:
            self._counted = control["force_evaluations"] / steps
            sample.dt = self.problem.span / max(1, control["steps"])
            trouble = self.simulation.launcher.trouble()
            if trouble is not None and trouble.kind == "stalled":
                sample.status, sample.reason, sample.end = "diverged", "its steps became too short for the time to go on", None
        sample.evaluations = round(self.evaluations * steps)
        self._judge(sample, rows)
        if sample.status == "ok" and start is None and self.problem.wanted is not None:
            self._measure_wanted(sample, budget)
        if sample.status != "ok":
            return sample, None
        trace = Trace(np.array([row["time"] for row in rows]), np.array(places)) if follow else None
        return sample, trace

    def time(self, configuration: Configuration, budget: Budget) -> float:
        """Seconds of the steps on a quiet machine, without samples; see StepClock.

        A short run is repeated for SHORT, and its shortest time counts: other programs, which share the caches and the units of
        the processor, only add to the time.
        """
        dt = self.problem.span / configuration.steps
        shortest, spent = float("inf"), 0.0
        while spent < SHORT:
            self._begin(dt, configuration.tolerance)
            seconds = self._advance(0, configuration.steps, dt, budget)[0]
            shortest, spent = min(shortest, seconds), spent + max(seconds, SHORT / MOST_REPEATS)
        return shortest

    def advance_from(self, state: Phase, before: int, stop: int, dt: float, budget: Budget) -> tuple[np.ndarray, np.ndarray]:
        """Positions [length] and velocities [length / time] at step `stop`, from the state at step `before`."""
        self.simulation.state.write(*state)
        self.simulation.launcher.prepare(before * dt, dt)
        self._advance(before, stop, dt, budget)
        return self.simulation.state.read()

    def measure(self, configuration: Configuration, budget: Budget, *, number: int = 0, finer: float = 1.0) -> Measurement:
        """Measure the wanted quantity in a run from shifted start `number`; see `measuring`."""
        self._set_tolerance(configuration.tolerance)
        start = shifted_start(self.problem, number, self.precision)
        return measure(self.simulation, self.problem, configuration.steps, budget, finer=finer, start=start)

    def change(self, problem: Problem) -> None:
        """Go on with another span of the scene, or another number of samples."""
        if self._is_adaptive:
            self.seconds_per_step *= self.problem.samples / problem.samples
        self.problem = problem

    def close(self) -> None:
        """Free the memory."""
        self.simulation.close()

    # Internals

    _counted = 1.0
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

    def _set_tolerance(self, tolerance: float | None) -> None:
        if self._is_adaptive:
            setattr(self.integrator, self.integrator.controlled_by, self._own_tolerance if tolerance is None else tolerance)

    def _begin(self, dt: float, tolerance: float | None = None, start: Phase | None = None) -> None:
        self._set_tolerance(tolerance)
        self.simulation.restart()
        if start is not None:
            self.simulation.state.write(*start)
        self.simulation.launcher.prepare(0.0, dt)
        if self.contacts is not None:
            self.contacts.collect()

    def _launch(self, time: float, dt: float, steps: int) -> LaunchTime:
        ti = backends.import_taichi()
        ti.sync()

        def launch() -> None:
            self.simulation.launcher.advance(time, dt, 0, steps)
            ti.sync()

        return self.clock.time(launch)

    def _launch_seconds(self, time: float, dt: float, steps: int) -> float:
        return self.clock.seconds(self._launch(time, dt, steps))

    def _try_out(self) -> float:
        """Seconds per step, from launches of more and more steps until the clock can resolve them."""
        if self._is_adaptive:
            return TRIAL * self._launch_seconds(0.0, self.problem.span / self.problem.samples / TRIAL, 1)
        steps, limit = 1, self.simulation.phase.launch_limit
        dt = self.problem.own_dt if self._solves or self.contacts else TINY * self.problem.own_dt
        if self.contacts is not None:  # beyond the span the motion may fail
            limit = min(limit, max(4, int(self.problem.span / dt)))
        while (seconds := self._launch_seconds(0.0, dt, steps)) < 2e-3 and 4 * steps <= limit:
            steps *= 4
        return min(seconds, self._launch_seconds(0.0, dt, steps)) / steps

    def _learn(self, seconds_per_step: float, seconds: float) -> None:
        """Keep the shortest time of a step, since a busy machine only adds; the steps of implicit methods differ in length."""
        differs = self._is_adaptive or self.contacts or (self._solves and seconds > LONG_LAUNCH)
        self.seconds_per_step = seconds_per_step if differs else min(self.seconds_per_step, seconds_per_step)

    def _advance(self, before: int, stop: int, dt: float, budget: Budget) -> tuple[float, int, bool]:
        """Advance; returns the seconds, the solver's iterations or the collisions, and whether every step was solved."""
        seconds, iterations, done = 0.0, 0, before
        while done < stop:
            budget.check()
            most = max(1, min(self.simulation.phase.launch_limit, int(LAUNCH_SECONDS / self.seconds_per_step)))
            if self.contacts is not None:
                most = min(most, STEPS_WITH_CONTACTS)
            count = min(stop - done, most)
            launch = self._launch(done * dt, dt, count)
            took = self.clock.seconds(launch)
            seconds += took
            self._learn(took / count, took)
            if self.backend != "cpu":
                budget.wait(launch.waited)
            done += count
            if self.contacts is not None:
                found = self.contacts.collect()
                iterations += found.pair_count + found.wall_count
                if found.unresolved:
                    return seconds, iterations, False
            report = self.simulation.launcher.collect()
            if report is not None:
                iterations += report.newton_iterations + report.linear_iterations
                if report.unsolved:
                    return seconds, iterations, False
        return seconds, iterations, True

    def _followed(self) -> np.ndarray:
        return followed(self.problem)

    def _look(self, time: float, step: int) -> tuple[dict, np.ndarray]:
        position, velocity = self.simulation.state.read()
        there = self.problem.start.moved(position=position, velocity=velocity, time=time, step=step)
        with np.errstate(over="ignore", invalid="ignore"):
            return self.energy_meter.mechanics(there, time), position

    def _direct_meter(self) -> "EnergyMeter":
        """A meter of the energy by direct sums, in which the errors of a tree show."""
        from mpp_taichi.energy.energy_meter import EnergyMeter
        from mpp_taichi.forces._total_force import TotalForce, compose

        spec, start = with_force_solver(self.problem.spec, None), self.problem.start
        return EnergyMeter(self.simulation.state, TotalForce(compose(spec, start), start.particle_count, spec.dimensions))

    def _judge(self, sample: Sample, rows: list[dict]) -> None:
        if not rows:
            return
        first, simulation = rows[0], self.simulation
        if simulation.phase.conserves_energy:
            largest = max(row["kinetic_energy"] + abs(row["potential_energy"]) for row in rows)
            start = first["total_energy"]
            sample.times = [row["time"] for row in rows]
            sample.energy_errors = [relative_error(row["total_energy"] - start, start, largest) for row in rows]
            sample.energy = max(sample.energy_errors)
        kept = {
            "momentum": simulation.phase.conserves_momentum,
            "angular_momentum": simulation.phase.conserves_angular_momentum,
        }
        for name in (name for name, stays in kept.items() if stays):
            scale = max(row[f"{name}_scale"] for row in rows)
            setattr(sample, name, max(ratio(float(np.linalg.norm(row[name] - first[name])), scale) for row in rows))


def followed(problem: Problem) -> np.ndarray:
    """Indices of the moving particles whose positions are kept: all of them, or at most MOST_FOLLOWED, evenly chosen."""
    moving = np.flatnonzero(problem.start.free.any(axis=1))
    return moving[:: -(-len(moving) // MOST_FOLLOWED)]


class Workbench:
    """The compiled methods of one device and precision, each compiled when it is first needed."""

    def __init__(self, problem: Problem, *, backend: str, precision: str) -> None:
        """Begin without a compiled method."""
        self.problem, self.backend, self.precision = problem, backend, precision
        self.machines: dict[str, Machine] = {}

    def machine(self, integrator: str) -> Machine:
        """A compiled method; MppError where the scene does not allow it."""
        if integrator not in self.machines:
            made = Machine(self.problem, integrator, backend=self.backend, precision=self.precision)
            self.machines[integrator] = made
        return self.machines[integrator]

    def shorten(self, problem: Problem) -> None:
        """Continue with a shorter span of the same scene, or another number of samples."""
        self.problem = problem
        for machine in self.machines.values():
            machine.change(problem)

    def __enter__(self) -> "Workbench":
        """Use as a context manager."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close every machine."""
        for machine in self.machines.values():
            machine.close()
        self.machines.clear()
