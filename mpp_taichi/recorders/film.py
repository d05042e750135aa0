"""Film: pictures of a run at evenly spaced times, for a video or a folder of frames."""

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from mpp_taichi.snapshot import Snapshot
from mpp_taichi.views._base import Frame, View
from mpp_taichi.views.wall_outline import Outline, outline_of

if TYPE_CHECKING:
    from mpp_taichi.simulation.simulation import Simulation

SAME_TIME = 1e-6  # of a step: what rounding may do to a frame's time


class PictureSink(Protocol):
    """Where pictures go: `VideoRecorder`, `FrameRecorder`."""

    def write(self, picture: np.ndarray) -> None:
        """Add one picture."""


class FrameSink(Protocol):
    """Where frames go that are not drawn here: `HtmlRecorder`."""

    def add(self, frame: Frame) -> None:
        """Add one frame."""


class FilmRecorder:
    """Draws exactly `frame_count` frames; frame k shows the time start + k / (frame_count − 1) · span.

    Where that lies between two steps, at δ < dt after one, the positions shown are x + v δ: dense output of first order, whose
    error ½ a δ² is far below a pixel for any step that resolves the motion; where the method drifts along orbits, they are on
    these. It never reaches into the next phase of a timeline.
    The first frame is the start and the last one the end of the run, both exact. A single frame shows the start.
    """

    same_time = SAME_TIME

    def __init__(
        self,
        view: View | None,
        sinks: Sequence[PictureSink],
        frame_count: int,
        span: float,
        *,
        pages: Sequence[FrameSink] = (),
        title: str = "",
        caption: Callable[[], str] = lambda: "",
        stopwatch: Callable[[str], AbstractContextManager[Any]],
        raise_if_interrupted: Callable[[], None] = lambda: None,
    ) -> None:
        """`stopwatch(name)` times a block; drawing is counted as capture, handing over to a sink as encode.

        `raise_if_interrupted` is called before each frame: any number of frames may lie between two steps.

        `pages` get the frames themselves; without a view there is nothing else.
        """
        self.pages = tuple(pages)
        self.view, self.sinks, self.frame_count, self.span = view, tuple(sinks), frame_count, span
        self.title, self.caption, self.stopwatch = title, caption, stopwatch
        self._raise_if_interrupted = raise_if_interrupted
        self.drawn_count = 0
        self._walls: Outline | None = None
        self._start: float | None = None

    def steps_until_due(self, simulation: "Simulation") -> int:
        """Until the last step not after the next frame's time; for the last frame, until the end."""
        if self._start is None:
            self._start = simulation.time
            self._walls = outline_of(simulation.spec, simulation.start.position)
        if self.drawn_count >= self.frame_count:
            return 2**31
        ahead = (self._due_time() - simulation.time) / simulation.dt
        if ahead <= self.same_time:
            return 0
        if self._is_last():
            return max(1, int(ahead + self.same_time))
        return int(ahead + self.same_time)

    def record(self, simulation: "Simulation") -> None:
        """Draw every frame that lies before the next step."""
        with self.stopwatch("capture"):
            snapshot = simulation.snapshot()
        while self.drawn_count < self.frame_count:
            self._raise_if_interrupted()
            offset = self._due_time() - simulation.time
            exact = abs(offset) <= self.same_time * simulation.dt
            reach = min(simulation.dt, simulation.time_to_next_phase)
            if not exact and (offset >= reach - simulation.dt * self.same_time or self._is_last()):
                return
            self._show(simulation, snapshot if exact else self._between(simulation, offset))

    def finish(self, simulation: "Simulation") -> None:
        """Draw the last frame, which rounding of the time may have put a hair past the end."""
        if self.drawn_count == self.frame_count - 1 and self.drawn_count > 0:
            with self.stopwatch("capture"):
                snapshot = simulation.snapshot()
            self._show(simulation, snapshot)

    def _between(self, simulation: "Simulation", offset: float) -> Snapshot:
        """The particles an `offset` after the last step."""
        return simulation.snapshot_ahead(offset)

    def _show(self, simulation: "Simulation", snapshot: Snapshot) -> None:
        """Draw what is due."""
        self._draw(self._frame(simulation, snapshot, drawn=self.view is not None))

    def _frame(self, simulation: "Simulation", snapshot: Snapshot, *, drawn: bool = True) -> Frame:
        """What a snapshot looks like; the forces are asked for where they are `drawn`."""
        acceleration = None
        if drawn and simulation.spec.view.wants_acceleration:
            with self.stopwatch("capture"):
                acceleration = simulation.accelerations(snapshot)
        frame = Frame.of(snapshot, title=self.title, extra=self.caption(), walls=self._walls, acceleration=acceleration)
        return replace(frame, time=self._due_time())

    def _due_time(self) -> float:
        assert self._start is not None
        return self._start + self.span * self.drawn_count / max(1, self.frame_count - 1)

    def _is_last(self) -> bool:
        return self.drawn_count == self.frame_count - 1 and self.frame_count > 1

    def _draw(self, frame: Frame) -> None:
        self.drawn_count += 1
        for page in self.pages:
            page.add(frame)
        if self.view is None:
            return
        with self.stopwatch("capture"):
            picture = self.view.draw(frame)
        with self.stopwatch("encode"):
            for sink in self.sinks:
                sink.write(picture)
