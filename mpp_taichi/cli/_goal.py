"""Goal: how long a run is, by the command line or else by the scene, checked before anything is computed."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from mpp_taichi.cli._terminal import UsageError
from mpp_taichi.errors import CapacityError
from mpp_taichi.scene import timeline
from mpp_taichi.scene.estimate import MOST_STEPS
from mpp_taichi.scene.spec import SceneSpec

if TYPE_CHECKING:
    from mpp_taichi.simulation.simulation import Simulation


@dataclass(frozen=True)
class Goal:
    """The length of a run: to `until` [time] or for `steps` steps; both None for a run without an end."""

    until: float | None
    steps: int | None
    whole: bool  # the full duration of the scene, for which its expectations hold
    begin: float = 0.0  # time at which the run starts
    state: str = ""  # file of the state or the archive with which the run starts; empty for the start of the scene

    @staticmethod
    def of(spec: SceneSpec, until: float | None, steps: int | None) -> "Goal":
        """The end that the command line gives by one of `until` and `steps`, or else the end that the scene gives."""
        own = Goal(spec.run.duration, spec.run.steps if spec.run.duration is None else None, True)
        if until is None and steps is None:
            return own
        asked = Goal(until, steps, False)
        return own if (asked.until, asked.steps) == (own.until, own.steps) else asked

    @property
    def endless(self) -> bool:
        """Whether the run has no end."""
        return self.until is None and self.steps is None

    def span(self, spec: SceneSpec) -> float:
        """Simulated time of the run [time]."""
        end = self.until if self.until is not None else timeline.time_after(spec, self.steps or 0, self.begin)
        return end - self.begin

    def step_count(self, spec: SceneSpec) -> int | None:
        """Steps of the run, or None without an end."""
        if self.until is not None:
            return max(1, timeline.step_count(spec, self.until) - timeline.step_count(spec, self.begin))
        return self.steps

    def is_reached(self, simulation: "Simulation") -> bool:
        """Whether the simulation has come to the end."""
        if self.until is not None:
            return simulation.time >= self.until * (1.0 - 1e-12)
        return self.steps is not None and simulation.step_count >= self.steps

    def check(self, spec: SceneSpec, *, may_be_endless: bool) -> None:
        """Refuse a run without an end, and a run of more than MOST_STEPS steps.

        Raises:
            UsageError: neither the scene nor the command line gives an end.
            CapacityError: the run takes too many steps.
        """
        if self.endless and not may_be_endless:
            raise UsageError(f"{spec.source}: the scene has no run.duration: say how long, --until T or --steps N")
        steps = self.step_count(spec)
        if steps is not None and steps > MOST_STEPS:
            raise CapacityError(
                f"{spec.source}: the run takes {steps:.3g} steps, allowed: {MOST_STEPS:,}; enlarge dt or shorten the run"
            )
