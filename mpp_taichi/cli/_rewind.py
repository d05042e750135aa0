"""Rewind: continue from the last state of a run that blew up or was interrupted, with a stable step."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from mpp_taichi.cli._goal import Goal
from mpp_taichi.cli._options import OUTPUT_FOLDER, output_stem
from mpp_taichi.cli._terminal import UsageError
from mpp_taichi.scene import timeline
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.wording.told_apart import told_apart

if TYPE_CHECKING:
    from mpp_taichi.simulation.simulation import Simulation

CRASH, INTERRUPTED = ".crash.npz", ".interrupted.npz"


@dataclass(frozen=True, eq=False)
class Rewind:
    """The state to continue from, its file, and whether the command line gives the step."""

    state: Snapshot
    file: Path
    step_is_given: bool

    @staticmethod
    def of(spec: SceneSpec, said: str, overrides: list[str]) -> "Rewind":
        """Read the given file, or else the newest state that a run of the scene has left.

        Raises:
            UsageError: no such file exists.
            OutputError: the file cannot be read.
        """
        file = Path(said) if said else _newest(spec)
        if not file.is_file():
            raise UsageError(f"--rewind {file}: there is no such file")
        given = any(word.strip().startswith("integrator") for word in overrides)
        return Rewind(Snapshot.load(file), file, given)

    @property
    def broke_down(self) -> bool:
        """Whether the run that left the state broke down because of its step."""
        return self.file.name.endswith(CRASH)

    def choose_step(self, simulation: "Simulation") -> str:
        """Set the simulation's dt to a stable step, and return a line that gives this step and the reason."""
        advice = simulation.step_advice
        reason = "as the scene says"
        lowered = self.state.dt is not None and simulation.dt < self.state.dt * (1.0 - 1e-9)
        repeated = self.broke_down and simulation.dt == self.state.dt
        if self.step_is_given and not repeated:
            reason = "as --set says"
        elif self.broke_down and advice is not None and simulation.dt > advice.safe_limit > 0.0:
            reason = f"{advice.integrator} allows {advice.safe_limit:.6g} in any arrangement of the springs"
            simulation.dt = advice.holding_step
        elif self.broke_down and not lowered:
            reason = f"half of {simulation.dt:.6g}, with which the run broke down"
            simulation.dt *= 0.5
        return f"{self.file}, t = {self.state.time:.9g}, on with dt {simulation.dt:.6g}: {reason}"

    def goal(self, goal: Goal, simulation: "Simulation") -> Goal:
        """The rest of the run: to the end of the original run, or for the number of steps asked for.

        Raises:
            UsageError: the state is already at the end.
        """
        begin = simulation.time
        if goal.endless:
            return Goal(None, None, False, begin)
        end = goal.until
        if end is None and goal.whole:
            end = self._end_of_scene(simulation, (goal.steps or 0) - self.state.step)
        elif end is None:
            end = begin + (goal.steps or 0) * simulation.dt
        if end <= begin * (1.0 + 1e-12):
            now, last = told_apart(begin, end, digits=9)
            raise UsageError(f"--rewind {self.file}: its time {now} is not before the end of the run, {last}")
        return Goal(end, None, False, begin)

    def _end_of_scene(self, simulation: "Simulation", left: int) -> float:
        """The time at which the run that left the state would have ended, with `left` more steps."""
        if len(simulation.phases) > 1:
            return timeline.time_after(simulation.phases[0].spec, left, simulation.time)
        return simulation.time + left * (self.state.dt or simulation.dt)


def _newest(spec: SceneSpec) -> Path:
    files = [OUTPUT_FOLDER / f"{output_stem(spec.source)}{suffix}" for suffix in (CRASH, INTERRUPTED)]
    found = [file for file in files if file.is_file()]
    if not found:
        raise UsageError(
            f"--rewind: there is nothing to go on from, neither {files[0]} nor {files[1]}; --rewind FILE names one"
        )
    return max(found, key=lambda file: file.stat().st_mtime_ns)
