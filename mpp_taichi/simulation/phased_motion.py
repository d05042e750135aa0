"""Phased motion: a motion that goes through the phases of a scene, has parameters set on the way, and can go back."""

import copy
import logging
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from mpp_taichi.contacts._base import ContactReport
from mpp_taichi.device import backends
from mpp_taichi.device.backends import Device
from mpp_taichi.errors import MppError
from mpp_taichi.scene import sliders
from mpp_taichi.scene.load import change_scene
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.simulation.first_bad_step import Mark
from mpp_taichi.simulation.motion import Motion
from mpp_taichi.simulation.phases import CompiledPhase, Course, Phase, phase_at, phases_of
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.solvers.report import SolverReport
from mpp_taichi.stability import StepAdvice, StepGuard

if TYPE_CHECKING:
    from mpp_taichi.energy.energy_meter import PowerMeter

log = logging.getLogger(__name__)


@dataclass(frozen=True, eq=False)
class Bookmark:
    """A moment of a motion to go back to: the state, its phase, and the accounts that were kept."""

    mark: Mark
    course: Course
    compiled: CompiledPhase
    number: int
    work: tuple[float, ...]
    energy: float | None
    reports: tuple[SolverReport, ContactReport]
    balance: dict[str, Any]

    @property
    def bytes(self) -> int:
        """Memory of the host that it takes, roughly."""
        return sum(each.nbytes for each in self.mark.saved[0])


