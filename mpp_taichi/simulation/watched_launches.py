"""Watched launches: steps launched on the device, and the state that each launch leaves judged before the run goes on."""

import time
from dataclasses import dataclass
from typing import Any

from mpp_taichi.integrators._trouble import Trouble
from mpp_taichi.scene.formulas.program import points_of
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
    """The parts of the time of a run, in seconds of the wall clock, and the number of launches of steps.

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
        phase.prepare(self._clock)
        origin, first = self._clock.origin_of(steps, dt)
        if meter is None:
            phase.launcher.advance(origin, dt, first, first + steps)
        else:
            phase.launcher.advance_metered(origin, dt, first, first + steps, meter)
        self.timings.launch_count += 1

    def try_steps(self, phase: CompiledPhase, steps: int, dt: float, *, judged: bool = True) -> bool:
        """Go on without accounts; False where the run could not go on from there, if this is judged."""
        while steps > 0:
            count = min(steps, phase.launch_limit)
            self.launch(phase, count, dt)
            self._clock.move(count, dt)
            steps -= count
        if not judged:
            return True
        phase.launcher.collect()
        return phase.launcher.trouble() is None

    def advance(self, phase: CompiledPhase, steps: int, dt: float) -> None:
        """Make one launch, time it, and judge the state that it leaves.

        Raises:
            StabilityError: the run cannot go on; the last good state stands.
        """
        saved, balance = phase.save(whole=False), self._accounts.energy_balance
        began = time.perf_counter()
        self.launch(phase, steps, dt, None if balance is None else balance.meter)
        report = phase.launcher.collect()
        trouble = phase.launcher.trouble()  # waits for the device
        seconds = time.perf_counter() - began
        if trouble is not None and trouble.is_located:
            self._give_up(phase, saved, trouble, report, dt)
        if report is not None:
            self._accounts.solver_report.add(report)
        if phase.contacts is not None:
            self._count_contacts(phase, saved)
        if trouble is not None:
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

    def _give_up(
        self, phase: CompiledPhase, saved: SavedFields, trouble: Trouble, report: SolverReport | None, dt: float
    ) -> None:
        """Go back to the last step that the method could take, and name the step that it could not take."""
        particle = trouble.particle % phase.state.particle_count
        if trouble.kind == "stalled":
            now = phase.snapshot(self._clock)
            raise first_bad_step.stalled(now, particle, step=self._clock.step_count, time=trouble.time)
        phase.restore(saved)
        if trouble.steps:
            self.launch(phase, trouble.steps, dt)
            phase.launcher.collect()
        self._clock.move(trouble.steps, dt)
        if report is not None:
            self._accounts.solver_report.add(report)
        if trouble.kind == "bent":
            raise first_bad_step.bent_rod(phase.snapshot(self._clock), trouble, **self._next_step(dt))
        raise first_bad_step.unsolved(phase.snapshot(self._clock), particle, dt=dt, **self._next_step(dt))

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
            return phase.launcher.first_bad_particle() < 0

        def keep() -> None:
            stored[0] = phase.save(whole=False)

        def rewind() -> None:
            phase.restore(stored[0])

        bad_step = first_bad_step.first_bad_step(steps, advance, keep, rewind)
        self._clock.move(bad_step - 1, dt)
        before = phase.snapshot(self._clock)
        self.launch(phase, 1, dt)
        phase.launcher.collect()
        trouble = phase.launcher.trouble()
        assert trouble is not None
        rewind()
        particle = trouble.particle % phase.state.particle_count
        singular = any(force.softening == 0.0 for force in phase.total_force.pair_forces)
        laws = [entry.law for entry in phase.spec.forces if entry.law is not None]
        ends = [function.told for law in laws for function in points_of(law) if not function.repeats]
        raise first_bad_step.explained(
            before, trouble, particle, **self._next_step(dt), pairs_singular=singular, ends="; ".join(dict.fromkeys(ends))
        )

    def _next_step(self, dt: float) -> dict[str, Any]:
        """Number of the next step, and the time at its end."""
        return {"step": self._clock.step_count + 1, "time": self._clock.time + dt}
