"""Simulation: time, step count, the order of operations, and the execution plan."""

import logging
import math
import time as clock
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from mpp_taichi import backends, plans
from mpp_taichi.contacts._base import ContactReport
from mpp_taichi.errors import MppError, SceneError
from mpp_taichi.motion import Motion
from mpp_taichi.phases import CompiledPhase, phase_at, phases_of
from mpp_taichi.scene.estimate import check_capacity, estimate
from mpp_taichi.scene.load import change_scene, load_scene
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.scene.timeline import whole_steps
from mpp_taichi.shown import Shown
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.solvers.report import SolverReport
from mpp_taichi.stability import StepAdvice, StepGuard
from mpp_taichi.walls._base import Surface

if TYPE_CHECKING:
    from mpp_taichi.energy import PowerMeter
    from mpp_taichi.energy_balance import EnergyBalance

log = logging.getLogger(__name__)

GPU_WORTH_WORK = 4_000_000  # work per step (see plans) from which `auto` looks for a GPU


class Recorder(Protocol):
    """Something that wants to see the simulation now and then."""

    def steps_until_due(self, simulation: "Simulation") -> int:
        """How many steps may pass before the next look; 0 means now."""

    def record(self, simulation: "Simulation") -> None:
        """Look."""


class Simulation(Motion, Shown):
    """A scene, compiled to one step and run on one device; with a timeline, to one step for each phase.

    What depends on the phase (`spec`, `dt`, `integrator`, `total_force`, `state`, …) is that of the present one, `phase_number`
    in `phases`; `scene` is the whole, with its timeline and all that was set.

    `scene` is a path, a mapping of the shape of the YAML, or a SceneSpec; `overrides` are those of `--set`. `replica_starts`
    holds the starting snapshots of independent copies of the scene that run side by side, one thread each. `start` is a state
    of the same particles to go on from instead of the scene's own, with its time and step count. `force` runs a step that is
    beyond what the springs allow, `event_log` lets event-driven contacts note every collision. Raises SceneError, BackendError
    or CapacityError before anything is allocated, StabilityError when it is run.
    """

    def __init__(
        self,
        scene: str | Path | Mapping[str, Any] | SceneSpec,
        *,
        backend: str = "auto",
        precision: str | None = None,
        plan: str = "auto",
        overrides: Mapping[str, Any] | Sequence[str] = (),
        replica_starts: Sequence[Snapshot] = (),
        threads: int | None = None,
        start: Snapshot | None = None,
        force: bool = False,
        event_log: bool = False,
    ):
        """Read the scene, start the backend, allocate and fill the fields; kernels are compiled at the first step."""
        began = clock.perf_counter()
        self.scene = load_scene(scene, overrides=overrides)
        if self.scene.accuracy is not None:
            raise SceneError(
                f"{self.scene.source}: accuracy: what reaches it is still to be chosen, by mpp_taichi.settle or the run verb"
            )
        self.estimate = estimate(self.scene)
        check_capacity(self.estimate)
        self.phases = phases_of(self.scene)
        self.first_phase = phase_at(self.phases, 0.0 if start is None else start.time)
        made = self.phases[self.first_phase].particles
        self._start = made if start is None else start.continuing(made)
        work = max(
            plans.step_work(each.spec, each.particles.particle_count, len(each.particles.springs)) for each in self.phases
        )
        large = work >= GPU_WORTH_WORK and all(phase.spec.contacts is None for phase in self.phases)  # no GPU has run them yet
        super().__init__(backends.start(backend, precision, large=large, threads=threads))
        self._plan_asked, self.replica_starts, self._force = plan, tuple(replica_starts), force
        self._event_log = event_log
        self._compiled: dict[int, CompiledPhase] = {}
        self.phase_number = -1
        self.phase_work: list[float] = []
        self.when_phase_begins: list[Callable[[Simulation], None]] = []
        self.restart()
        self.setup_seconds = clock.perf_counter() - began

    def _enter(self, number: int) -> None:
        """Make a phase the present one; what it needs is imported and allocated when it is entered for the first time."""
        if number not in self._compiled:
            starts = self.replica_starts
            self._compiled[number] = CompiledPhase(
                self.phases[number],
                self.device,
                plan=self._plan_asked,
                replica_starts=starts,
                event_log=self._event_log,
            )
        self.phase_number = number
        self._adopt(self.phases[number], self._compiled[number])

    # --- time -----------------------------------------------------------------------------------------------------------

    def restart(self) -> None:
        """Go back to the start."""
        self._require_life()
        if self.phase_number != self.first_phase:
            self._enter(self.first_phase)
            self._guard_step(self._start)
        self.phase_work.clear()
        self.phase_energy: float | None = None
        self._set_clock(self._start.time, self._start.step)
        if self.replica_starts:
            position = np.concatenate([start.position for start in self.replica_starts])
            velocity = np.concatenate([start.velocity * start.free for start in self.replica_starts])
            self._write(position, velocity)
        else:
            if self.state.merges:
                self.state.write_spheres(self._start)
            self._write(self._start.position, self._start.velocity * self._start.free)
        self.solver_report, self.contact_report = SolverReport(), ContactReport()
        if self.energy_balance is not None:
            self.energy_balance.restart()

    def run(
        self,
        duration: float | None = None,
        *,
        until: float | None = None,
        steps: int | None = None,
        recorders: Sequence[Recorder] = (),
    ) -> "Simulation":
        """Advance by `duration`, `until` a time, or by `steps`; without any of them as the scene's `run:` says.

        A loop of: ask the recorders when they are due, step that far at most, check that every number is finite, let the
        recorders look. If the end is no whole number of steps away, one shorter step reaches it exactly. The end of a phase is
        reached in the same way, and the next one begins there and then. A step beyond what the springs allow is refused with
        a StabilityError, see `check_step`.
        """
        self._require_life()
        span, left = self._plan_run(duration, until, steps)
        self._check_leg(span, left)
        if self.energy_balance is not None:
            self.energy_balance.look(self)
        self._notify(recorders)
        while True:
            ahead = self.time_to_next_phase
            whole, rest, ends_early = self._leg(span, left)
            self._step(int(whole), rest, recorders)
            if ends_early or span < ahead or ahead == math.inf:
                return self
            span, left = span - ahead, left - whole - (rest > 0.0)
            self._begin_phase(self.phase_number + 1)
            self._check_leg(span, left)
            self._notify(recorders)

    def look_at_multiples_of(self, interval: float) -> None:
        """Where contacts fly and a step is a mere look: let looks fall on multiples of `interval`, no rarer than so far."""
        if self.contacts is not None and self.contacts.flies:
            self.dt = interval / math.ceil(interval / self.dt)

    def _leg(self, span: float, left: float) -> tuple[float, float, bool]:
        """Whole steps to the end of the phase or the run, the length of a last, shorter one, and whether `left` comes first."""
        leg = min(span, self.time_to_next_phase)
        whole, rest = whole_steps(leg, self.dt) if leg < math.inf else (left, 0.0)
        return (left, 0.0, True) if left < whole + (rest > 0.0) else (whole, rest, False)

    def _check_leg(self, span: float, left: float) -> None:
        whole, rest, _ = self._leg(span, left)
        if whole or rest:
            self.check_step(int(whole) + (rest > 0.0))

    def _step(self, whole: int, rest: float, recorders: Sequence[Recorder]) -> None:
        """So many steps, and one of the length `rest` unless that is 0."""
        last = self.step_count + whole
        while self.step_count < last:
            due = min([recorder.steps_until_due(self) for recorder in recorders], default=last)
            self._advance(max(1, min(due, last - self.step_count, self._longest_launch())), self.dt)
            self._notify(recorders)
        if rest > 0.0:
            self._advance(1, rest)
            self._notify(recorders)

    def _plan_run(self, duration: float | None, until: float | None, steps: int | None) -> tuple[float, float]:
        """How much time and how many steps a run may take; one of them is infinite."""
        if sum(argument is not None for argument in (duration, until, steps)) > 1:
            raise MppError("run takes one of duration, until and steps")
        if duration is None and until is None and steps is None:
            duration, steps = self.spec.run.duration, self.spec.run.steps
            if duration is None and steps is None:
                raise MppError("the scene has no run.duration, so say how long: duration, until or steps")
        if steps is not None:
            if steps < 0:
                raise MppError(f"steps must not be negative, got {steps}")
            return math.inf, steps
        span = float(duration) if duration is not None else float(until or 0.0) - self.time
        if not math.isfinite(span) or span < 0.0:
            raise MppError(f"cannot run for a time of {span}")
        return span, math.inf

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
            self.state.take_over(earlier, phase.particles.free)
            self.integrator.adopt(self.state)
            self._start_afresh()
        self._guard_step(self.snapshot())
        self.phase_energy = self._total_energy()
        self.phase_work.append(again + self.phase_energy - before)
        changed = ", ".join(phase.changes)
        log.info("time %.9g: %s changed, and the energy by %.6g", phase.at, changed, self.phase_work[-1])
        for observe in self.when_phase_begins:
            observe(self)

    def set(self, changes: str | Mapping[str, Any], value: Any = None) -> None:
        """Change parameters from now on: a path and its value, or a mapping of several, as `timeline:` takes them.

        Positions, velocities and the time stay, bit for bit. What may change is what a timeline may: forces, springs, walls,
        contacts, the integrator and its step, constants, and of particles all but their places; at time 0 all of the scene.
        The step is compiled anew, as numbers are part of it. A step that springs do not allow any more is refused by `run`.
        The change becomes an event of `scene`, so that `restart`, or a Simulation of `scene`, goes through it again.

        Raises:
            MppError: there is no such parameter, or it cannot be what it is set to; nothing has changed then.
        """
        self._require_life()
        scene = change_scene(self.scene, self.time, {changes: value} if isinstance(changes, str) else changes)
        phases, work = phases_of(scene), list(self.phase_work)
        before = self.scene, self.phases, self._start, self.first_phase, self._compiled
        number, at_start = phase_at(phases, self.time), self.step_count == self._start.step
        kept = {} if at_start else {old: each for old, each in self._compiled.items() if old < number}
        if at_start:
            own = self._start is self.phases[self.first_phase].particles
            self._start = phases[number].particles if own else self._start.continuing(phases[number].particles)
            self.first_phase = number
        self.scene, self._compiled = scene, dict(kept)
        self.phases = phases if at_start else (*self.phases[:number], *phases[number:])
        try:
            self._begin_again(number) if at_start else self._begin_phase(number)
        except MppError:
            self.scene, self.phases, self._start, self.first_phase, self._compiled = before
            self.phase_work[:] = work
            raise
        for old, compiled in before[-1].items():
            if old not in kept:
                compiled.destroy()

    def _begin_again(self, number: int) -> None:
        """Start with a phase that was not there before."""
        self._enter(number)
        self._guard_step(self._start)
        if self.energy_balance is not None:
            self.energy_balance.meter = self._power_meter()
        self.restart()

    def _total_energy(self) -> float:
        return float(self.diagnostics()["total_energy"])

    def _notify(self, recorders: Sequence[Recorder]) -> None:
        for recorder in recorders:
            if recorder.steps_until_due(self) <= 0:
                recorder.record(self)

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

    # --- looking --------------------------------------------------------------------------------------------------------

    @property
    def start(self) -> Snapshot:
        """The state the simulation began with, before rounding to the run's precision."""
        return self._start

    @property
    def surfaces(self) -> tuple[Surface, ...]:
        """The walls' surfaces of the present phase, in the order of ContactReport.wall_impulse."""
        return () if self.contacts is None else self.contacts.setup.enclosure.surfaces

    def diagnostics(self) -> dict[str, Any]:
        """Energies, momentum, angular momentum and centre of mass now; see `energy.mechanics`.

        With an energy balance also dissipated_energy, work, energy_balance_residual and energy_turnover.
        """
        found = self.mechanics()
        if self.energy_balance is not None:
            found |= self.energy_balance.account(self, found["total_energy"])
        return found

    def keep_energy_balance(self) -> "EnergyBalance":
        """From now on keep account of dissipated energy and work, step by step."""
        from mpp_taichi.energy_balance import EnergyBalance

        self._require_life()
        self.energy_balance = EnergyBalance(self._power_meter())
        return self.energy_balance

    def _power_meter(self) -> "PowerMeter":
        from mpp_taichi.energy import PowerMeter

        # A serial launch whose loops a device limits has no room for more of them.
        in_kernel = self.plan == "serial" and self.contacts is None and self.device.probes.loop_limit is None
        return PowerMeter(self.state, self.total_force, in_kernel=in_kernel)

    @contextmanager
    def parameter_change(self) -> Iterator[None]:
        """A block in which parameters, fields or forces are replaced between two steps.

        An energy balance books what that does to the energy as work.
        """
        balance = self.energy_balance
        with balance.parameter_change(self) if balance is not None else nullcontext():
            yield
            if balance is not None and not balance.meter.looks_at(self.state, self.total_force):
                balance.meter = self._power_meter()

    # --- end ------------------------------------------------------------------------------------------------------------

    def close(self) -> None:
        """Give the device memory back."""
        if not self._closed and backends.is_alive(self.device):
            for compiled in self._compiled.values():
                compiled.destroy()
            backends.release(self.device)
        self._closed = True

    def __enter__(self) -> "Simulation":
        """Use as a context manager."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close at the end of the block."""
        self.close()
