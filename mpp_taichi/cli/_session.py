"""Session: one scene run from the command line, with its recorders, its limits and its files.

Recorders are imported where a run has them: a run without files and panels starts a tenth of a second earlier.
"""

import sys
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpp_taichi.beside.settings import BesideError
from mpp_taichi.cli._amounts import check_amounts
from mpp_taichi.cli._archive import KeptRun, is_kept
from mpp_taichi.cli._goal import Goal
from mpp_taichi.cli._last_files import farewell, state_file, write_all
from mpp_taichi.cli._outcome import Outcome
from mpp_taichi.cli._outputs import asked_recorders, kept_outputs, lock_outputs, open_sinks
from mpp_taichi.cli._passport import passport_facts
from mpp_taichi.cli._request import Request
from mpp_taichi.cli._signals import ANSWER_SECONDS, Interrupted, Interruption
from mpp_taichi.cli._start_simulation import start, start_another
from mpp_taichi.cli._step_check import check_steps
from mpp_taichi.cli._terminal import UsageError, say
from mpp_taichi.cli._turning import tell_turn
from mpp_taichi.cli._validity import Validity
from mpp_taichi.errors import BackendError, MppError, OutputError, StabilityError
from mpp_taichi.modes.network_report import QUICK_FREEDOMS, network_facts, note
from mpp_taichi.passport.carried import carrying
from mpp_taichi.recorders.blow_up import BlowUpWatch
from mpp_taichi.recorders.progress import ProgressRecorder
from mpp_taichi.recorders.table import TableRecorder, asked_columns
from mpp_taichi.recorders.watchdog import EnergyWatchdog
from mpp_taichi.report.expectations import Watcher
from mpp_taichi.report.summary import Stopwatch, Timed, summarize
from mpp_taichi.scene.expectations import BALANCE_QUANTITIES
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.snapshot import Snapshot

if TYPE_CHECKING:
    from mpp_taichi.cli._beside import RightHalf
    from mpp_taichi.cli._interactive import Stage
    from mpp_taichi.recorders.film import FilmRecorder
    from mpp_taichi.recorders.inspection import InspectionRecorder
    from mpp_taichi.recorders.trajectory import TrajectoryRecorder
    from mpp_taichi.simulation.simulation import Simulation
    from mpp_taichi.views._base import View


def run_scene(spec: SceneSpec, request: Request, stage: "Stage | None" = None) -> Outcome:
    """Run a checked scene as asked; returns an Outcome, also when a limit was broken or a signal was received.

    `stage` is the simulation and window of a scene that was opened in the window of another scene.

    Raises:
        MppError: the run could not be started.
    """
    stopwatch = Stopwatch()
    request.check()
    if request.inspect and not spec.inspect and request.beside is None:
        raise UsageError(f"--inspect {request.inspect[0]}: {spec.source} has no inspect:, so there are no panels to write")
    goal = Goal.of(spec, request.until, request.steps) if stage is None else stage.started.goal
    goal.check(spec, may_be_endless=request.window)
    check_amounts(spec, request, goal)
    with ExitStack() as stack:
        interruption = stack.enter_context(Interruption(until_first_step=True))
        lock_outputs(request, stack)
        sinks = open_sinks(spec, request, stack, waits=is_kept(request, goal))
        trajectory = None
        if request.trajectory is not None:
            from mpp_taichi.recorders.trajectory import TrajectoryRecorder

            trajectory = stack.enter_context(TrajectoryRecorder(request.trajectory, waits=is_kept(request, goal)))
        right = None
        if request.beside is not None:
            from mpp_taichi.cli._beside import RightHalf

            right = stack.enter_context(RightHalf(request.beside, spec, request, goal, interruption.raise_if_any))
        simulation = stack.enter_context(start(spec, request) if stage is None else stage.started.simulation)
        if right is not None:
            right.begin(simulation)
        rewound = "" if stage is None else stage.started.rewound
        if stage is None and request.rewind is not None:
            rewound = request.rewind.choose_step(simulation)
            goal = request.rewind.goal(goal, simulation)
        steps = check_steps(simulation, goal, force=request.force)
        total = goal.step_count(spec) if request.rewind is None else steps
        validity = Validity.of(simulation, goal, stopwatch, interruption) if stage is None and request.is_new else Validity()
        run = _Run(spec, request, goal, simulation, stopwatch, total, rewound, right, validity)
        run.glass = None if stage is None else stage.glass
        with carrying(passport_facts(spec, simulation)):
            return run.go(interruption, sinks, trajectory)


