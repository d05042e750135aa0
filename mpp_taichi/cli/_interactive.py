"""A window on a run: how the simulation of a session is steered frame by frame."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from mpp_taichi.cli._options import output_stem
from mpp_taichi.cli._window_desk import SessionDesk
from mpp_taichi.errors import BackendError, OutputError
from mpp_taichi.scene import timeline
from mpp_taichi.scene.human_units import TimeScale
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.views._base import Frame
from mpp_taichi.views.numbered import numbered
from mpp_taichi.views.pace import FRAMES_PER_SECOND
from mpp_taichi.views.wall_outline import outline_of

if TYPE_CHECKING:
    from mpp_taichi.cli._goal import Goal
    from mpp_taichi.cli._request import Request
    from mpp_taichi.cli._signals import Interruption
    from mpp_taichi.cli._start_simulation import Started
    from mpp_taichi.cli._window_desk import Starter
    from mpp_taichi.recorders.inspection import InspectionRecorder
    from mpp_taichi.simulation.history import History
    from mpp_taichi.simulation.simulation import Simulation

STEPS_PER_FRAME_WITHOUT_END = 10
EXPORTED = (".csv", ".svg")


@dataclass(frozen=True, eq=False)
class Stage:
    """A started simulation and a window of GGUI, handed from one scene to the next scene opened in the same window."""

    started: "Started"
    glass: Any


def show(
    simulation: "Simulation",
    spec: SceneSpec,
    goal: "Goal",
    recorders: Sequence[Any],
    interruption: "Interruption",
    caption: Callable[[], str],
    inspection: "InspectionRecorder | None" = None,
    *,
    start: "Starter | None" = None,
    glass: Any = None,
    lost: Callable[[str, Snapshot], int] = lambda display, state: BackendError.exit_code,
    request: "Request",
) -> "Stage | None":
    """Open a window, or take over the window of another scene, and run until it is closed or another scene is opened.

    The window shows the scene's duration in the time that its film would take. `start` makes the simulation of another file.
    Where the display goes away, `lost` is given its name and the last state, and the process ends with the code it returns.
    """
    from mpp_taichi.views.display_loss import DisplayLoss
    from mpp_taichi.views.window import Window
    from mpp_taichi.views.window_panels import WindowPanels

    panels = None
    if inspection is not None:
        panels = WindowPanels(inspection.inspector.plots, spec.record, lambda: exported(inspection, output_stem(spec.source)))
    desk = SessionDesk(simulation, goal, recorders, start)
    total = goal.step_count(spec)
    frames = spec.record.seconds * FRAMES_PER_SECOND
    steps = total / frames if total else STEPS_PER_FRAME_WITHOUT_END
    steered = _Steered(simulation, spec, goal, recorders, interruption, caption, inspection, desk.history)
    span = steps * frames * simulation.dt if goal.endless else goal.span(spec)
    steered.time_scale = TimeScale.of(spec.units, simulation.time + span)
    with DisplayLoss(lambda display: lost(display, steered.state)) as loss:
        words: dict[str, Any] = {"title": spec.title, "dimensions": spec.dimensions, "glass": glass, "loss": loss}
        words |= {"look": request.look, "settings": request.settings, "decided": _decided(spec)}
        window = Window(spec.view, panels=panels, desk=desk.desk(), **words)
        window.run(steered, steps_per_frame=steps)
    return Stage(desk.opened, window.glass) if window.handed_on and desk.opened is not None else None


def _decided(spec: SceneSpec) -> frozenset[str]:
    """The settings of a window that a scene decides by itself."""
    keys = (("view", "trails"), ("record", "panels"))
    return frozenset(key for entry, key in keys if key in (spec.resolved.get(entry) or {}))


def exported(inspection: "InspectionRecorder", stem: str) -> str:
    """Write a table and a drawing of the panels into the folder of outputs, numbered with the first free number."""
    paths = numbered(stem, *EXPORTED)
    try:
        for path in paths:
            inspection.save(path)
    except OutputError as error:
        return str(error)
    return "saved " + ", ".join(map(str, paths))


class _Steered:
    """The object that the window controls: the simulation and the recorders of the session.

    The end of the run is reached exactly; single steps beyond it are allowed. A restart restarts the recorders as well.
    """

    def __init__(
        self,
        simulation: "Simulation",
        spec: SceneSpec,
        goal: "Goal",
        recorders: Sequence[Any],
        interruption: "Interruption",
        caption: Callable[[], str] = lambda: "",
        inspection: "InspectionRecorder | None" = None,
        history: "History | None" = None,
    ) -> None:
        self.history = history
        self.simulation, self.spec, self.goal, self.interruption = simulation, spec, goal, interruption
        self.recorders, self.caption, self.inspection = recorders, caption, inspection
        self.time_scale = TimeScale()
        self._state = simulation.snapshot()
        self._walls = outline_of(spec, simulation.start.position)

    @property
    def finished(self) -> bool:
        """Whether the run has ended; called once a frame, so that a signal is noticed even while the run is paused."""
        self.interruption.raise_if_any()
        return self.goal.is_reached(self.simulation)

    def advance(self, steps: int) -> None:
        """Advance by some steps, at most to the exact end of the run."""
        self._advance(steps)
        if self.history is not None:
            self.history.keep()

    def _advance(self, steps: int) -> None:
        until, left = self.goal.until, self.goal.steps
        if not self.goal.is_reached(self.simulation):
            time, dt = self.simulation.time, self.simulation.dt
            if until is not None and timeline.time_after(self.simulation.scene, steps, time) + 1e-9 * dt >= until:
                self.simulation.run(until=until, recorders=self.recorders)
                return
            if left is not None:
                steps = min(steps, left - self.simulation.step_count)
        self.simulation.run(steps=steps, recorders=self.recorders)

    def frame(self) -> Frame:
        """The present particles, which the panels sample as well."""
        if self.inspection is not None:
            self.inspection.inspector.look(self.simulation)
        acceleration = self.simulation.accelerations() if self.spec.view.wants_acceleration else None
        snapshot = self._look()
        words: dict[str, Any] = {"title": self.spec.title, "extra": self.caption().replace("≈", "~")}
        words |= {"clock": self.time_scale.text(snapshot.time), "units": self.spec.units}
        return Frame.of(snapshot, **words, walls=self._walls, collides=bool(self.spec.contacts), acceleration=acceleration)

    def _look(self) -> Snapshot:
        self._state = self.simulation.snapshot()
        return self._state

    @property
    def state(self) -> Snapshot:
        """The state of the last frame, with the present step. It is a copy on the host: nothing is launched for it."""
        return replace(self._state, dt=self.simulation.dt)

    def restart(self) -> None:
        """Return to the start; sliders keep their values."""
        self.simulation.restart(as_written=True)
        for recorder in self.recorders:
            recorder.restart()
        if self.history is not None:
            self.history.restart()
