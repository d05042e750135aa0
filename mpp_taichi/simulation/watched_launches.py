"""Watched launches: steps launched on the device, and the state that each launch leaves judged before the run goes on."""

import time
from dataclasses import dataclass
from typing import Any

from mpp_taichi.simulation import first_bad_step
from mpp_taichi.simulation.accounts import Accounts
from mpp_taichi.simulation.clock import Clock
from mpp_taichi.simulation.compiled_phase import CompiledPhase, SavedFields
from mpp_taichi.simulation.course import Phase
from mpp_taichi.solvers.report import SolverReport

LAUNCH_SECONDS = 0.1  # aim for one launch: short enough to interrupt a run, long enough that the launch itself costs little
GROWTH = 8  # times as many steps, at most, from one launch to the next


@dataclass
class Timings:
    """Where the time of a run went, in seconds of the wall clock, and how many launches of steps there were.

    setup_seconds     reading the scene, starting the device, allocating and filling the fields
    compile_seconds   first launches of each phase, which compile the kernels
    advance_seconds   all other launches
    launch_count      under the serial plan each one holds many steps
    """

    setup_seconds: float = 0.0
    compile_seconds: float = 0.0
    advance_seconds: float = 0.0
    launch_count: int = 0


class WatchedLaunches:
    """Launches the steps of a run, times them, and stops at the last good state where something goes wrong."""

    def __init__(self, clock: Clock, accounts: Accounts) -> None:
        """Nothing was launched yet."""
        self._clock, self._accounts = clock, accounts
        self.timings = Timings()
        self.steps_of_next = 1  # so that a launch takes about LAUNCH_SECONDS
        self._phase: Phase | None = None  # for which that holds

    def longest(self, phase: CompiledPhase) -> int:
        """Most steps that the next launch should hold; the first launch of a phase holds one step."""
        if phase.phase is not self._phase:
            self._phase, self.steps_of_next = phase.phase, 1
        balance = self._accounts.energy_balance
        most = phase.launch_limit if balance is None else min(phase.launch_limit, balance.meter.longest_launch)
        return min(self.steps_of_next, most)

    def launch(self, phase: CompiledPhase, steps: int, dt: float, meter: Any = None) -> None:
        """Launch so many steps of the length `dt`; the clock stays, and nothing is judged."""
        phase.prepare(self._clock.time)
        origin, first = self._clock.origin_of(steps, dt)
        phase.stepper.advance(origin, dt, steps, meter, first=first)
        self.timings.launch_count += 1

    def try_steps(self, phase: CompiledPhase, steps: int, dt: float) -> bool:
        """Go on without accounts; False where a number is not finite or an implicit step is not solved."""
        while steps > 0:
            count = min(steps, phase.launch_limit)
            self.launch(phase, count, dt)
            self._clock.move(count, dt)
            steps -= count
        solved = not (phase.integrator.implicit and phase.stepper.solver_report().unsolved)
        return solved and phase.stepper.first_bad_particle() < 0

    def advance(self, phase: CompiledPhase, steps: int, dt: float) -> None:
        """Make one launch, time it, and judge the state that it leaves.

        Raises:
            StabilityError: a number is not finite, or a step could not be solved; the last good state stands.
        """
        saved, balance = phase.save(), self._accounts.energy_balance
        began = time.perf_counter()
        self.launch(phase, steps, dt, None if balance is None else balance.meter)
        bad_particle = phase.stepper.first_bad_particle()  # waits for the device
        seconds = time.perf_counter() - began
        if phase.integrator.implicit:
            self._count_solver(phase, saved, dt)
        if phase.integrator.adaptive:
            self._check_steps_of_method(phase)
        if phase.contacts is not None:
            self._count_contacts(phase, saved)
        if bad_particle >= 0:
            self._fail(phase, saved, steps, dt)
        self._note(seconds, steps, compiled=not saved.prepared)
        self._clock.move(steps, dt)

    def _note(self, seconds: float, steps: int, *, compiled: bool) -> None:
        """Book the time of a launch, and let it decide how many steps the next launch holds."""
        if compiled:
            self.timings.compile_seconds += seconds
            return
        self.timings.advance_seconds += seconds
        if steps == self.steps_of_next:
            self.steps_of_next = max(1, min(steps * GROWTH, int(steps * LAUNCH_SECONDS / max(seconds, 1e-6))))

    def _count_solver(self, phase: CompiledPhase, saved: SavedFields, dt: float) -> None:
        """Add the counts of the solver of implicit steps; a step that is not solved ends the run before it."""
        report: SolverReport = phase.stepper.solver_report()
        if not report.unsolved:
            self._accounts.solver_report.add(report)
            return
        particle = phase.stepper.least_solved_particle() % phase.state.particle_count
        phase.restore(saved)
        if report.fewest_steps:
            self.launch(phase, report.fewest_steps, dt)
            phase.stepper.solver_report()
        self._clock.move(report.fewest_steps, dt)
        self._accounts.solver_report.add(report)
        raise first_bad_step.unsolved(phase.snapshot(self._clock), particle, **self._next_step(dt))

    def _check_steps_of_method(self, phase: CompiledPhase) -> None:
        """End the run where a method that chooses its steps cannot go on."""
        stalled = phase.stepper.stalled_particle()
        if stalled >= 0:
            particle, now = stalled % phase.state.particle_count, phase.snapshot(self._clock)
            time_of_stall = phase.stepper.adaptive_time()
            raise first_bad_step.stalled(now, particle, step=self._clock.step_count, time=time_of_stall)

    def _count_contacts(self, phase: CompiledPhase, saved: SavedFields) -> None:
        """Add the counts of the contact solver; a contact that it gave up on ends the run where the launch began."""
        assert phase.contacts is not None
        found = phase.contacts.collect()
        if found.unresolved:
            phase.restore(saved)
            step, now = self._clock.step_count, self._clock.time
            raise first_bad_step.unresolved(found.unresolved, phase.contacts, step=step, time=now)
        self._accounts.contact_report += found

    def _fail(self, phase: CompiledPhase, saved: SavedFields, steps: int, dt: float) -> None:
        """Find the step, the particle and the pair with which a number ceased to be finite; the step before it stands."""
        stored = [saved]

        def advance(count: int) -> bool:
            self.launch(phase, count, dt)
            return phase.stepper.first_bad_particle() < 0

        def keep() -> None:
            stored[0] = phase.save()

        def rewind() -> None:
            phase.restore(stored[0])

        bad_step = first_bad_step.first_bad_step(steps, advance, keep, rewind)
        self._clock.move(bad_step - 1, dt)
        before, count = phase.snapshot(self._clock), phase.state.particle_count
        self.launch(phase, 1, dt)
        found, lost = phase.stepper.first_bad_particle(), phase.stepper.lost_particle()
        reason = phase.integrator.left_lattice(phase.state, found)
        rewind()
        if reason:
            raise first_bad_step.left_lattice(before, found % count, reason, **self._next_step(dt))
        if lost >= 0:
            raise first_bad_step.unsolved_orbit(before, lost % count, **self._next_step(dt))
        singular = any(force.softening == 0.0 for force in phase.total_force.pair_forces)
        raise first_bad_step.diagnose(before, found % count, **self._next_step(dt), pairs_singular=singular)

    def _next_step(self, dt: float) -> dict[str, Any]:
        """Number of the next step, and the time at its end."""
        return {"step": self._clock.step_count + 1, "time": self._clock.time + dt}
