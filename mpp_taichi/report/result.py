"""Run a scene from Python as the command line does, and keep its results as arrays: `mpp_taichi.run`."""

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from html import escape
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from mpp_taichi.atomic_file import whole_text
from mpp_taichi.errors import CapacityError, MppError
from mpp_taichi.recorders.path_samples import MOST_PLACES, PathSamples
from mpp_taichi.recorders.table import TableRecorder
from mpp_taichi.report import bridges, result_page
from mpp_taichi.report.expectations import Verdict, Watcher
from mpp_taichi.report.summary import Stopwatch, summarize
from mpp_taichi.report.summary_lines import lines
from mpp_taichi.scene import timeline
from mpp_taichi.scene.contacts import LOOKS
from mpp_taichi.scene.expectations import BALANCE_QUANTITIES
from mpp_taichi.scene.load import load_scene
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.simulation import notebook
from mpp_taichi.simulation.recorder import Recorder
from mpp_taichi.simulation.simulation import Simulation
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.views.wall_outline import outline_of

logger = logging.getLogger(__name__)

MOST_NUMBERS = 2**27  # of the positions and velocities that are kept: a gigabyte


def run(
    scene: str | Path | Mapping[str, Any] | SceneSpec,
    *,
    duration: float | None = None,
    steps: int | None = None,
    samples: int = 200,
    overrides: Mapping[str, Any] | Sequence[str] = (),
    backend: str = "auto",
    precision: str | None = None,
    recorders: Sequence[Recorder] = (),
    every: float | None = None,
    call: Callable[[Simulation], object] | None = None,
) -> "Result":
    """Run a scene to its end, or for a `duration` or `steps`, and keep about `samples` moments of it.

    After a run to the scene's own end, the scene's `expect:` is judged as well. `every` and `call` are as in Simulation.run.

    Raises:
        MppError: an error of Simulation or its run; CapacityError where the moments would need more than a gigabyte.
    """
    if samples < 1:
        raise MppError(f"samples must be at least 1, got {samples}")
    stopwatch = Stopwatch()
    read = load_scene(scene, overrides=overrides, interval=None if duration is None else duration / LOOKS)
    read = replace(read, leaves_interval_open=False)
    simulation = Simulation(read, backend=backend, precision=precision)
    try:
        count = _step_count(simulation, duration, steps)
        apart = max(1, -(-count // samples))  # steps between two moments
        kept = (count // apart + 2) * simulation.start.particle_count * 6
        if kept > MOST_NUMBERS:
            raise CapacityError(f"{count // apart + 2} moments are {kept:,} numbers, allowed: {MOST_NUMBERS:,}; fewer samples")
        whole = duration is None and steps is None
        watcher = Watcher(simulation.scene.expect if whole else (), apart)
        if any(each.quantity in BALANCE_QUANTITIES for each in watcher.expectations):
            simulation.keep_energy_balance()
        told = _horizon(simulation, count) if simulation.scene.horizon else {}
        table, moments = TableRecorder(apart), Moments(apart, simulation)
        simulation.run(duration, steps=steps, recorders=[table, moments, watcher, *recorders], every=every, call=call)
        for look in (table, moments, watcher):
            look.finish(simulation)
        for row in table.rows:
            simulation.judge.see(row)
        summary = summarize(simulation, table, stopwatch, plan_asked="auto")
        summary |= told
        verdicts = watcher.verdicts(summary, simulation.device.precision, simulation)
        verdict = simulation.verdict
        summary["status"] = verdict.status if all(each.passed for each in verdicts) else "failed"
        summary["findings"] = [vars(each) for each in verdict.findings]
        return Result(simulation, summary, verdicts, table, moments.seen, moments.paths)
    except BaseException:
        simulation.close()
        raise


def _horizon(simulation: Simulation, steps: int) -> dict[str, Any]:
    """The entry of the summary about the time until which positions are valid."""
    from mpp_taichi.horizon.search import compile_step, find

    compile_step(simulation)
    return {"horizon": find(simulation, timeline.time_after(simulation.scene, steps)).facts()}


def _step_count(simulation: Simulation, duration: float | None, steps: int | None) -> int:
    """The number of steps of the run, from which the interval between samples follows."""
    wanted = simulation.scene.run
    if steps is None and duration is None:
        duration, steps = wanted.duration, wanted.steps if wanted.duration is None else None
    return timeline.step_count(simulation.scene, duration) if duration is not None else int(steps or 0)


class Moments:
    """A recorder that keeps the particles after every `every` steps, and at the end."""

    def __init__(self, every: int, simulation: Simulation) -> None:
        """Begin without a moment."""
        self.every, spec = every, simulation.spec
        self.seen: list[Snapshot] = []
        self.paths: list[dict[str, Any]] = []  # of the moments that a picture's trails show, the last ones
        self._trails = spec.view.trails
        self._samples: PathSamples | None = None
        if self._trails and simulation.start.particle_count <= MOST_PLACES:
            walls = outline_of(spec, simulation.start.position)
            self._samples = PathSamples(spec, every * simulation.dt, walls, _tell_turn)

    def steps_until_due(self, simulation: Simulation) -> int:
        """Steps until the next multiple of `every`, or until the next sample of fast motion."""
        steps = self._steps_to_moment(simulation)
        if self._samples is None:
            return steps
        return min(steps, self._samples.steps_until_due(simulation, simulation.time + steps * simulation.dt))

    def record(self, simulation: Simulation) -> None:
        """Keep the present moment."""
        snapshot, steps = simulation.snapshot(), self._steps_to_moment(simulation)
        if steps > 0 and self._samples is not None:
            self._samples.look(simulation, snapshot, simulation.time + steps * simulation.dt)
        if steps <= 0:
            self._keep(simulation, snapshot)

    def _keep(self, simulation: Simulation, snapshot: Snapshot) -> None:
        self.seen.append(snapshot)
        self.paths.append({} if self._samples is None else self._samples.take(simulation, snapshot, snapshot.time))
        del self.paths[: -self._trails - 1]

    def _steps_to_moment(self, simulation: Simulation) -> int:
        return self.seen[-1].step + self.every - simulation.step_count if self.seen else 0

    def finish(self, simulation: Simulation) -> None:
        """Keep the last moment, unless it has just been kept."""
        if self.seen[-1].step != simulation.step_count:
            self._keep(simulation, simulation.snapshot())


def _tell_turn(name: str, turns: float) -> None:
    logger.warning("%s turns %.2f times between two samples: more samples show its path", name, turns)


class Result:
    """The result of a run: numbers and arrays, and in a notebook a picture of its end.

    simulation   still open, at the end of the run, to be continued; `close` it, or use the result as a context manager
    summary      the facts of `--json`, name → value
    verdicts     the verdict on each entry of `expect:`
    table        column → array: time, energies and errors (sample_count,), momentum, … (sample_count, 3)
    time         of each moment kept, (moment_count,)
    position, velocity   of all particles at each moment, (moment_count, particle_count, 3)
    """

    def __init__(
        self,
        simulation: Simulation,
        summary: dict[str, Any],
        verdicts: Sequence[Verdict],
        table: TableRecorder,
        moments: Sequence[Snapshot],
        paths: Sequence[Mapping[str, Any]] = (),
    ) -> None:
        """Keep the results of a run that has ended."""
        self._paths = tuple(paths)
        self.simulation, self.summary, self.verdicts = simulation, summary, tuple(verdicts)
        self.table: dict[str, np.ndarray] = table.columns()
        self._rows = table.rows
        self.moments = tuple(moments)
        self.time = np.array([snapshot.time for snapshot in moments])
        self.position = np.array([snapshot.position for snapshot in moments])
        self.velocity = np.array([snapshot.velocity for snapshot in moments])

    @property
    def passed(self) -> bool:
        """Whether every expectation was met; True without any."""
        return all(verdict.passed for verdict in self.verdicts)

    def __str__(self) -> str:
        """The closing summary of the command line."""
        return "\n".join(lines(self.summary, verdicts=self.verdicts))

    __repr__ = __str__

    def _repr_png_(self) -> bytes | None:
        return notebook.png(self.simulation, earlier=self.moments[:-1], paths=self._paths) if self._shows_its_end else None

    def _repr_html_(self) -> str:
        """The page that plays the run, or the picture where it is too large, and the summary.

        With a page the picture lies folded below: a viewer without scripts shows no page.
        """
        told, played = f"<pre>{escape(str(self))}</pre>", result_page.frame(self.simulation, self.moments, self._rows)
        if not played:
            return notebook.figure(self._repr_png_(), told)
        picture = self._repr_png_()
        folded = f"<details><summary>picture</summary>{notebook.image(picture)}</details>" if picture else ""
        return f"<figure>{played}{folded}<figcaption>{told}</figcaption></figure>"

    def page(self, path: str | Path | None = None, *, size: tuple[int, int] = result_page.SIZE) -> str:
        """The moments as one page that a browser plays, as text; with a `path` it is written there as well.

        Raises:
            MppError: the page would hold too much, or cannot be written.
        """
        made = result_page.page(self.simulation, self.moments, self._rows, size)
        if path is not None:
            whole_text(Path(path), made, "the page")
        return made

    def to_pandas(self, *, particles: bool = False) -> Any:
        """The table as a pandas DataFrame by time; or, of the `particles`, a row for each at each moment.

        Raises:
            MissingPackageError: this Python has no pandas.
        """
        return bridges.to_pandas(self, particles=particles)

    def to_xarray(self) -> Any:
        """Moments and table as an xarray Dataset with the dimensions time, particle and axis.

        Raises:
            MissingPackageError: this Python has no xarray.
        """
        return bridges.to_xarray(self)

    @property
    def _shows_its_end(self) -> bool:
        """Whether the simulation is still at the end of the run."""
        return self.simulation.step_count == self.moments[-1].step

    def close(self) -> None:
        """Free the device memory; the arrays stay."""
        self.simulation.close()

    def __enter__(self) -> "Result":
        """Use as a context manager."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        """Close at the end of the block."""
        self.close()
