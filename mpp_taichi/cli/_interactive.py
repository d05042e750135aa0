"""A window on a run: how the simulation of a session is steered frame by frame."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from mpp_taichi.scene import timeline
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.views._base import Frame
from mpp_taichi.walls.outline import outline_of

if TYPE_CHECKING:
    from mpp_taichi.cli._request import Goal
    from mpp_taichi.cli._signals import Interruption
    from mpp_taichi.simulation import Simulation

WINDOW_FRAMES_PER_SECOND = 60
STEPS_PER_FRAME_WITHOUT_END = 10


def show(
    simulation: "Simulation",
    spec: SceneSpec,
    goal: "Goal",
    recorders: Sequence[Any],
    interruption: "Interruption",
    caption: Callable[[], str],
) -> None:
    """Open a window and run in it until it is closed; the scene's duration takes as long as its film would."""
    from mpp_taichi.views.window import Window

    window = Window(spec.view, title=spec.title, dimensions=spec.dimensions)
    total = goal.step_count(spec)
    frames = max(1, round(spec.record.seconds * WINDOW_FRAMES_PER_SECOND))
    steps = max(1, round(total / frames)) if total else STEPS_PER_FRAME_WITHOUT_END
    window.run(_Steered(simulation, spec, goal, recorders, interruption, caption), steps_per_frame=steps)


class _Steered:
    """What the window steers: the simulation, with the recorders of the session looking on.

    The end of the run is reached exactly; single steps beyond it are allowed. A restart starts the recorders afresh as well.
    """

    def __init__(
        self,
        simulation: "Simulation",
        spec: SceneSpec,
        goal: "Goal",
        recorders: Sequence[Any],
        interruption: "Interruption",
        caption: Callable[[], str] = lambda: "",
    ) -> None:
        self.simulation, self.spec, self.goal, self.interruption = simulation, spec, goal, interruption
        self.recorders, self.caption = recorders, caption
        self._walls = outline_of(spec, simulation.start.position)

    @property
    def finished(self) -> bool:
        """Asked once a frame, and so also where a signal is noticed while the run is paused."""
        self.interruption.raise_if_any()
        return self.goal.is_reached(self.simulation)

    def advance(self, steps: int) -> None:
        """Go on by so many steps, and to the end exactly."""
        until, left = self.goal.until, self.goal.steps
        if not self.goal.is_reached(self.simulation):
            time, dt = self.simulation.time, self.simulation.dt
            if until is not None and timeline.time_after(self.spec, steps, time) + 1e-9 * dt >= until:
                self.simulation.run(until=until, recorders=self.recorders)
                return
            if left is not None:
                steps = min(steps, left - self.simulation.step_count)
        self.simulation.run(steps=steps, recorders=self.recorders)

    def frame(self) -> Frame:
        """The particles now."""
        return Frame.of(self.simulation.snapshot(), title=self.spec.title, extra=self.caption(), walls=self._walls)

    def restart(self) -> None:
        """Back to the start."""
        self.simulation.restart()
        for recorder in self.recorders:
            recorder.restart()
