"""Outputs of a run of the command line: their names are reserved, and the files of films are opened, before the run begins.

A recorder is imported only where its file is asked for, so that a run without files starts earlier.
"""

from collections.abc import Sequence
from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

from mpp_taichi.cli._request import Request
from mpp_taichi.errors import SceneError
from mpp_taichi.recorders._lock import OutputLock
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.simulation.run_output import RunOutput

if TYPE_CHECKING:
    from mpp_taichi.recorders.film import FilmRecorder
    from mpp_taichi.recorders.trajectory import TrajectoryRecorder
    from mpp_taichi.simulation.simulation import Simulation


def lock_outputs(request: Request, stack: ExitStack) -> None:
    """Reserve the names of the files written at the end, so that a second run with the same names is refused now."""
    for path in (
        request.snapshot,
        request.diagnostics,
        request.modes,
        request.speeds,
        request.events,
        request.log,
        *request.inspect,
    ):
        if path is not None:
            stack.callback(OutputLock(path).release)


def open_sinks(spec: SceneSpec, request: Request, stack: ExitStack, *, waits: bool = False) -> list[Any]:
    """Open the files of the film; after an exception they keep the frames written so far.

    Those that wait leave the pictures of an earlier run until it is known whether it goes on.
    """
    sinks: list[Any] = []
    size, fps = request.size or spec.record.size, request.fps or spec.record.fps
    if request.video is not None:
        from mpp_taichi.recorders.video import VideoRecorder

        sinks.append(stack.enter_context(VideoRecorder(request.video, size, fps)))
    if request.frames is not None:
        from mpp_taichi.recorders.frames import FrameRecorder

        sinks.append(stack.enter_context(FrameRecorder(request.frames, waits=waits)))
    if request.still is not None:
        from mpp_taichi.recorders.still import StillRecorder

        sinks.append(stack.enter_context(StillRecorder(request.still)))
    if request.html is not None:
        from mpp_taichi.recorders.html import HtmlRecorder

        sinks.append(stack.enter_context(HtmlRecorder(request.html, size, fps)))
    return sinks


def asked_recorders(spec: SceneSpec, request: Request, simulation: "Simulation", every: int) -> tuple[Any, Any, Any]:
    """The recorders of modes, of speeds and of events; None for each that is not asked for."""
    modes = speeds = None
    events: Any = None
    if spec.modes is not None or request.modes is not None:
        from mpp_taichi.recorders.modes import ModeRecorder

        modes = ModeRecorder(simulation, spec.modes, every)
    if request.speeds is not None:
        from mpp_taichi.recorders.speed_histogram import SpeedHistogram

        speeds = SpeedHistogram(simulation)
    if request.events is not None and spec.limited_springs:
        from mpp_taichi.recorders.break_log import BreakLog

        events = BreakLog()
    elif request.events is not None:
        if spec.contacts is None:
            raise SceneError(
                f"{spec.source}: --events: there are neither contacts nor springs that break, whose events it lists"
            )
        from mpp_taichi.recorders.event_log import EventLogRecorder

        events = EventLogRecorder([wall.label for wall in simulation.phase.surfaces], every)
    return modes, speeds, events


def kept_outputs(
    films: Sequence["FilmRecorder"], sinks: Sequence[Any], trajectory: "TrajectoryRecorder | None"
) -> dict[str, RunOutput]:
    """The films and the trajectory of a run, as its archive sees them; the pictures of a video are kept from now on."""
    found: dict[str, RunOutput] = {}
    for sink in sinks:
        found[type(sink).__name__] = _kept(sink)
    for film in films:
        film.sinks = tuple(found.get(type(sink).__name__, sink) for sink in film.sinks)  # type: ignore[misc]
    return found if trajectory is None else {**found, "trajectory": trajectory}


def _kept(sink: Any) -> Any:
    from mpp_taichi.recorders.kept_pictures import KeptPictures
    from mpp_taichi.recorders.video import VideoRecorder

    return KeptPictures(sink) if isinstance(sink, VideoRecorder) else sink
