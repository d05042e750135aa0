"""Rewind: continue from a good state of a run that blew up or was interrupted, with a stable step.

The state is the last good record of the archive of the run, with all that the method remembers; or, where there is no archive,
the state of a file `.crash.npz` or `.interrupted.npz`, or of any file that is named. A rewound run keeps an archive of its own,
in the place of the old archive: its header has the state from which it began, so that the same command goes on with it.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mpp_taichi.cli._differences import differences
from mpp_taichi.cli._goal import Goal
from mpp_taichi.cli._options import OUTPUT_FOLDER, archive_path, output_stem
from mpp_taichi.cli._terminal import UsageError
from mpp_taichi.errors import MppError, OutputError, StateError
from mpp_taichi.scene import timeline
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.simulation.moment import forget_history, go_to
from mpp_taichi.simulation.run_archive import FoundRun
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.wording.told_apart import told_apart

if TYPE_CHECKING:
    from mpp_taichi.simulation.simulation import Simulation

CRASH, INTERRUPTED, ARCHIVE = ".crash.npz", ".interrupted.npz", ".run"
# Keys of a scene that may be others than in the archive from which a run is rewound.
FREE = ("integrator", "title", "run", "view", "record", "inspect", "expect", "horizon")


@dataclass(frozen=True, eq=False)
class Rewind:
    """The state to continue from, its file, and whether the command line gives the step.

    state       particles with which the run begins, of a file `.npz`; None for a record of an archive
    record      the record of an archive: its `time`, `step` and `moment`, the `dt` of the run, and whether it `broke_down`
    goes_on     whether the rewound run itself wrote the archive of the scene, and was cut off
    """

    state: Snapshot | None
    file: Path
    step_is_given: bool
    record: Mapping[str, Any] | None = None
    goes_on: bool = False

    @staticmethod
    def of(spec: SceneSpec, said: str, overrides: list[str], *, fresh: bool = False) -> "Rewind":
        """Read the given file, or else the archive or the newest state that a run of the scene has left.

        Raises:
            UsageError: no such file exists, or it is an archive without a good record.
            OutputError: the file cannot be read.
        """
        given = any(word.strip().startswith("integrator") for word in overrides)
        kept = archive_path(spec.source)
        earlier = _begun(kept)
        if earlier is not None and said in ("", earlier["file"]):
            file, record = Path(earlier["file"]), earlier["record"]
            state = Snapshot.load(file) if record is None else None
            return Rewind(state, file, given, record, goes_on=not fresh)
        file = Path(said) if said else _newest(spec)
        if not file.is_file():
            raise UsageError(f"--rewind {file}: there is no such file")
        if file.suffix == ARCHIVE:
            record, why = _good_record(file, spec)
            if record is None:
                raise UsageError(f"--rewind {file}: {why}")
            return Rewind(None, file, given, record)
        return Rewind(Snapshot.load(file), file, given)

    @property
    def broke_down(self) -> bool:
        """Whether the run that left the state broke down because of its step."""
        return self.file.name.endswith(CRASH) if self.record is None else bool(self.record["broke_down"])

    @property
    def time(self) -> float:
        """The time of the state."""
        return float(self.state.time if self.state is not None else self._of_record("time"))

    @property
    def dt(self) -> float | None:
        """The step of the run that left the state, where that is known."""
        return self.state.dt if self.state is not None else float(self._of_record("dt"))

    @property
    def step(self) -> int:
        """The number of the steps before the state."""
        return int(self.state.step if self.state is not None else self._of_record("step"))

    def _of_record(self, key: str) -> Any:
        assert self.record is not None
        return self.record[key]

    @property
    def header(self) -> dict[str, Any]:
        """What the header of the archive of the rewound run has, so that it can begin in the same way again."""
        return {"rewound": {"file": str(self.file), "record": None if self.record is None else dict(self.record)}}

    def choose_step(self, simulation: "Simulation") -> str:
        """Take the simulation to the record, set its dt to a stable step, and return a line with this step and the reason.

        Raises:
            StateError: the record is of another run.
        """
        if self.record is not None:
            try:
                go_to(simulation, self.record["moment"])
            except StateError as error:
                raise StateError(f"--rewind {self.file}: {error}") from None
            simulation.judge.restart()  # what it found is of the run that broke down
            simulation.dt = simulation.phase.phase.dt  # the step of the scene, which the record may not have
        told = self._choose(simulation)
        if self.record is not None and simulation.dt != self.dt:
            forget_history(simulation)
        return told

    def _choose(self, simulation: "Simulation") -> str:
        advice = simulation.step_advice
        reason = "as the scene says"
        lowered = self.dt is not None and simulation.dt < self.dt * (1.0 - 1e-9)
        repeated = self.broke_down and simulation.dt == self.dt
        if self.step_is_given and not repeated:
            reason = "as --set says"
        elif self.broke_down and advice is not None and simulation.dt > advice.safe_limit > 0.0:
            reason = f"{advice.integrator} allows {advice.safe_limit:.6g} in any arrangement of the springs"
            simulation.dt = advice.holding_step
        elif self.broke_down and not lowered:
            reason = f"half of {simulation.dt:.6g}, with which the run broke down"
            simulation.dt *= 0.5
        return f"{self.file}, t = {self.time:.9g}, on with dt {simulation.dt:.6g}: {reason}"

    def goal(self, goal: Goal, simulation: "Simulation", *, beyond: bool = False) -> Goal:
        """The rest of the run: to the end of the original run, or for the number of steps asked for.

        With `beyond`, a state at the end goes on without an end.

        Raises:
            UsageError: the state is already at the end.
        """
        begin = simulation.time
        if goal.endless:
            return Goal(None, None, False, begin, str(self.file))
        end = goal.until
        if end is None and goal.whole:
            end = self._end_of_scene(simulation, (goal.steps or 0) - self.step)
        elif end is None:
            end = begin + (goal.steps or 0) * simulation.dt
        if end <= begin * (1.0 + 1e-12):
            if beyond:
                return Goal(None, None, False, begin, str(self.file))
            now, last = told_apart(begin, end, digits=9)
            raise UsageError(f"--rewind {self.file}: its time {now} is not before the end of the run, {last}")
        return Goal(end, None, False, begin, str(self.file))

    def _end_of_scene(self, simulation: "Simulation", left: int) -> float:
        """The time at which the run that left the state would have ended, with `left` more steps."""
        if len(simulation.phases) > 1:
            return timeline.time_after(simulation.phases[0].spec, left, simulation.time)
        return simulation.time + left * (self.dt or simulation.dt)


def _newest(spec: SceneSpec) -> Path:
    """The archive of the scene, or the newest state of a run that left none."""
    files = [OUTPUT_FOLDER / f"{output_stem(spec.source)}{suffix}" for suffix in (CRASH, INTERRUPTED)]
    found = [file for file in files if file.is_file()]
    newest = max(found, key=lambda file: file.stat().st_mtime_ns, default=None)
    archive = archive_path(spec.source)
    record, why = _good_record(archive, spec) if archive.is_file() else (None, "")
    if record is not None and (newest is None or not _is_of_later_run(newest, archive, record)):
        return archive
    if newest is None:
        also = f", and {archive}: {why}" if why else ""
        raise UsageError(
            f"--rewind: there is nothing to go on from, neither {files[0]} nor {files[1]}{also}; --rewind FILE names one"
        )
    return newest


def _is_of_later_run(state: Path, archive: Path, record: Mapping[str, Any]) -> bool:
    """Whether a later run than the run of the archive wrote the state; the last record of a run may be older than its state."""
    if state.stat().st_mtime_ns <= archive.stat().st_mtime_ns:
        return False
    try:
        found = Snapshot.load(state)
    except OutputError:
        return False
    return (found.step, found.time) != (record["step"], record["time"])


def _begun(path: Path) -> dict[str, Any] | None:
    """How the rewound run began whose archive this is; None where it is no archive of a rewound run that was cut off."""
    found = _opened(path)
    if found is None:
        return None
    try:
        rewound = found.header.get("rewound")
        return None if found.has_ended or not isinstance(rewound, dict) else rewound
    finally:
        found.close()


def _good_record(path: Path, spec: SceneSpec) -> tuple[dict[str, Any] | None, str]:
    """The last good record of an archive, or the reason why there is none for this scene."""
    found = _opened(path)
    if found is None:
        return None, "is no archive of a run"
    try:
        mine = {key: value for key, value in spec.resolved.items() if key not in FREE}
        other = differences({key: value for key, value in found.header.get("scene", {}).items() if key not in FREE}, mine)
        if other:
            return None, f"is of another scene ({other[0]})"
        broke_at = found.broke_at
        if found.has_ended and broke_at is None:
            return None, "the run came to its end"
        state = found.last_before(broke_at)
        if state is None:
            return None, "it has no record from before the blow-up"
        dt = state["moment"]["clock"][-1]
        facts = {key: state[key] for key in ("time", "step", "moment")}
        return {**facts, "dt": dt, "broke_down": broke_at is not None}, ""
    except (MppError, LookupError, TypeError, AttributeError) as error:
        return None, f"is damaged: {error!r}"
    finally:
        found.close()


def _opened(path: Path) -> FoundRun | None:
    try:
        return FoundRun(path, to_append=False) if path.is_file() else None
    except StateError:
        return None
