"""Comparison: a scene on every backend, each in its own process: first whether they agree, then their times."""

import importlib.metadata
import os
import platform
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from mpp_taichi.accuracy.budget import Budget
from mpp_taichi.archive.journal import Journal
from mpp_taichi.compare import busy, scaling
from mpp_taichi.compare.agreement import Agreement
from mpp_taichi.compare.certificate import Judge
from mpp_taichi.compare.course import CHANCE
from mpp_taichi.compare.kept_worker import KeptWorker
from mpp_taichi.compare.process import WorkerError, WorkerProcess, empty_cache
from mpp_taichi.compare.row import BackendRow, described, peak_of
from mpp_taichi.compare.work import work_of
from mpp_taichi.device.availability import BACKENDS, TAICHI_VERSION, availability, cpu_name
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.start.assemble import assemble

ALL_BACKENDS = (*BACKENDS, "opencl", "numpy")
PRECISIONS = {"numpy": ("f64",)}  # of a backend that has only one of them
# Ways to sum over pairs, the simplest first, besides the default of a backend.
LADDER = {"cpu": ("serial", "parallel"), "opencl": ("naive", "tiled", "vectors", "third_law")}
REPEATS = 7
LEAST_REPEATS = 3
PATIENCE = 60.0  # seconds beyond the budget that a worker may take to answer
LEAST_LEFT = 0.25  # of the budget, however long the start of the backends took
# The ends of certificate, times and (where asked for) scaling, as shares of the budget left after the start.
SHARES = {False: (0.55, 0.75, 1.0), True: (0.15, 0.3, 0.9)}
SPENT = "seconds"  # key of the journal: the time that was spent
NOT_FOR_WORKERS = ("timeline", "accuracy", "expect", "record", "inspect", "sliders", "view")


def pyopencl_version() -> str | None:
    """The version of pyopencl; None where it is not installed."""
    try:
        return importlib.metadata.version("pyopencl")
    except importlib.metadata.PackageNotFoundError:
        return None


@dataclass(frozen=True)
class ComparisonWishes:
    """The options of a comparison."""

    backends: Sequence[str] = ALL_BACKENDS
    precisions: Sequence[str] = ("f64", "f32")
    threads: int | None = None
    scaling: bool = False
    ladder: bool = False
    most_steps: int | None = None  # of the trajectories


