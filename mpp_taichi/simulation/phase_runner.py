"""Phase runner: the present phase of a run, the changes that lead from one phase to another, and the way back."""

import logging
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from mpp_taichi.contacts._base import ContactReport
from mpp_taichi.errors import MppError
from mpp_taichi.scene import sliders
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.simulation.accounts import Accounts, SavedAccounts
from mpp_taichi.simulation.clock import Clock
from mpp_taichi.simulation.compiled_phase import CompiledPhase
from mpp_taichi.simulation.compiled_phases import CompiledPhases
from mpp_taichi.simulation.course import Course
from mpp_taichi.simulation.saved_state import Bookmark, Mark
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.stability import StepGuard

if TYPE_CHECKING:
    from mpp_taichi.energy.energy_meter import EnergyMeter

log = logging.getLogger(__name__)


class PhaseRunner:
    """Holds the present phase of a course, and enters another one where the timeline or a change of parameters says so.

    phase    the compiled phase that is present, phase `number` of the `course`
    guard    judges the length of the step by the springs of the phase; with `force` it only warns
    """

    def __init__(self, course: Course, compiled: CompiledPhases, clock: Clock, accounts: Accounts, *, force: bool) -> None:
        """Enter the phase in which the course begins, at its start."""
        self.course = self._first_course = course
        self.compiled, self.clock, self.accounts, self._force = compiled, clock, accounts, force
        self.number = -1
        self.when_phase_begins: list[Callable[[], None]] = []
        self.restart()

    @property
    def time_to_next_phase(self) -> float:
        """Simulated time until the timeline changes something; infinite in the last phase."""
        return max(0.0, self.next_phase_at - self.clock.time)

    @property
    def next_phase_at(self) -> float:
        """Simulated time at which the timeline changes something; infinite in the last phase."""
        following = self.course.phases[self.number + 1 : self.number + 2]
        return following[0].at if following else math.inf

    def enter(self, number: int) -> None:
        """Make a phase the present one, with the step of its scene; it is compiled if no phase of the same kernels was."""
        self.phase: CompiledPhase = self.compiled.of(self.course.phases[number])
        self.number, self.clock.dt = number, self.course.phases[number].dt

    def restart(self) -> None:
        """Go back to the start of the course."""
        start = self.course.start
        if self.number != self.course.first:
            self.enter(self.course.first)
            self._guard_step(start)
        self.clock.set(start.time, start.step)
        self.phase.place(start, self.clock.dt)
        self.accounts.restart()

    def place_replicas(self, starts: tuple[Snapshot, ...], scenes: Sequence[SceneSpec]) -> None:
        """Go back to the start of the course, each replica to a start of its own, with the parameters of its own scene.

        A run of one copy goes to the places and velocities of one start, with the restitutions of its scene where its contact
        solver can, and with all other numbers as they are.
        """
        if not self.phase.replica_starts:
            (start,), before = starts, self.course.start
            moved = before.moved(position=start.position, velocity=start.velocity, time=before.time, step=before.step)
            self.course = replace(self.course, start=moved)
            self.phase.take_restitution(scenes[0])
            self.restart()
            return
        self.phase.replica_starts = starts
        self.phase.live.write_rows([scene.forces for scene in scenes for _ in range(self.phase.copies)])
        self.restart()

    def restart_as_written(self) -> None:
        """Go back to the start and forget all changes of parameters; only the sliders keep their positions."""
        present = self._slider_values()
        self.course, self.number = self._first_course, -1
        self.restart()
        first = self._slider_values()
        if changed := {path: value for path, value in present.items() if path in first and value != first[path]}:
            self.change(changed)

    def _slider_values(self) -> dict[str, Any]:
        spec = self.phase.spec
        return {each.path: sliders.value_of(spec, each.targets[0]) for each in spec.sliders}

    def _guard_step(self, particles: Snapshot) -> None:
        """Judge steps by the springs of these particles from now on."""
        self.guard = StepGuard(self.phase.spec, particles, self.phase.integrator, force=self._force)

    # Changes of the scene

    def change(self, given: Mapping[str, Any]) -> None:
        """Change parameters from now on, path → value.

        Raises:
            MppError: a parameter does not exist or cannot have the value; nothing has changed then.
        """
        at_start = self.clock.step_count == self.course.start.step
        course, number = self.course.changed(self.number, self.clock.time, given, at_start=at_start)
        before, work = (self.course, self.number), list(self.accounts.phase_work)
        compiled = self.compiled.set_aside(course.phases)
        self.course = course
        try:
            if at_start:
                self.enter(number)
                self._guard_step(course.start)
                self.accounts.measure(self.phase)
                self.restart()
            else:
                self.begin(number)
        except MppError:
            self.compiled.put_back(compiled)
            self.course, self.number = before
            self.accounts.phase_work[:] = work
            raise
        self.compiled.drop(compiled)

    def begin(self, number: int) -> None:
        """Go on with a phase at exactly the time at which it begins; positions and velocities are carried over bit for bit.

        The energy that the change puts in is booked in the accounts, as work from outside.
        """
        before, step, earlier, work = self._total_energy(), self.clock.step_count, self.phase, self.accounts.phase_work
        again = work.pop() if number == self.number else 0.0  # a second change at the same time
        begun = self.course.phases[number]
        with self.parameter_change():
            self.enter(number)
            self.clock.set(begun.at, step)
            self.phase.take_over(earlier, self.clock.dt, step)
        if not self.guard.knows(begun.spec, begun.particles.springs, self.phase.integrator):
            self._guard_step(self.phase.snapshot(self.clock))
        after = self.accounts.phase_energy = self._total_energy()
        work.append(again + after - before)
        log.info("time %.9g: %s changed, and the energy by %.6g", begun.at, ", ".join(begun.changes), work[-1])
        for observe in self.when_phase_begins:
            observe()

    def _total_energy(self) -> float:
        return float(self.mechanics()["total_energy"])

    @contextmanager
    def parameter_change(self) -> Iterator[None]:
        """A block in which parameters, fields or forces are replaced between two steps; an energy balance books the work."""
        balance = self.accounts.energy_balance
        with balance.parameter_change(self) if balance is not None else nullcontext():
            yield
            self.accounts.measure(self.phase)

    # Steps backwards

    def mark(self, *, whole: bool = True) -> Mark:
        """The state and its time, to `return_to` within the phase; `whole`: see `CompiledPhase.save`."""
        return Mark(self.phase.save(whole=whole), self.clock.save())

    def return_to(self, mark: Mark) -> None:
        """Go back to a mark, bit for bit."""
        self.clock.restore(mark.clock)
        self.phase.restore(mark.fields)

    def bookmark(self) -> Bookmark:
        """The state, its time, its phase and the accounts, to `go_back` to."""
        return Bookmark(self.mark(), self.course, self.phase, self.number, self.accounts.save())

    def go_back(self, bookmark: Bookmark) -> None:
        """Go back to a bookmark, bit for bit.

        Raises:
            MppError: a change of parameters has replaced the kernels of its phase.
        """
        if not self.compiled.holds(bookmark.course.phases[bookmark.number], bookmark.compiled):
            raise MppError("what was set since has replaced the kernels of that moment")
        again = bookmark.number != self.number or bookmark.course is not self.course
        self.course = bookmark.course
        self.go_to(bookmark.number, bookmark.mark, bookmark.accounts, again=again)

    def go_to(self, number: int, mark: Mark, accounts: SavedAccounts, *, again: bool) -> None:
        """Go to a moment of the course, bit for bit; `again` where its phase is to be entered."""
        if again:
            self.enter(number)
        self.return_to(mark)
        if again:
            at_start = number == self.course.first
            self._guard_step(self.course.start if at_start else self.phase.snapshot(self.clock))
        self.accounts.restore(accounts)
        self.accounts.measure(self.phase)

    # Members that the energy balance reads

    @property
    def time(self) -> float:
        """Simulated time."""
        return self.clock.time

    @property
    def step_count(self) -> int:
        """Steps taken since the start."""
        return self.clock.step_count

    @property
    def energy_meter(self) -> "EnergyMeter":
        """The meter of the present forces."""
        return self.phase.energy_meter

    @property
    def contact_report(self) -> ContactReport:
        """Counts of the contacts so far."""
        return self.accounts.contact_report

    def mechanics(self) -> dict[str, Any]:
        """Energies, momentum, angular momentum and centre of mass now; see `energy.mechanics`."""
        return self.phase.energy_meter.mechanics(self.phase.snapshot(self.clock), self.clock.time)