def run_stage(stage: "Stage", request: Request) -> Outcome:
    """Run a scene that was opened in a window, with the options that hold for every scene."""
    return run_scene(stage.started.simulation.scene, request.for_another_scene(stage.started.rewind), stage)


class _Run:
    """The middle part of a session, after everything has started: step, sample, and close all files."""

    def __init__(
        self,
        spec: SceneSpec,
        request: Request,
        goal: Goal,
        simulation: "Simulation",
        stopwatch: Stopwatch,
        total_steps: int | None,
        rewound: str,
        right: "RightHalf | None" = None,
        validity: Validity | None = None,
    ) -> None:
        self.spec, self.request, self.goal, self.simulation, self.stopwatch = spec, request, goal, simulation, stopwatch
        self.right, self.validity = right, validity or Validity()
        self.total_steps, self.rewound = total_steps, rewound
        self.every = request.every or TableRecorder.every_of(simulation, self.total_steps)
        self.table = TableRecorder(self.every, asked_columns(simulation) if request.diagnostics is not None else None)
        self.table.validity = self.validity.number if self.validity.horizon else None
        simulation.when_phase_begins.append(self._forget_horizon)
        simulation.judge.use_log()
        self.blow_up = BlowUpWatch(self.table)
        simulation.when_phase_begins.append(self.blow_up.restart)  # a change of a parameter may add energy
        self.watchdog = EnergyWatchdog(self.table)
        self.watcher = Watcher(spec.expect if goal.whole else (), self.every)
        self.network = network_facts(
            spec, simulation.start, simulation.integrator.amplification, simulation.dt, most_freedoms=QUICK_FREEDOMS
        )
        self.modes, self.speeds, self.events = asked_recorders(spec, request, simulation, self.every)
        self.inspection = self._inspection()
        if request.energy_balance or any(each.quantity in BALANCE_QUANTITIES for each in self.watcher.expectations):
            simulation.keep_energy_balance()
        self.glass: Any = None
        self.next: Stage | None = None
        self.films: list[FilmRecorder] = []
        self.files: list[str] = []
        self.error: MppError | None = None
        self.interrupted: Interrupted | None = None
        self.last_state: Snapshot | None = None  # where the display has gone away
        self.trajectory: TrajectoryRecorder | None = None
        self.kept: KeptRun | None = None
        self.went_on: dict[str, Any] | None = None
        self.first_step = 0  # of this process

    def go(self, interruption: Interruption, sinks: Sequence[Any], trajectory: "TrajectoryRecorder | None") -> Outcome:
        """Run to the end, or to the time of an error or a signal; then write all files."""
        if sinks:
            self.films = [self._film(sinks, interruption)]
        self.trajectory = trajectory
        if trajectory is not None:
            trajectory.every = self.every
        if self.inspection is not None and self.films and self.spec.record.panels != "none":
            self.inspection.film = self.films[0]
        if not self.request.quiet and (said := note(self.network)):
            say(f"note: {said}")
        measured = [each for each in (self.inspection, self.modes, self.speeds, self.events) if each is not None]
        samplers: list[Any] = [self.table, self.blow_up, self.watchdog, self.watcher, *measured]
        looks = [*samplers, *([trajectory] if trajectory else [])]
        timed = [Timed(look, self.stopwatch, "diagnostics") for look in looks]
        bar = sys.stderr is not None and sys.stderr.isatty()
        total = None if self.total_steps is None else self.simulation.step_count + self.total_steps
        self._keep(samplers, sinks, trajectory)
        progress = ProgressRecorder(total, self._energy_error, bar=bar)
        wants_progress = not (self.request.quiet or self.request.window)
        recorders = [*timed, *self.films, interruption, *([progress] if wants_progress else [])]
        try:
            with interruption.unwrapped():
                self._advance(recorders, progress, interruption)
            self._finish([*looks, *self.films])
            if self.right is not None:
                self.right.end()
        except Interrupted as signal:
            self.interrupted = signal
            if self.kept is not None and self.simulation.step_count > self.first_step:
                self.kept.archive.record(self.simulation)  # before the samples that only an interrupted run takes
            # At the start there is nothing to measure, and the kernels would still be compiled.
            if self.simulation.step_count > 0 and self._sample_seconds() < ANSWER_SECONDS / 2:
                self._finish([self.table, self.watchdog, *measured, *([trajectory] if trajectory else [])])
        except StabilityError as error:
            self.error = self.blow_up.explain(error, self.simulation)
            say(f"error: {self.error}")
        except (BesideError, OutputError) as error:
            self.error = error
            say(f"error: {error}")
        with self.stopwatch("encode"):
            self._close(sinks, trajectory)
        if self.kept is not None:
            self._end_archive(self.kept)
        return self._outcome()

    def _keep(self, looks: Sequence[Any], sinks: Sequence[Any], trajectory: "TrajectoryRecorder | None") -> None:
        """Keep an archive, and go on with the run that an earlier process has left there."""
        if not is_kept(self.request, self.goal):
            return
        for film in self.films:
            film.begin(self.simulation)
        names = {type(look).__name__: look for look in (*looks, *self.films)}
        outputs = kept_outputs(self.films, sinks, trajectory)
        self.kept = KeptRun(self.simulation, self.request, self.goal, self.every, names, outputs)
        self.went_on = self.kept.go_on(self.simulation)
        self.first_step = self.simulation.step_count
        self.simulation.when_phase_begins.append(self.kept.archive.phase_begins)

    def _end_archive(self, kept: KeptRun) -> None:
        """End the archive where all files are written; after a signal, or an error of a disk, the run is gone on with."""
        try:
            if kept.may_end and self.interrupted is None and (self.error is None or isinstance(self.error, StabilityError)):
                # A run that blew up would break down again, unless it is rewound.
                kept.archive.end(None if self.error is None else self.simulation)
        except OutputError as error:
            say(f"error: {error}")
            self.error = error
        kept.archive.close()

    def _advance(self, recorders: list[Any], progress: ProgressRecorder, interruption: Interruption) -> None:
        if self.request.window:
            from mpp_taichi.cli._interactive import show

            looks = (self.simulation, self.spec, self.goal, recorders, interruption, self._caption, self.inspection)
            another = partial(start_another, device=self.simulation.device, request=self.request)
            self.next = show(*looks, start=another, glass=self.glass, lost=self._lose_display, request=self.request)
        else:
            steps = (
                self.goal.steps if self.went_on is None or self.goal.steps is None else self.goal.steps - self.went_on["step"]
            )
            with ExitStack() as stack:
                if not self.request.quiet:
                    stack.enter_context(progress)
                if self.kept is not None:
                    stack.enter_context(self.kept.listening())
                    recorders = [*recorders, self.kept.archive]
                self.simulation.run(until=self.goal.until, steps=steps, recorders=recorders)

    def _inspection(self) -> "InspectionRecorder | None":
        """The recorder that samples the scene's panels; None where they are neither shown nor written."""
        spec, request, simulation = self.spec, self.request, self.simulation
        drawn = any(path is not None for path in (request.video, request.frames, request.still))
        shown = request.window or (drawn and spec.record.panels != "none")
        if not spec.inspect or self.right is not None or not (request.inspect or shown):
            return None
        from mpp_taichi.recorders.inspection import InspectionRecorder
        from mpp_taichi.recorders.inspector import Inspector

        end = None if self.goal.endless else simulation.time + self.goal.span(spec)
        every = request.every or spec.run.every or InspectionRecorder.every_for(self.total_steps, self.every)
        return InspectionRecorder(Inspector(simulation, end=end), every)

    def _view(self, size: tuple[int, int]) -> "View":
        """The view that draws the pictures of a film, with the panels of the scene beside it."""
        from mpp_taichi.views.offscreen import open_offscreen
        from mpp_taichi.views.panels import Division, ViewWithPanels, narrowed

        spec = self.spec
        drawn: dict[str, Any] = {"dimensions": spec.dimensions, "renderer": self.request.renderer}
        division = Division.of(size, spec.record) if self.inspection is not None else None
        if self.inspection is None or division is None:
            return open_offscreen(spec.view, size, **drawn)
        plain = replace(narrowed(spec.view, size, division.scene), caption=False)
        view = open_offscreen(plain, division.scene, **drawn)
        return ViewWithPanels(view, self.inspection.inspector.plots, division, caption=spec.view.caption)

    def _film(self, sinks: Sequence[Any], interruption: Interruption) -> "FilmRecorder":
        from mpp_taichi.recorders.film import FilmRecorder
        from mpp_taichi.recorders.html import HtmlRecorder

        request, record = self.request, self.spec.record
        size, count, span = request.size or record.size, request.frame_count(self.spec), self.goal.span(self.spec)
        pages = [sink for sink in sinks if isinstance(sink, HtmlRecorder)]
        pictures = [sink for sink in sinks if sink not in pages]
        if count > 1 and self.goal.steps is None:
            self.simulation.sample_at_multiples_of(span / (count - 1))
        for page in pages:
            page.begin(self.spec, self.simulation.start.name, self.table.rows, count)
        more: dict[str, Any] = {"title": self.spec.title, "caption": self._caption, "stopwatch": self.stopwatch}
        more |= {"start": self.goal.begin if request.rewind is not None else None, "is_dimmed": self.validity.is_beyond}
        told = partial(tell_turn, fps=request.fps or record.fps, quiet=request.quiet)
        more |= {"raise_if_interrupted": interruption.raise_if_any, "told": told}
        if self.right is not None:
            return self.right.film(size, pictures, count, **more)
        return FilmRecorder(self._view(size) if pictures else None, pictures, count, span, pages=pages, **more)

    def _energy_error(self) -> float | None:
        rows = self.table.rows
        return rows[-1]["relative_energy_error"] if rows and self.simulation.phase.conserves_energy else None

    def _forget_horizon(self) -> None:
        if len(self.simulation.scene.timeline) != len(self.spec.timeline):  # a slider was moved
            self.validity.forget()

    def _caption(self) -> str:
        error = self._energy_error()
        of_modes = self.modes.caption() if self.modes else ""
        told = (f"energy error {error:.1e}" if error else "", of_modes, self.validity.caption())
        return "\n".join(line for line in told if line)

    def _sample_seconds(self) -> float:
        """Seconds that a sample has taken on average, among them those of energies, whose sums over pairs may be long."""
        return self.stopwatch.seconds.get("diagnostics", 0.0) / max(1, len(self.table.rows))

    def _finish(self, recorders: Sequence[Any]) -> None:
        """Take the last samples, of the final state."""
        for recorder in recorders:
            if isinstance(recorder, (BlowUpWatch, EnergyWatchdog)):
                recorder.record(self.simulation)
            else:
                recorder.finish(self.simulation)

    def _close(self, sinks: Sequence[Any], trajectory: "TrajectoryRecorder | None") -> None:
        """Give every file its final name, also after an error; the first failure is reported, the other files still written."""
        request, simulation, state = self.request, self.simulation, self._state_file()
        jobs: list[tuple[Path, Any]] = []
        for sink in sinks:
            if sink.frame_count == 0 and (self.error or self.interrupted):
                sink.abandon()
                continue
            jobs.append((sink.path, sink.close))
        if trajectory is not None and trajectory.frame_count == 0:
            trajectory.close()
        elif trajectory is not None:
            jobs.append((trajectory.path, trajectory.close))
        if request.diagnostics is not None and self.table.rows:
            jobs.append((request.diagnostics, lambda: self.table.save(request.diagnostics)))
        if self.inspection is not None and self.inspection.inspector.samples.count:
            jobs += [(path, partial(self.inspection.save, path)) for path in request.inspect]
        if self.right is not None and self.right.difference is not None and self.right.difference.last is not None:
            jobs += [(path, partial(self.right.save, path)) for path in request.inspect]
        if self.modes is not None and request.modes is not None and self.modes.times:
            jobs.append((request.modes, lambda: self.modes.save(request.modes)))
        if self.speeds is not None and request.speeds is not None:
            jobs.append((request.speeds, lambda: self.speeds.save(request.speeds)))
        if self.events is not None and request.events is not None:
            jobs.append((request.events, lambda: self.events.save(request.events)))
        if request.log is not None:
            from mpp_taichi.cli._window_desk import save_log

            jobs.append((request.log, partial(save_log, request.log, simulation, self.goal)))
        if state is not None:
            save = simulation.checkpoint if self.last_state is None else self.last_state.save
            jobs.append((state, partial(save, state)))
        self.files, self.error = write_all(jobs, self.error)

    def _state_file(self) -> Path | None:
        broken_off = self.interrupted is not None or self.last_state is not None
        return state_file(self.spec.source, self.request, self.error, broken_off=broken_off)

    def _lose_display(self, display: str, state: Snapshot) -> int:
        """Write all files without a launch of a kernel, since the process ends within a call of Xlib; the exit code."""
        self.error = BackendError(f"the display {display} has gone away at t = {state.time:.9g}")
        self.last_state = state
        try:
            self._close((), self.trajectory)
        finally:
            code = farewell(self.error, self.files, self._state_file())
        return code

    def _outcome(self) -> Outcome:
        summary = summarize(
            self.simulation,
            self.table,
            self.stopwatch,
            plan_asked=self.request.plan,
            first_step=self.first_step,
            keeps_pace=self.request.window,
        )
        summary |= (
            self.network
            | self.validity.summary()
            | (self.modes.summary() if self.modes else {})
            | (self.right.summary() if self.right else {})
        )
        precision = self.simulation.device.precision
        verdicts = self.watcher.verdicts(summary, precision, self.simulation) if self._reached_the_end() else []
        failed = any(not verdict.passed for verdict in verdicts)
        verdict, code = self.simulation.verdict, 0
        if self.error is not None:
            status, code = "failed", self.error.exit_code
        elif self.interrupted is not None:
            status, code = "interrupted", self.interrupted.code
        elif failed:
            status, code = "failed", StabilityError.exit_code
        else:
            status = verdict.status
            code = 0 if verdict.is_sound or self.request.allow_inaccurate else StabilityError.exit_code
        summary |= {"status": status, "findings": [vars(each) for each in verdict.findings]}
        if self.rewound:
            summary["rewound"] = self.rewound
        if self.went_on is not None:
            summary["went_on"] = self.went_on
        return Outcome(summary, code, self.error, verdicts, self.files, self.next)

    def _reached_the_end(self) -> bool:
        """Whether the run reached the end for which the scene's expectations hold."""
        broken_off = self.error is not None or self.interrupted is not None
        meddled = len(self.simulation.scene.timeline) != len(self.spec.timeline)  # moved by sliders
        return self.goal.whole and not (broken_off or meddled) and self.goal.is_reached(self.simulation)
