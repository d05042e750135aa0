"""Simulation: time, step count, the order of operations, and the execution plan."""

import math
import time as clock
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol

from mpp_taichi import backends, component, plans, postmortem
from mpp_taichi.assemble import assemble
from mpp_taichi.errors import BackendError, CapacityError, MppError
from mpp_taichi.postmortem import Mark
from mpp_taichi.scene.estimate import check_capacity, estimate
from mpp_taichi.scene.load import load_scene
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.solvers.report import SolverReport
from mpp_taichi.stability import StepAdvice, StepGuard

LAUNCH_SECONDS = 0.1  # aim for one launch: short enough to interrupt, long enough not to matter
GPU_WORTH_WORK = 4_000_000  # work per step (see plans) from which `auto` looks for a GPU


class Recorder(Protocol):
    """Something that wants to see the simulation now and then."""

    def steps_until_due(self, simulation: "Simulation") -> int:
        """How many steps may pass before the next look; 0 means now."""

    def record(self, simulation: "Simulation") -> None:
        """Look."""


class Simulation:
    """A scene, compiled to one step and run on one device.

    `scene` is a path, a mapping of the shape of the YAML, or a SceneSpec; `overrides` are those of `--set`. `replica_starts`
    holds the starting snapshots of independent copies of the scene that run side by side, one thread each. `start` is a state
    of the same particles to go on from instead of the scene's own, with its time and step count. `force` runs a step that is
    beyond what the springs allow. Raises SceneError, BackendError or CapacityError before anything is allocated,
    StabilityError when it is run.
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
    ):
        """Read the scene, start the backend, allocate and fill the fields; kernels are compiled at the first step."""
        began = clock.perf_counter()
        self.spec = load_scene(scene, overrides=overrides)
        self.estimate = estimate(self.spec)
        check_capacity(self.estimate)
        assembled = assemble(self.spec)
        self._start = assembled if start is None else start.continuing(assembled)
        self._build(backend, precision, plan, tuple(replica_starts), threads)
        self._guard = StepGuard(self.spec, self._start, self.integrator, force=force)
        self.setup_seconds = clock.perf_counter() - began
        self.compile_seconds = 0.0
        self.advance_seconds = 0.0
        self.kernel_calls = 0  # of the stepper; under the serial plan each is one launch
        self.restart()

    def _build(self, backend: str, precision: str | None, plan: str, starts: tuple[Snapshot, ...], threads: int | None) -> None:
        start = self._start
        work = self.step_work = plans.step_work(self.spec, start.particle_count, len(start.springs))
        self.device = backends.start(backend, precision, large=work >= GPU_WORTH_WORK, threads=threads)
        backends.retain(self.device)
        self._closed = False
        # Only now may Taichi code be imported, and only what the scene names.
        from mpp_taichi.energy import EnergyMeter
        from mpp_taichi.state import State
        from mpp_taichi.stepper import Stepper
        from mpp_taichi.total_force import TotalForce, compose

        self.integrator = component.build("integrators", self.spec.integrator.name, self.spec.integrator.parameters)
        self.dt = float(self.spec.integrator.parameters["dt"])
        self.total_force = TotalForce(compose(self.spec, start), start.particle_count, self.spec.dimensions)
        self.replica_starts = starts
        replica_count = max(1, len(starts))
        self.plan = plan if plan != "auto" else plans.choose(work, on_cpu=self.device.on_cpu, replica_count=replica_count)
        if self.plan not in plans.PLANS or (replica_count > 1) != (self.plan == "replicas"):
            raise BackendError(
                f"plan {plan!r} does not fit; there are auto, serial and parallel for one copy, replicas for several"
            )
        work_fields = self.integrator.work_fields(self.total_force, start, plan=self.plan, on_cpu=self.device.on_cpu)
        self.state = State(
            start,
            dimensions=self.spec.dimensions,
            needs=self.total_force.needs,
            scratch_count=self.integrator.scratch_count(self.total_force.depends_on_velocity),
            streaming=self.total_force.has_pairs,
            replica_count=replica_count,
            wide=backends.widest_float(self.device),
            work=work_fields,
        )
        self.stepper = Stepper(self.state, self.total_force, self.integrator, plan=self.plan, on_cpu=self.device.on_cpu)
        self.energy_meter = EnergyMeter(self.state, self.total_force)
        self.launch_limit = self._steps_per_launch()
        self._launch_steps = 1

    def _steps_per_launch(self) -> int:
        """Most steps one launch may hold: software Vulkan stops a thread's loops in silence."""
        limit = self.device.probes.loop_limit
        if limit is None:
            return 2**31 - 1
        if self.plan == "parallel":
            longest = self.state.particle_count if self.total_force.has_pairs else 0
            allowed = 2**31 - 1
        else:
            longest = self.stepper.loop_iterations_per_step()
            allowed = limit // longest
        if longest > limit:
            raise CapacityError(
                f"this device ({self.device.name}) stops a kernel thread after {limit:,} loop iterations, and one step of "
                f"{self.state.particle_count:,} particles under the {self.plan} plan needs {longest:,}; "
                "use --backend cpu or another plan"
            )
        return allowed

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
        self._origin_time, self._origin_step, self._steps_since_origin = self._start.time, self._start.step, 0
        if self.replica_starts:
            import numpy as np

            position = np.concatenate([start.position for start in self.replica_starts])
            velocity = np.concatenate([start.velocity * start.free for start in self.replica_starts])
            self.state.write(position, velocity)
        else:
            self.state.write(self._start.position, self._start.velocity * self._start.free)
        self._prepared = False
        if self.integrator.implicit:
            self.stepper.solver_report()
            self.solver_report = SolverReport()

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
        recorders look. If the end is no whole number of steps away, one shorter step reaches it exactly. A step beyond what the
        springs allow is refused with a StabilityError, see `check_step`.
        """
        self._require_life()
        whole, rest = self._plan_run(duration, until, steps)
        self.check_step(whole)
        self._notify(recorders)
        last = self.step_count + whole
        while self.step_count < last:
            due = min([recorder.steps_until_due(self) for recorder in recorders], default=last)
            self._advance(max(1, min(due, last - self.step_count, self._launch_steps, self.launch_limit)), self.dt)
            self._notify(recorders)
        if rest > 0.0:
            self._advance(1, rest)
            self._notify(recorders)
        return self

    def _plan_run(self, duration: float | None, until: float | None, steps: int | None) -> tuple[int, float]:
        if sum(argument is not None for argument in (duration, until, steps)) > 1:
            raise MppError("run takes one of duration, until and steps")
        if duration is None and until is None and steps is None:
            duration, steps = self.spec.run.duration, self.spec.run.steps
            if duration is None and steps is None:
                raise MppError("the scene has no run.duration, so say how long: duration, until or steps")
        if steps is not None:
            if steps < 0:
                raise MppError(f"steps must not be negative, got {steps}")
            return steps, 0.0
        span = float(duration) if duration is not None else float(until or 0.0) - self.time
        if not math.isfinite(span) or span < 0.0:
            raise MppError(f"cannot run for a time of {span}")
        whole = math.floor(span / self.dt * (1.0 + 4e-16) + 1e-9)
        rest = span - whole * self.dt
        return whole, (rest if rest > 1e-9 * self.dt else 0.0)

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

    def _launch(self, steps: int, dt: float) -> None:
        if not self._prepared:
            self.stepper.prepare(self.time)
            self._prepared = True
        self.stepper.advance(self.time, dt, steps)
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

    # --- stability ------------------------------------------------------------------------------------------------------

    @property
    def step_advice(self) -> StepAdvice | None:
        """How large a step the springs and the drag allow, as the particles were placed; None where nothing limits it."""
        return self._guard.advice(self.dt)

    def check_step(self, steps: int | None = None) -> None:
        """Warn of a step near its limit, and refuse one beyond it unless this simulation was made with `force`.

        `steps` is the length of the run, for methods whose oscillations grow whatever the step is. Done once for each dt.

        Raises:
            StabilityError: the step cannot hold.
        """
        self._guard.check(self.dt, steps)

    def mark(self) -> Mark:
        """The state and its time, to `return_to`."""
        return Mark(self.state.save(), self._origin_time, self._origin_step, self._steps_since_origin)

    def return_to(self, mark: Mark) -> None:
        """Go back; what a method of several steps remembers is forgotten, as after `restart`."""
        self.state.restore(mark.saved)
        self._origin_time, self._origin_step, self._steps_since_origin = mark.origin_time, mark.origin_step, mark.steps
        self._prepared = False

    def try_steps(self, steps: int) -> bool:
        """Advance without recorders; False, and no error, where a number is not finite or a step not solved."""
        while steps > 0:
            count = min(steps, self.launch_limit)
            self._launch(count, self.dt)
            self._move_clock(count, self.dt)
            steps -= count
        solved = not (self.integrator.implicit and self.stepper.solver_report().unsolved)
        return solved and self.stepper.first_bad_particle() < 0

    # --- looking --------------------------------------------------------------------------------------------------------

    def snapshot(self, replica: int = 0) -> Snapshot:
        """Host copy of all particles now, float64 whatever the precision."""
        self._require_life()
        position, velocity = self.state.read(replica)
        return self._start.moved(position=position, velocity=velocity, time=self.time, step=self.step_count)

    @property
    def start(self) -> Snapshot:
        """The state the simulation began with, before rounding to the run's precision."""
        return self._start

    def diagnostics(self) -> dict[str, Any]:
        """Energies, momentum, angular momentum and centre of mass now; see `energy.mechanics`."""
        from mpp_taichi.energy import mechanics

        self._require_life()
        return mechanics(self.snapshot(), self.energy_meter.potential_energy(self.time))

    @property
    def conserves_energy(self) -> bool:
        """Whether every force has a potential, so that energy may be asked to stay."""
        return all(force.conserves_energy for force in self.total_force.forces)

    @property
    def gains_no_energy(self) -> bool:
        """Whether every force has a potential or brakes, so that energy may be asked not to grow.

        What has no potential and depends on velocity is taken for a brake; what has none and does not, for a drive.
        """
        return all(force.conserves_energy or force.depends_on_velocity for force in self.total_force.forces)

    # --- end ------------------------------------------------------------------------------------------------------------

    def _require_life(self) -> None:
        if self._closed or not backends.is_alive(self.device):
            raise MppError("this simulation has ended: it was closed, or another one started a different backend or precision")

    def close(self) -> None:
        """Give the device memory back."""
        if not self._closed and backends.is_alive(self.device):
            self.state.destroy()
            backends.release(self.device)
        self._closed = True

    def __enter__(self) -> "Simulation":
        """Use as a context manager."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close at the end of the block."""
        self.close()
