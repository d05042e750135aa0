"""Validity: the horizon of a session's run, found before the run where the scene asks for it, for captions and tables."""

from dataclasses import replace
from typing import TYPE_CHECKING, Any

from mpp_taichi.cli._signals import Interrupted, Interruption

if TYPE_CHECKING:
    from mpp_taichi.cli._goal import Goal
    from mpp_taichi.horizon.horizon import Horizon
    from mpp_taichi.report.summary import Stopwatch
    from mpp_taichi.simulation.simulation import Simulation


class Validity:
    """What is known of the horizon of a run; nothing where the scene does not ask for it, or the run has no end."""

    def __init__(self, horizon: "Horizon | None" = None) -> None:
        """Keep a horizon."""
        self.horizon = horizon

    @staticmethod
    def of(simulation: "Simulation", goal: "Goal", stopwatch: "Stopwatch", interruption: Interruption) -> "Validity":
        """Search for the horizon of a run that has not begun; the simulation is at its start again afterwards."""
        scene = simulation.scene
        if not scene.horizon or goal.endless:
            return Validity()
        from mpp_taichi.horizon.search import compile_step, find

        until = simulation.time + goal.span(scene)
        compile_step(simulation)
        try:
            with stopwatch("horizon"):
                return Validity(find(simulation, until, look=interruption.raise_if_any))
        except Interrupted:
            return Validity()  # the run, which begins next, ends with the same signal

    def forget(self) -> None:
        """Parameters were changed while the scene ran, so that this is another run than the one that was searched."""
        if self.horizon is not None and self.horizon.found != "unknown":
            self.horizon = replace(self.horizon, found="unknown", time=None, reason="parameters were changed while it ran")

    def caption(self) -> str:
        """A line for captions; empty where no time before the end is known."""
        return self.horizon.caption() if self.horizon else ""

    def is_beyond(self, time: float) -> bool:
        """Whether positions at a time have lost their meaning."""
        return self.horizon is not None and self.horizon.is_beyond(time)

    def number(self, time: float) -> float:
        """1 where positions at a time are valid, 0 where they are not, NaN where the horizon is unknown."""
        assert self.horizon is not None
        return float("nan") if self.horizon.found == "unknown" else float(not self.is_beyond(time))

    def summary(self) -> dict[str, Any]:
        """The entry of the summary."""
        return {"horizon": self.horizon.facts()} if self.horizon else {}
