"""Simulation: a scene that runs on a device, in whole steps, through the phases of its timeline."""

import math
import time as clock
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from operator import attrgetter
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from mpp_taichi.device import backends, one_thread
from mpp_taichi.device.thread_count import check_threads
from mpp_taichi.errors import SceneError
from mpp_taichi.scene.estimate import check_capacity, estimate
from mpp_taichi.scene.load import load_scene
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.simulation import dropped
from mpp_taichi.simulation.accounts import Accounts
from mpp_taichi.simulation.clock import Clock
from mpp_taichi.simulation.compiled_phase import CompiledPhase
from mpp_taichi.simulation.compiled_phases import CompiledPhases
from mpp_taichi.simulation.course import Course, course_of
from mpp_taichi.simulation.every import calls
from mpp_taichi.simulation.in_turn import in_turn, require_life
from mpp_taichi.simulation.inner_names import INNER_NAMES
from mpp_taichi.simulation.judge import RunJudge
from mpp_taichi.simulation.notebook_progress import shown_progress
from mpp_taichi.simulation.orbits import orbits
from mpp_taichi.simulation.particles import Particles
from mpp_taichi.simulation.phase_runner import PhaseRunner
from mpp_taichi.simulation.recorder import Recorder
from mpp_taichi.simulation.run_archive import RunArchive, begin_archive
from mpp_taichi.simulation.run_length import interval_of, time_and_steps
from mpp_taichi.simulation.run_loop import RunLoop
from mpp_taichi.simulation.saved_state import Bookmark, Mark
from mpp_taichi.simulation.verdict import RunVerdict
from mpp_taichi.simulation.watched_launches import Timings, WatchedLaunches
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.stability import StepAdvice

if TYPE_CHECKING:
    from mpp_taichi.energy.energy_balance import EnergyBalance

GPU_WORTH_WORK = 4_000_000  # work per step (see plans) from which `auto` looks for a GPU


