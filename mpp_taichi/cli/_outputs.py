"""Outputs of a run of the command line: their names are reserved, and the files of films are opened, before the run begins."""

from contextlib import ExitStack
from typing import Any

from mpp_taichi.cli._request import Request
from mpp_taichi.recorders._lock import OutputLock
from mpp_taichi.recorders.frames import FrameRecorder
from mpp_taichi.recorders.html import HtmlRecorder
from mpp_taichi.recorders.still import StillRecorder
from mpp_taichi.recorders.video import VideoRecorder
from mpp_taichi.scene.spec import SceneSpec


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


def open_sinks(spec: SceneSpec, request: Request, stack: ExitStack) -> list[Any]:
    """Open the files of the film; after an exception they keep the frames written so far."""
    sinks: list[Any] = []
    size, fps = request.size or spec.record.size, request.fps or spec.record.fps
    if request.video is not None:
        sinks.append(stack.enter_context(VideoRecorder(request.video, size, fps)))
    if request.frames is not None:
        sinks.append(stack.enter_context(FrameRecorder(request.frames)))
    if request.still is not None:
        sinks.append(stack.enter_context(StillRecorder(request.still)))
    if request.html is not None:
        sinks.append(stack.enter_context(HtmlRecorder(request.html, size, fps)))
    return sinks