class Comparison:
    """Runs the parts in turn; `facts` are available at any time.

    What was measured, and what was decided by the clock, is kept in a journal: a comparison that was cut off takes it from
    there, with the time that it took.
    """

    def __init__(
        self,
        spec: SceneSpec,
        wishes: ComparisonWishes,
        budget: Budget,
        tell: Callable[[str], None],
        *,
        journal: Journal,
        files: Path,
    ) -> None:
        """Make the initial state of all backends; `files` is a folder for files of the workers, which is removed at the end."""
        self.journal, self._files = journal, files.absolute()  # a worker runs in the folder of the scene
        budget.wait(journal.get(SPENT) or 0.0)
        self.spec, self.wishes, self.budget, self._tell = spec, wishes, budget, tell
        self.start = assemble(spec)
        self.judge = Judge(spec, self.start, float(spec.integrator.parameters["dt"]))
        self.rows: list[BackendRow] = []
        self.agreement: Agreement | None = None
        self.remarks: list[str] = []
        self.load = os.getloadavg()[0] if hasattr(os, "getloadavg") else None
        self.scene = {key: value for key, value in spec.resolved.items() if key not in NOT_FOR_WORKERS}
        self.folder = str(Path(spec.source).resolve().parent)

    def run(self) -> None:
        """Run all parts; afterwards every process has ended."""
        shutil.rmtree(self._files, ignore_errors=True)  # of a comparison that was killed
        self._files.mkdir(parents=True)
        try:
            self._open_all()
            opened = self._once("the start", lambda: self.budget.spent)
            left = max(self.budget.seconds - opened, LEAST_LEFT * self.budget.seconds)
            judged, timed, scaled = (opened + share * left for share in SHARES[self.wishes.scaling])
            self._certify(judged)
            self._time(timed)
            self._probe()
            if self.wishes.scaling:
                self._scale(scaled)
            self._end_all()
            self._warm()
        finally:
            for row in self.running:
                row.process.kill()  # type: ignore[union-attr]
                row.process = None
            shutil.rmtree(self._files, ignore_errors=True)

    def _once(self, key: str, find: Callable[[], Any]) -> Any:
        """What an earlier, unfinished comparison has found or decided; else it is found now, and kept."""
        found = self.journal.get(key)
        if found is None:
            found = find()
            self.journal.put(key, found)
            self._note_time()
        return found

    def _note_time(self) -> None:
        self.journal.put(SPENT, self.budget.spent)

    @property
    def running(self) -> list[BackendRow]:
        """Rows whose process is running."""
        return [row for row in self.rows if row.process is not None]

    # Parts of the comparison

    def _open_all(self) -> None:
        self.start.save(self._files / "start.npz")
        for backend in self.wishes.backends:
            reason = ""
            if backend in BACKENDS and not (report := availability(backend))["available"]:
                reason = f"does not start here: {report['reason']}"
            precisions = [each for each in self.wishes.precisions if each in PRECISIONS.get(backend, (each,))]
            if not precisions:
                reason = f"computes only in {', '.join(PRECISIONS[backend])}"
            if reason:
                self.rows.append(BackendRow(backend, "", "missing", reason))
                continue
            for variant in ("", *(LADDER.get(backend, ()) if self.wishes.ladder else ())):
                for precision in precisions:
                    self._open(BackendRow(backend, precision, variant=variant))

    def _open(self, row: BackendRow) -> None:
        self.rows.append(row)
        try:
            row.process = self._process(row)
            row.facts = self._build(row)
        except WorkerError as error:
            row.give_up(str(error), "missing")

    def _process(self, row: BackendRow) -> KeptWorker:
        return KeptWorker(row.name, lambda: self._started(row), self.journal, self._note_time)

    def _started(self, row: BackendRow) -> WorkerProcess:
        self._tell(f"starting {row.name}")
        cache = self._files / f"cache-{row.name.replace(' ', '-')}"
        return WorkerProcess(self._files, cache if cache.is_dir() else empty_cache(cache), self.budget.look)

    def _build(self, row: BackendRow, scene: dict | None = None) -> dict[str, Any]:
        assert row.process is not None
        answer = row.process.ask(
            "build",
            self._patience,
            scene=scene or self.scene,
            folder=self.folder,
            start=None if scene else str(self._files / "start.npz"),
            backend=row.backend,
            precision=row.precision,
            threads=self.wishes.threads,
            variant=row.variant,
        )
        facts: dict[str, Any] = answer["facts"]
        software = row.backend in BACKENDS and row.backend != "cpu" and availability(row.backend)["software"]
        return {**facts, "on_processor": facts.pop("on_cpu") or software}

    def _certify(self, end: float) -> None:
        for row in self.running:
            share = max(0.1, (end - self.budget.spent) / (8 * len(self.running)))
            row.seconds_per_step = (self._ask(row, "calibrate", seconds=share) or {}).get("seconds_per_step", 0.0)
        self.agreement = Agreement(self.judge, self._files, self._ask, self.budget, self._tell, self._once)
        self.agreement.certify(self.running, self.wishes.precisions, self.wishes.most_steps, end)
        self.remarks += self.agreement.remarks

    def _time(self, end: float) -> None:
        """Time steps and copies, all rows in turn, round after round."""
        for repeat in range(REPEATS):
            self._tell(f"timing, round {repeat + 1} of {REPEATS}")
            for row in self.running:
                if (answer := self._ask(row, "time")) is not None:
                    row.step_samples.append(answer["seconds_per_step"])
                    if answer["joules_per_step"] is not None:
                        row.joule_samples.append(answer["joules_per_step"])
                if row.process is not None and (answer := self._ask(row, "copy")) is not None:
                    row.copy_samples.append(answer["seconds"])
            if repeat + 1 >= LEAST_REPEATS and self.budget.spent > end:
                self.remarks.append(f"times are medians of {repeat + 1} repeats, for want of time")
                break

    def _probe(self) -> None:
        for row in self.running:
            self._tell(f"measuring what the device of {row.name} reaches")
            row.peaks = self._ask(row, "peaks") or {}

    def _end_all(self) -> None:
        for row in self.running:
            row.process.ask_to_end()  # type: ignore[union-attr]
        for row in self.running:
            row.process.end()  # type: ignore[union-attr]
            row.filled_cache = row.process.started  # type: ignore[union-attr]
            row.process = None

    def _warm(self) -> None:
        """Time the same start again, with the compilers' caches of the first start."""
        for row in self.rows:
            if row.status != "ok" or row.backend == "numpy":
                continue
            key = f"{row.name}: a second start"
            row.warm_compile_seconds = self.journal.get(key)
            if row.warm_compile_seconds is not None:
                continue
            if self.budget.left() < 0.0:
                self.remarks.append("warm compilation was not measured for all: the budget ended")
                return
            try:
                if not row.filled_cache:  # the first start was that of another process, whose cache is gone
                    self._start_anew(row)
                row.warm_compile_seconds = self._start_anew(row)
                self.journal.put(key, row.warm_compile_seconds)
                self._note_time()
            except WorkerError as error:
                self.remarks.append(f"{row.name} did not start a second time: {error}")

    def _start_anew(self, row: BackendRow) -> float:
        """Start and end a worker; returns the seconds of its compilation."""
        row.process = self._started(row)
        try:
            seconds: float = self._build(row)["compile_seconds"]
            return seconds
        finally:
            row.process.end()
            row.process = None

    def _scale(self, end: float) -> None:
        """Times of generated scenes of the same effects, of more and more particles, all rows in turn at each number."""
        reason = scaling.refusal(self.spec)
        if reason:
            self.remarks.append(f"no scaling: {reason}")
            return
        left = self.running
        walls: dict[BackendRow, list[float]] = {row: [] for row in left}
        for count in scaling.COUNTS:
            for row in list(left):
                began = self.budget.spent
                if not scaling.fits(row.scaling, walls[row], count, (end - began) / max(1, len(left))):
                    left.remove(row)
                    continue
                self._tell(f"{row.name}, {count:,} particles")
                try:
                    self._build(row, scaling.scene_of(self.spec, self.start, count))
                    found = row.process.ask("calibrate", self._patience, seconds=1.0)  # type: ignore[union-attr]
                    row.scaling.append((count, found["seconds_per_step"]))
                    walls[row].append(self.budget.spent - began)
                except WorkerError as error:
                    self.remarks.append(f"{row.name} with {count:,} particles: {error}")
                    left.remove(row)

    def _ask(self, row: BackendRow, command: str, **fields: Any) -> dict[str, Any] | None:
        """The answer of a row's process; None without an answer, with the reason in the row."""
        assert row.process is not None
        try:
            return row.process.ask(command, self._patience, **fields)
        except WorkerError as error:
            row.give_up(str(error))
            return None

    @property
    def _patience(self) -> float:
        return max(0.0, self.budget.left()) + PATIENCE

    # Results

    @property
    def bugs(self) -> list[BackendRow]:
        """Rows that differ by more than rounding."""
        return [row for row in self.rows if row.certificate.get("verdict") == "bug"]

    def facts(self) -> dict[str, Any]:
        """Everything as plain data."""
        evaluations = next((row.facts["evaluations"] for row in self.rows if row.facts.get("evaluations")), None)
        work = work_of(self.spec, self.start, evaluations)
        spreads = {row.name: row.step_spread for row in self.rows if row.step_spread is not None}
        return {
            "scene": self.spec.source,
            "title": self.spec.title,
            "particle_count": work.particles,
            "spring_count": work.springs,
            "effects": self.spec.effects(work.springs),
            "integrator": self.spec.integrator.name,
            "dt": self.judge.dt,
            "evaluations_per_step": work.evaluations,
            "interactions_per_step": work.interactions,
            "chance_of_false_alarm": CHANCE,
            "steps_compared": 0 if self.agreement is None else self.agreement.steps,
            "rows": [described(row, work, peak_of(self.rows, row)) for row in self.rows],
            "crossovers": scaling.crossovers({row.name: row.scaling for row in self.rows if row.scaling}),
            "warnings": busy.warnings(self.load, os.cpu_count() or 1, spreads),
            "remarks": self.remarks,
            "load_average": self.load,
            "budget_seconds": self.budget.seconds,
            "spent_seconds": self.budget.spent,
            "known": {
                "cpu": cpu_name(),
                "processors": os.cpu_count(),
                "system": f"{platform.system()} {platform.release()} {platform.machine()}",
                "python": platform.python_version(),
                "numpy": np.__version__,
                "taichi": TAICHI_VERSION,
                "pyopencl": pyopencl_version(),
            },
            "status": "bug" if self.bugs else "ok",
        }