class Simulation:
    """A scene, compiled to one step and run on one device; with a timeline, to one step for each phase.

    `scene` is a path, a mapping of the shape of the YAML, or a SceneSpec; `overrides` are the texts of `--set`.
    `replica_starts` holds the starting snapshots of independent copies of the scene that run side by side, one thread each.
    `start` is a state of the same particles to go on from instead of the scene's own, with its time and step count. `force`
    runs a step that is longer than the springs allow, `event_log` lets event-driven contacts note every collision. Raises
    SceneError, ArgumentError, BackendError or CapacityError before anything is allocated, StabilityError when it is run.

    `phase` is the present phase, compiled; its parts (`spec`, `integrator`, `total_force`, `state`, …) are read through the
    simulation as well. `scene` is the whole scene, with its timeline and all that was set.
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
        check_threads(threads)
        read = load_scene(scene, overrides=overrides, interval=1.0)  # until a run has a length
        self._leaves_interval_open = read.leaves_interval_open
        if read.accuracy is not None:
            raise SceneError(f"{read.source}: accuracy: its method is still to be chosen, by mpp_taichi.settle or the run verb")
        self.estimate = estimate(read)
        check_capacity(self.estimate)
        course = course_of(read, start)
        # No scene with contacts is sent to a GPU unasked.
        work = 0 if any(phase.spec.contacts for phase in course.phases) else max(phase.work for phase in course.phases)
        self._clock, self._accounts = Clock(course.phases[course.first].dt), Accounts()
        with one_thread.lock:
            dropped.free_dropped()
            self.device = backends.start(backend, precision, large=work >= GPU_WORTH_WORK, threads=threads)
            compiled = CompiledPhases(self.device, plan=plan, replica_starts=replica_starts, event_log=event_log)
            backends.retain(self.device)
            self._watcher = dropped.watch(self, compiled, self.device)
            self._closed = False
            self._runner = PhaseRunner(course, compiled, self._clock, self._accounts, force=force)
        self._launches = WatchedLaunches(self._clock, self._accounts)
        self.judge, self._archives = RunJudge(), list[RunArchive]()
        self._runner.when_phase_begins.append(self.judge.renew)
        self.when_phase_begins: list[Callable[[], None]] = self._runner.when_phase_begins
        self.timings: Timings = self._launches.timings
        self.timings.setup_seconds = clock.perf_counter() - began

    # Time

    @property
    def time(self) -> float:
        """Simulated time."""
        return self._clock.time

    @property
    def step_count(self) -> int:
        """Steps taken since the start."""
        return self._clock.step_count

    @property
    def dt(self) -> float:
        """Length of the steps from now on; a phase begins with the step of its scene."""
        return self._clock.dt

    @dt.setter
    def dt(self, dt: float) -> None:
        self._clock.dt = dt

    def sample_at_multiples_of(self, interval: float) -> None:
        """Let samples of a free flight fall on multiples of `interval`, at least as often as so far."""
        if not self.launcher.takes_steps:
            self.dt = interval / math.ceil(interval / self.dt)

    def run(
        self,
        duration: float | None = None,
        *,
        until: float | None = None,
        steps: int | None = None,
        recorders: Sequence[Recorder] = (),
        judge: str = "warn",
        every: float | None = None,
        call: Callable[["Simulation"], object] | None = None,
    ) -> "Simulation":
        """Advance by `duration`, `until` a time, or by `steps`; without any of them as the scene's `run:` says.

        A shorter last step reaches the end exactly, and the end of each phase. Recorders are called when they are due.
        `judge` says how findings of `verdict` are told: "warn" by a Python warning, an AccuracyWarning; "raise" by a
        StabilityError; "off" not at all, and then nothing is looked at. A run in many short calls is looked at now and then.
        `call(self)` is called each time that the time `every` has passed: it may read everything, and change nothing.
        """
        require_life(self)
        span, left = time_and_steps(self.spec.run, self.time, duration, until, steps)
        if self._leaves_interval_open:
            self.dt = interval_of(span)
        end = self.time + span if until is None else float(until)
        looks = [*recorders, *calls(every, call, self.time), *self._archives]
        with shown_progress(self, span, left) as progress:
            RunLoop(self, self._runner, self._launches, [*looks, *progress]).run(span, left, end, judge)
        return self

    @property
    def verdict(self) -> RunVerdict:
        """The judgement of the run so far, by the rules by which commands call a run `inaccurate`: see `RunVerdict`."""
        return self.judge.verdict(self)

    @property
    def step_advice(self) -> StepAdvice | None:
        """The largest step that springs and drag allow the particles as they were when the phase began; None for any step."""
        return self._runner.guard.advice(self.dt)

    def check_step(self, steps: int | None = None) -> None:
        """Warn of a step near its limit; StabilityError for a step beyond it, unless this simulation was made with `force`.

        `steps` is the length of the run, for methods whose oscillations grow whatever the step is. Done once for each dt.
        """
        self._runner.guard.check(self.dt, steps)

    @in_turn
    def begin_phase(self, number: int) -> None:
        """Go on with a phase at once, from the present state and at the phase's time; `run` does so by itself."""
        self._runner.begin(number)

    # Changes and steps backwards

    @in_turn
    def set(self, changes: str | Mapping[str, Any], value: Any = None) -> None:
        """Change parameters from now on: a path and its value, or a mapping of several, as `timeline:` takes them.

        Positions, velocities and the time stay, bit for bit. Kernels load the parameters that the scene's `sliders:` move:
        within the range of a slider nothing is compiled. Other numbers are part of the kernels, so that a change compiles them
        anew: forces, springs, walls, contacts, the integrator and its step, constants, and of particles all but their places;
        at time 0 all of the scene. The change becomes an event of `scene`: `restart` goes through it again, bit for bit.

        Raises:
            MppError: there is no such parameter, or it cannot have this value; nothing has changed then.
        """
        self._runner.change({changes: value} if isinstance(changes, str) else dict(changes))
        self.judge.renew()

    @in_turn
    def parameter_change(self) -> AbstractContextManager[None]:
        """A block in which parameters, fields or forces are replaced; an energy balance books the change of energy as work."""
        self.judge.renew()
        return self._runner.parameter_change()

    @in_turn
    def restart(self, *, as_written: bool = False) -> None:
        """Go back to the start, and through all changes again; or, `as_written`, forget the changes, but for the sliders."""
        self._runner.restart_as_written() if as_written else self._runner.restart()
        self.judge.restart()

    @in_turn
    def place_replicas(self, starts: Sequence[Snapshot], scenes: Sequence[SceneSpec] = ()) -> None:
        """Go back to the time of the start, each replica to its own, with its scene's `live` parameters; see PhaseRunner."""
        self._runner.place_replicas(tuple(starts), scenes or [self.spec] * len(starts))

    @in_turn
    def mark(self, *, whole: bool = True) -> Mark:
        """The state and its time, for `return_to`; valid within the phase. Not `whole`: see `CompiledPhase.save`."""
        return self._runner.mark(whole=whole)

    @in_turn
    def return_to(self, mark: Mark) -> None:
        """Go back, bit for bit, with all that the method and the contacts remember."""
        self._runner.return_to(mark)

    @in_turn
    def try_steps(self, steps: int, dt: float | None = None, *, judged: bool = True) -> bool:
        """Advance without recorders and accounts, by steps of the run or of another `dt`.

        False where a number is not finite or an implicit step was not solved; True where this is not `judged`.
        """
        return self._launches.try_steps(self.phase, steps, self.dt if dt is None else dt, judged=judged)

    @in_turn
    def bookmark(self) -> Bookmark:
        """This moment with its parameters and accounts, for `go_back`; valid until a change replaces its kernels."""
        return self._runner.bookmark()

    @in_turn
    def go_back(self, bookmark: Bookmark) -> None:
        """Go back to a moment, bit for bit, with its parameters; later changes are forgotten.

        Raises:
            MppError: a later change has replaced the kernels of that moment.
        """
        self._runner.go_back(bookmark)
        self.judge.go_back(self.time)

    # Samples

    @in_turn
    def snapshot(self, replica: int = 0) -> Snapshot:
        """Host copy of all particles now, float64 whatever the precision."""
        return self.phase.snapshot(self._clock, replica)

    @property
    def particles(self) -> Particles:
        """The particles by name, index, slice or group: `simulation.particles["earth"].position`, as they are when asked."""
        return Particles(self)

    @in_turn
    def snapshot_ahead(self, offset: float) -> Snapshot:
        """The particles an `offset` < dt later, by the motion that the step goes on with: x + v offset, or along orbits."""
        return self.phase.snapshot_ahead(self._clock, offset)

    @in_turn
    def accelerations(self, snapshot: Snapshot | None = None) -> np.ndarray:
        """Accelerations [length / time²] by the forces now, or where a snapshot of this phase is, (particle_count, 3).

        Friction is included, and 0 stands along an axis that is held; contacts and walls, which act in an instant, are not.
        """
        return self.phase.acceleration_meter.measure(self.snapshot() if snapshot is None else snapshot)

    orbits = orbits

    @in_turn
    def mechanics(self) -> dict[str, Any]:
        """Energies, momentum, angular momentum and centre of mass now; see `energy.mechanics`."""
        return self._runner.mechanics()

    def diagnostics(self) -> dict[str, Any]:
        """`mechanics`, and with an energy balance also dissipated_energy, work, energy_balance_residual and energy_turnover."""
        found = self.mechanics()
        if self.energy_balance is not None:
            found |= self.energy_balance.account(self._runner, found["total_energy"])
        return found

    @in_turn
    def keep_energy_balance(self) -> "EnergyBalance":
        """Integrate dissipated energy and work from now on, step by step."""
        return self._accounts.keep_energy_balance(self.phase)

    def checkpoint(self, path: str | Path, *, every: float | None = None) -> None:
        """Write the state now to a `.npz` file, from which `start` or --rewind goes on; OutputError where that fails.

        With `every` [seconds of the wall clock] the file becomes an archive, from which `mpp.resume` goes on: each later `run`
        writes a record of its state so often, and `close` writes the last one.
        """
        if every is None:
            replace(self.snapshot(), dt=self.dt).save(path)
        else:
            self._archives.append(begin_archive(self, Path(path), every))

    def picture(self, size: tuple[int, int] = (960, 540)) -> np.ndarray:
        """The picture that a window would show now: red, green, blue as uint8, shape (height, width, 3)."""
        from mpp_taichi.simulation import notebook

        return notebook.picture(self, size)

    def __dir__(self) -> list[str]:
        """The attributes for scripts and notebooks."""
        return sorted(name for name in object.__dir__(self) if not name.startswith("_") and name not in INNER_NAMES)

    def __repr__(self) -> str:
        """Scene, time, size and method in one line."""
        from mpp_taichi.simulation import notebook

        return notebook.line(self)

    def _repr_png_(self) -> bytes | None:
        from mpp_taichi.simulation import notebook

        return notebook.png(self)

    def _repr_html_(self) -> str:
        from mpp_taichi.simulation import notebook

        return notebook.html(self)

    # Scene and phases

    phase_number = property(attrgetter("_runner.number"), doc="Number of the present phase.")
    time_to_next_phase = property(attrgetter("_runner.time_to_next_phase"), doc="Time until the timeline changes something.")
    state = property(attrgetter("phase.state"), doc="The fields of the particles.")
    total_force = property(attrgetter("phase.total_force"), doc="The sum of the forces.")
    integrator = property(attrgetter("phase.integrator"), doc="The method.")
    launcher = property(attrgetter("phase.launcher"), doc="The kind of step, as kernels that are launched.")

    @property
    def course(self) -> Course:
        """The phases of the run, with the phase and the state that it began with; `set` replaces it."""
        return self._runner.course

    @property
    def scene(self) -> SceneSpec:
        """The whole scene, with its timeline and all that was set."""
        return self._runner.course.scene

    phases = property(attrgetter("_runner.course.phases"), doc="The phases; those before the first of the course never ran.")

    start = property(attrgetter("_runner.course.start"), doc="The state that the run began with, before rounding.")

    @property
    def phase(self) -> CompiledPhase:
        """The present phase on its device."""
        return self._runner.phase

    @property
    def spec(self) -> SceneSpec:
        """The scene of the present phase."""
        return self.phase.spec

    plan = property(attrgetter("phase.plan"), doc="The plan by which a step is run: serial, parallel or replicas.")
    contacts = property(attrgetter("phase.contacts"), doc="The contact solver, where the scene has contacts.")
    phase_work = property(attrgetter("_accounts.phase_work"), doc="Energy that each change of the scene has put in [energy].")
    phase_energy = property(attrgetter("_accounts.phase_energy"), doc="Total energy after the last change; None before it.")
    energy_balance = property(attrgetter("_accounts.energy_balance"), doc="Dissipated energy and work, where they are kept.")
    solver_report = property(attrgetter("_accounts.solver_report"), doc="Counts of the solver of implicit steps.")
    contact_report = property(attrgetter("_accounts.contact_report"), doc="Counts of the contacts.")

    # End of the run

    @property
    def is_alive(self) -> bool:
        """Whether the particles can still be read and moved."""
        return not self._closed and backends.is_alive(self.device)

    def close(self) -> None:
        """Give the device memory back, after a last look at the run and a last record of each archive."""
        if self.is_alive:
            self.judge.close(self)
            for archive in self._archives:
                archive.record(self)
                archive.close()
        with one_thread.lock:
            if not self._closed:
                self._closed = True
                self._watcher()
            dropped.free_dropped()

    def __enter__(self) -> "Simulation":
        """Return the simulation, for a block that closes it."""
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """Close at the end of the block; after an error without a last look."""
        if kind is not None:
            self.judge.renew()
        self.close()
