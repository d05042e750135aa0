"""Simulation: time, step count, the order of operations, and the execution plan."""

import logging
import math
import time as clock
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from mpp_taichi import backends, plans, postmortem
from mpp_taichi.errors import MppError
from mpp_taichi.phases import CompiledPhase, phase_at, phases_of
from mpp_taichi.scene.estimate import check_capacity, estimate
from mpp_taichi.scene.load import load_scene
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.scene.timeline import whole_steps
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.solvers.report import SolverReport

if TYPE_CHECKING:
    from mpp_taichi.energy import PowerMeter
    from mpp_taichi.energy_balance import EnergyBalance

log = logging.getLogger(__name__)

LAUNCH_SECONDS = 0.1  # aim for one launch: short enough to interrupt, long enough not to matter
GPU_WORTH_WORK = 4_000_000  # work per step (see plans) from which `auto` looks for a GPU


class Recorder(Protocol):
    """Something that wants to see the simulation now and then."""

    def steps_until_due(self, simulation: "Simulation") -> int:
        """How many steps may pass before the next look; 0 means now."""

    def record(self, simulation: "Simulation") -> None:
        """Look."""


class Simulation:
    """A scene, compiled to one step and run on one device; with a timeline, to one step for each phase.

    What depends on the phase (`spec`, `dt`, `integrator`, `total_force`, `state`, …) is that of the present one, `phase_number`
    in `phases`.

    `scene` is a path, a mapping of the shape of the YAML, or a SceneSpec; `overrides` are those of `--set`. `replica_starts`
    holds the starting snapshots of independent copies of the scene that run side by side, one thread each. Raises SceneError,
    BackendError or CapacityError before anything is allocated, StabilityError while running.
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
    ):
        """Read the scene, start the backend, allocate and fill the fields; kernels are compiled at the first step."""
        began = clock.perf_counter()
        self.spec = load_scene(scene, overrides=overrides)
        self.estimate = estimate(self.spec)
        check_capacity(self.estimate)
        self.phases = phases_of(self.spec)
        self._start = self.phases[0].particles
        work = max(
            plans.step_work(each.spec, each.particles.particle_count, len(each.particles.springs)) for each in self.phases
        )
        self.device = backends.start(backend, precision, large=work >= GPU_WORTH_WORK, threads=threads)
        backends.retain(self.device)
        self._closed = False
        self._plan_asked, self.replica_starts = plan, tuple(replica_starts)
        self._compiled: dict[int, CompiledPhase] = {}
        self.phase_number = -1
        self._enter(0)
        self.setup_seconds = clock.perf_counter() - began
        self.compile_seconds = 0.0
        self.advance_seconds = 0.0
        self.kernel_calls = 0  # of the stepper; under the serial plan each is one launch
        self.phase_work: list[float] = []
        self.when_phase_begins: list[Callable[[Simulation], None]] = []
        self.energy_balance: EnergyBalance | None = None
        self.restart()

    def _enter(self, number: int) -> None:
        """Make a phase the present one; what it needs is imported and allocated when it is entered for the first time."""
        if number == self.phase_number:
            return
        if number not in self._compiled:
            starts = self.replica_starts
            self._compiled[number] = CompiledPhase(
                self.phases[number], self.device, plan=self._plan_asked, replica_starts=starts
            )
        phase, compiled = self.phases[number], self._compiled[number]
        self.phase_number, self.spec, self._particles = number, phase.spec, phase.particles
        self.integrator, self.dt = compiled.integrator, compiled.dt
        self.total_force, self.plan, self.step_work = compiled.total_force, compiled.plan, compiled.work
        self.state, self.stepper, self.energy_meter = compiled.state, compiled.stepper, compiled.energy_meter
        self.launch_limit = compiled.launch_limit
        self._launch_steps = 1

    # --- time -----------------------------------------------------------------------------------------------------------

    @property
    def time(self) -> float:
        """Simulated time: step count × dt, so that it does not gather rounding errors."""
        return self._origin_time + self._steps_since_origin * self.dt

    @property
    def step_count(self) -> int:
        """Steps taken since the start."""
        return self._origin_step + self._steps_since_origin

    def restart(self) -> None:
        """Go back to the start."""
        self._require_life()
        self._enter(phase_at(self.phases, self._start.time))
        self.phase_work.clear()
        self.phase_energy: float | None = None
        self._origin_time, self._origin_step, self._steps_since_origin = self._start.time, self._start.step, 0
        if self.replica_starts:
            position = np.concatenate([start.position for start in self.replica_starts])
            velocity = np.concatenate([start.velocity * start.free for start in self.replica_starts])
            self.state.write(position, velocity)
        else:
            self.state.write(self._start.position, self._start.velocity * self._start.free)
        self._start_afresh()
        self.solver_report = SolverReport()
        if self.energy_balance is not None:
            self.energy_balance.restart()

    def _start_afresh(self) -> None:
        """After positions and velocities were set: neither forces kept nor a method's history hold any more."""
        self._prepared = False
        if self.integrator.implicit:
            self.stepper.solver_report()  # what was counted before does not belong to what comes

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
        reached in the same way, and the next one begins there and then.
        """
        self._require_life()
        if self.energy_balance is not None:
            self.energy_balance.look(self)
        span, left = self._plan_run(duration, until, steps)
        self._notify(recorders)
        while True:
            ahead = self.time_to_next_phase
            leg = min(span, ahead)
            whole, rest = whole_steps(leg, self.dt) if leg < math.inf else (left, 0.0)
            ends_early = left < whole + (rest > 0.0)
            if ends_early:
                whole, rest = left, 0.0
            self._step(int(whole), rest, recorders)
            if ends_early or leg < ahead or ahead == math.inf:
                return self
            span, left = span - ahead, left - whole - (rest > 0.0)
            self._begin_phase(self.phase_number + 1)
            self._notify(recorders)

    def _step(self, whole: int, rest: float, recorders: Sequence[Recorder]) -> None:
        """So many steps, and one of the length `rest` unless that is 0."""
        last = self.step_count + whole
        while self.step_count < last:
            due = min([recorder.steps_until_due(self) for recorder in recorders], default=last)
            longest = min(self._launch_steps, self._launch_cap())
            self._advance(max(1, min(due, last - self.step_count, longest)), self.dt)
            self._notify(recorders)
        if rest > 0.0:
            self._advance(1, rest)
            self._notify(recorders)

    def _launch_cap(self) -> int:
        balance = self.energy_balance
        return self.launch_limit if balance is None else min(self.launch_limit, balance.meter.longest_launch)

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
        copies = range(self.state.replica_count)
        position, velocity = (np.concatenate(each) for each in zip(*(self.state.read(replica) for replica in copies)))
        step = self.step_count
        phase = self.phases[number]
        with self.parameter_change():
            self._enter(number)
            self._origin_time, self._origin_step, self._steps_since_origin = phase.at, step, 0
            self.state.write(position, velocity * np.tile(phase.particles.free, (len(copies), 1)))
            self._start_afresh()
        self.phase_energy = self._total_energy()
        self.phase_work.append(self.phase_energy - before)
        changed = ", ".join(phase.changes)
        log.info("time %.9g: %s changed, and the energy by %.6g", phase.at, changed, self.phase_work[-1])
        for observe in self.when_phase_begins:
            observe(self)

    def _total_energy(self) -> float:
        return float(self.diagnostics()["total_energy"])

    def _notify(self, recorders: Sequence[Recorder]) -> None:
        for recorder in recorders:
            if recorder.steps_until_due(self) <= 0:
                recorder.record(self)

    def _advance(self, steps: int, dt: float) -> None:
        """One launch, timed, and looked over for numbers that are not finite."""
        saved = self.state.save()
        prepared = self._prepared
        began = clock.perf_counter()
        self._launch(steps, dt)
        particle = self.stepper.first_bad_particle()  # waits for the device
        seconds = clock.perf_counter() - began
        if self.integrator.implicit:
            report = self.stepper.solver_report()
            if report.unsolved:
                self._give_up(saved, report, dt)
            self.solver_report.add(report)
        if particle >= 0:
            self._fail(saved, steps, dt)
        if prepared:
            self.advance_seconds += seconds
            if steps == self._launch_steps:
                self._launch_steps = max(1, min(self._launch_steps * 8, int(steps * LAUNCH_SECONDS / max(seconds, 1e-6))))
        else:
            self.compile_seconds += seconds
        self._move_clock(steps, dt)
        if self.energy_balance is not None:
            self.energy_balance.follow(self, steps, dt)

    def _launch(self, steps: int, dt: float) -> None:
        if not self._prepared:
            self.stepper.prepare(self.time)
            self._prepared = True
        balance = self.energy_balance
        self.stepper.advance(self.time, dt, steps, None if balance is None else balance.meter)
        self.kernel_calls += 1

    def _move_clock(self, steps: int, dt: float) -> None:
        if dt == self.dt:
            self._steps_since_origin += steps
        else:
            self._origin_time, self._origin_step = self.time + steps * dt, self.step_count + steps
            self._steps_since_origin = 0

    def _give_up(self, saved: Any, report: Any, dt: float) -> None:
        """Go back to the last step whose equations were solved, and say which were not."""
        particle = self.stepper.least_solved_particle() % self.state.particle_count
        self.state.restore(saved)
        self._prepared = False
        if report.fewest_steps:
            self._launch(report.fewest_steps, dt)
            self.stepper.solver_report()
        self._move_clock(report.fewest_steps, dt)
        self.solver_report.add(report)
        raise postmortem.unsolved(self.snapshot(), particle, step=self.step_count + 1, time=self.time + dt)

    def _fail(self, saved: Any, steps: int, dt: float) -> None:
        """Find the step, the particle and the pair that a NaN began with; leave the last good state standing."""
        stored = [saved]

        def advance(count: int) -> bool:
            self._launch(count, dt)
            return self.stepper.first_bad_particle() < 0

        def keep() -> None:
            stored[0] = self.state.save()

        def rewind() -> None:
            self.state.restore(stored[0])
            self._prepared = False

        bad_step = postmortem.first_bad_step(steps, advance, keep, rewind)
        self._move_clock(bad_step - 1, dt)
        before = self.snapshot()
        self._launch(1, dt)
        particle = self.stepper.first_bad_particle() % self.state.particle_count
        rewind()
        singular = any(force.softening == 0.0 for force in self.total_force.pair_forces)
        raise postmortem.diagnose(before, particle, step=self.step_count + 1, time=self.time + dt, pairs_singular=singular)

    # --- looking --------------------------------------------------------------------------------------------------------

    def snapshot(self, replica: int = 0) -> Snapshot:
        """Host copy of all particles now, float64 whatever the precision."""
        self._require_life()
        position, velocity = self.state.read(replica)
        return self._particles.moved(position=position, velocity=velocity, time=self.time, step=self.step_count)

    @property
    def start(self) -> Snapshot:
        """The state the simulation began with, before rounding to the run's precision."""
        return self._start

    def diagnostics(self) -> dict[str, Any]:
        """Energies, momentum, angular momentum and centre of mass now; see `energy.mechanics`.

        With an energy balance also dissipated_energy, work, energy_balance_residual and energy_turnover.
        """
        from mpp_taichi.energy import mechanics

        self._require_life()
        found = mechanics(self.snapshot(), self.energy_meter.potential_energy(self.time))
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
        in_kernel = self.plan == "serial" and self.device.probes.loop_limit is None
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

    @property
    def conserves_energy(self) -> bool:
        """Whether every force has a potential, so that energy may be asked to stay."""
        return all(force.conserves_energy for force in self.total_force.forces)

    # --- end ------------------------------------------------------------------------------------------------------------

    def _require_life(self) -> None:
        if self._closed or not backends.is_alive(self.device):
            raise MppError("this simulation has ended: it was closed, or another one started a different backend or precision")

    def close(self) -> None:
        """Give the device memory back."""
        if not self._closed and backends.is_alive(self.device):
            for compiled in self._compiled.values():
                compiled.state.destroy()
            backends.release(self.device)
        self._closed = True

    def __enter__(self) -> "Simulation":
        """Use as a context manager."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close at the end of the block."""
        self.close()