class PhasedMotion(Motion):
    """The phases of a scene, one after the other; what changes between them, or is set, compiles what is new, if anything is.

    `scene`, `phases` and `first_phase` are those of the present course, which `set` changes; `phase_number` is the present one.
    """

    def __init__(
        self,
        course: Course,
        device: Device,
        *,
        plan: str,
        replica_starts: Sequence[Snapshot],
        force: bool,
        event_log: bool,
    ) -> None:
        """Allocate and fill the fields of the first phase."""
        super().__init__(device)
        self._plan_asked, self.replica_starts, self._force = plan, tuple(replica_starts), force
        self._event_log = event_log
        self._course = self._first_course = course
        self._compiled: dict[object, CompiledPhase] = {}
        self.phase_number = -1
        self.phase_work: list[float] = []
        self.phase_energy: float | None = None
        self.when_phase_begins: list[Callable[[Any], None]] = []
        self.restart()

    @property
    def scene(self) -> SceneSpec:
        """The whole scene, with its timeline and all that was set."""
        return self._course.scene

    @property
    def phases(self) -> tuple[Phase, ...]:
        """Its phases; those before the first one were never run."""
        return self._course.phases

    @property
    def first_phase(self) -> int:
        """Number of the phase that the motion begins in."""
        return self._course.first

    @property
    def start(self) -> Snapshot:
        """The state the simulation began with, before rounding to the run's precision."""
        return self._course.start

    def _enter(self, number: int) -> None:
        """Make a phase the present one; what it needs is imported and allocated when it is entered for the first time."""
        phase = self.phases[number]
        if phase.kernels not in self._compiled:
            self._compiled[phase.kernels] = CompiledPhase(
                phase, self.device, plan=self._plan_asked, replica_starts=self.replica_starts, event_log=self._event_log
            )
        self._compiled[phase.kernels].adopt(phase)
        self.phase_number = number
        self._adopt(phase, self._compiled[phase.kernels])

    # --- time -----------------------------------------------------------------------------------------------------------

    def restart(self) -> None:
        """Go back to the start."""
        self._require_life()
        if self.phase_number != self.first_phase:
            self._enter(self.first_phase)
            self._guard_step(self.start)
        self.phase_work.clear()
        self.phase_energy = None
        self._set_clock(self.start.time, self.start.step)
        if self.replica_starts:
            position = np.concatenate([start.position for start in self.replica_starts])
            velocity = np.concatenate([start.velocity * start.free for start in self.replica_starts])
            self._write(position, velocity)
        else:
            if self.state.merges:
                self.state.write_spheres(self.start)
            self._write(self.start.position, self.start.velocity * self.start.free)
        self.solver_report, self.contact_report = SolverReport(), ContactReport()
        if self.energy_balance is not None:
            self.energy_balance.restart()

    def begin_anew(self) -> None:
        """Go back to the start as the scene says it; what was set is forgotten, but for where its sliders are."""
        self._require_life()
        present = {each.path: sliders.value_of(self.spec, each.targets[0]) for each in self.spec.sliders}
        self._course, self.phase_number = self._first_course, -1
        self.restart()
        first = {each.path: sliders.value_of(self.spec, each.targets[0]) for each in self.spec.sliders}
        changed = {path: value for path, value in present.items() if path in first and value != first[path]}
        if changed:
            self.set(changed)

    @property
    def time_to_next_phase(self) -> float:
        """Simulated time until the timeline changes something; infinite where it does not any more."""
        following = self.phases[self.phase_number + 1 : self.phase_number + 2]
        return max(0.0, following[0].at - self.time) if following else math.inf

    def _begin_phase(self, number: int) -> None:
        """Go on with the next phase from exactly its time: positions and velocities are carried over bit for bit.

        An axis that is held from now on stops. What the change does to the energy is work from outside, kept in `phase_work`;
        `phase_energy` is the energy it leaves.
        """
        before = self._total_energy()
        step, earlier = self.step_count, self.state
        again = self.phase_work.pop() if number == self.phase_number else 0.0  # set once more at the same time
        phase = self.phases[number]
        with self.parameter_change():
            self._enter(number)
            self._set_clock(phase.at, step)
            if self.state is not earlier:
                self.state.take_over(earlier, phase.particles.free)
            self.integrator.adopt(self.state, self.dt)
            self._start_afresh()
        if not self._guard.knows(self.spec, phase.particles.springs, self.integrator):
            self._guard_step(self.snapshot())
        self.phase_energy = self._total_energy()
        self.phase_work.append(again + self.phase_energy - before)
        changed = ", ".join(phase.changes)
        log.info("time %.9g: %s changed, and the energy by %.6g", phase.at, changed, self.phase_work[-1])
        for observe in self.when_phase_begins:
            observe(self)

    # --- what is set ----------------------------------------------------------------------------------------------------

    def set(self, changes: str | Mapping[str, Any], value: Any = None) -> None:
        """Change parameters from now on: a path and its value, or a mapping of several, as `timeline:` takes them.

        Positions, velocities and the time stay, bit for bit. What the scene's `sliders:` move within their ranges is a number
        that kernels load: nothing is compiled, and the next step is with it. Anything else that a timeline may change is
        compiled anew, as numbers are part of the kernels: forces, springs, walls, contacts, the integrator and its step,
        constants, and of particles all but their places; at time 0 all of the scene. A step that springs do not allow any more
        is refused by `run`. The change becomes an event of `scene`, so that `restart`, or a Simulation of `scene`, goes through
        it again, bit for bit.

        Raises:
            MppError: there is no such parameter, or it cannot be what it is set to; nothing has changed then.
        """
        self._require_life()
        given = {changes: value} if isinstance(changes, str) else dict(changes)
        at_start = self.step_count == self.start.step
        moved = sliders.moved_to(self.spec, given)
        if moved is not None:
            self._follow(
                self._course.moved(self.phase_number, self.time, moved),
                frozenset(phase.kernels for phase in self.phases),
                at_start,
            )
            return
        scene = change_scene(self.scene, self.time, given)
        phases = phases_of(scene)
        number = phase_at(phases, self.time)
        if at_start:
            own = self.start is self.phases[self.first_phase].particles
            start = phases[number].particles if own else self.start.continuing(phases[number].particles)
            self._follow((Course(scene, phases, number, start), number), frozenset(), at_start)
        else:
            phases = (*self.phases[:number], *phases[number:])
            kept = frozenset(phase.kernels for phase in self.phases[:number])
            self._follow((Course(scene, phases, self.first_phase, self.start), number), kept, at_start)

    def _follow(self, changed: tuple[Course, int], kept: frozenset[object], at_start: bool) -> None:
        """Go on along another course in a phase of it; what was compiled and is not `kept` is given back.

        Where that fails nothing has changed.
        """
        before, work, present = self._course, list(self.phase_work), self.phase_number
        compiled = dict(self._compiled)
        self._course, number = changed
        self._compiled = {kernels: each for kernels, each in compiled.items() if kernels in kept}
        try:
            if at_start:
                self._enter(number)
                self._guard_step(self.start)
                if self.energy_balance is not None:
                    self.energy_balance.meter = self._power_meter()
                self.restart()
            else:
                self._begin_phase(number)
        except MppError:
            self._course, self._compiled, self.phase_number = before, compiled, present
            self.phase_work[:] = work
            raise
        for kernels, each in compiled.items():
            if kernels not in kept:
                each.destroy()

    def _total_energy(self) -> float:
        return float(self.mechanics()["total_energy"])

    def _power_meter(self) -> "PowerMeter":
        from mpp_taichi.energy.energy_meter import PowerMeter

        # A serial launch whose loops a device limits has no room for more of them.
        in_kernel = self.plan == "serial" and self.contacts is None and self.device.probes.loop_limit is None
        return PowerMeter(self.state, self.total_force, in_kernel=in_kernel)

    @contextmanager
    def parameter_change(self) -> Iterator[None]:
        """A block in which parameters, fields or forces are replaced between two steps.

        An energy balance books what that does to the energy as work.
        """
        self._require_life()
        balance = self.energy_balance
        with balance.parameter_change(self) if balance is not None else nullcontext():
            yield
            if balance is not None and not balance.meter.looks_at(self.state, self.total_force):
                balance.meter = self._power_meter()

    # --- back -----------------------------------------------------------------------------------------------------------

    def bookmark(self) -> Bookmark:
        """This moment, to `go_back` to; it is good as long as what it was compiled to is there."""
        self._require_life()
        balance = {} if self.energy_balance is None else self.energy_balance.copied()
        reports = copy.copy(self.solver_report), copy.copy(self.contact_report)
        compiled = self._compiled[self.phases[self.phase_number].kernels]
        return Bookmark(
            *(self.mark(), self._course, compiled, self.phase_number),
            *(tuple(self.phase_work), self.phase_energy, reports, balance),
        )

    def go_back(self, bookmark: Bookmark) -> None:
        """Go back to a moment, bit for bit, with the parameters of then; what was set since is forgotten.

        Raises:
            MppError: parameters were set since that replaced the kernels of that moment.
        """
        self._require_life()
        if self._compiled.get(bookmark.course.phases[bookmark.number].kernels) is not bookmark.compiled:
            raise MppError("what was set since has replaced the kernels of that moment")
        again = bookmark.number != self.phase_number or bookmark.course is not self._course
        self._course = bookmark.course
        if again:
            self._enter(bookmark.number)
        self.return_to(bookmark.mark)
        if again:
            self._guard_step(self.start if bookmark.number == self.first_phase else self.snapshot())
        self.phase_work[:], self.phase_energy = bookmark.work, bookmark.energy
        self.solver_report, self.contact_report = copy.copy(bookmark.reports[0]), copy.copy(bookmark.reports[1])
        if self.energy_balance is not None:
            self.energy_balance.go_back(bookmark.balance)
            if not self.energy_balance.meter.looks_at(self.state, self.total_force):
                self.energy_balance.meter = self._power_meter()

    # --- stability ------------------------------------------------------------------------------------------------------

    @property
    def step_advice(self) -> StepAdvice | None:
        """How large a step springs and drag allow the particles as they were when the phase began; None for any step."""
        return self._guard.advice(self.dt)

    def _guard_step(self, particles: Snapshot) -> None:
        """Judge steps by these springs from now on."""
        self._guard = StepGuard(self.spec, particles, self.integrator, force=self._force)

    def check_step(self, steps: int | None = None) -> None:
        """Warn of a step near its limit, and refuse one beyond it unless this simulation was made with `force`.

        `steps` is the length of the run, for methods whose oscillations grow whatever the step is. Done once for each dt.

        Raises:
            StabilityError: the step cannot hold.
        """
        self._guard.check(self.dt, steps)

    # --- end ------------------------------------------------------------------------------------------------------------

    def close(self) -> None:
        """Give the device memory back."""
        if not self._closed and backends.is_alive(self.device):
            for compiled in self._compiled.values():
                compiled.destroy()
            backends.release(self.device)
        self._closed = True
