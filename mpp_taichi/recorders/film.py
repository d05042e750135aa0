"""Film: pictures of a run at evenly spaced times, for a video or a folder of frames."""

from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from mpp_taichi.recorders.motion import motion_ahead
from mpp_taichi.recorders.path_samples import MOST_PLACES, PathSamples, Told
from mpp_taichi.scene.human_units import TimeScale
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.start.overlaps import bounced
from mpp_taichi.views._base import Frame, View
from mpp_taichi.views.wall_outline import Outline, outline_of

if TYPE_CHECKING:
    from mpp_taichi.simulation.simulation import Simulation

SAME_TIME = 1e-6  # of a step: the error of a frame's time by rounding


class PictureSink(Protocol):
    """The receiver of pictures: `VideoRecorder`, `FrameRecorder`."""

    def write(self, picture: np.ndarray) -> None:
        """Add one picture."""


class FrameSink(Protocol):
    """The receiver of frames that are not drawn here: `HtmlRecorder`."""

    def add(self, frame: Frame) -> None:
        """Add one frame."""


class MomentSink(Protocol):
    """The receiver of the particles of each frame beside the frame itself: another process, or a comparison."""

    def add(self, snapshot: Snapshot, frame: Frame) -> None:
        """Take the particles at the time of a frame, before the frame is drawn."""


class BetweenSteps(Protocol):
    """The method that finds the particles at a time between two steps.

    tolerance         a time this near to a step, as a share of dt, is taken as the time of the step
    velocities_stay   whether the velocities are those of the step before
    """

    tolerance: float
    velocities_stay: bool

    def particles(self, simulation: "Simulation", time: float) -> Snapshot:
        """The particles at a time before the next step."""


class DenseOutput:
    """Dense output of first order: at a time δ after a step the positions are x + v δ.

    The error ½ a δ² is far below a pixel for any step that resolves the motion. Where the method drifts along orbits, the
    positions lie on these. A way that leads into a wall is mirrored there.
    """

    tolerance = SAME_TIME
    velocities_stay = True

    def particles(self, simulation: "Simulation", time: float) -> Snapshot:
        """The particles at a time before the next step."""
        found = simulation.snapshot_ahead(time - simulation.time)
        surfaces = simulation.phase.surfaces
        return bounced(surfaces, found, time - simulation.time) if surfaces else found


class FilmRecorder:
    """Draws exactly `frame_count` frames; frame k shows the time start + k / (frame_count − 1) · span.

    For a time between two steps `between` finds the particles, never from beyond the end of a phase of the timeline. The first
    frame is the start of the run and the last one its end, both exact. A single frame shows the start.
    """

    # Of the process, for `archive.object_state`.
    MADE_ANEW = (
        "pages",
        "moments",
        "sinks",
        "caption",
        "stopwatch",
        "_between",
        "_is_dimmed",
        "_raise_if_interrupted",
        "_walls",
        "_time_scale",
        "_told",
    )

    def __init__(
        self,
        view: View | None,
        sinks: Sequence[PictureSink],
        frame_count: int,
        span: float,
        *,
        pages: Sequence[FrameSink] = (),
        moments: Sequence[MomentSink] = (),
        between: BetweenSteps = DenseOutput(),  # noqa: B008 — it holds nothing
        title: str = "",
        caption: Callable[[], str] = lambda: "",
        is_dimmed: Callable[[float], bool] = lambda time: False,
        stopwatch: Callable[[str], AbstractContextManager[Any]],
        raise_if_interrupted: Callable[[], None] = lambda: None,
        start: float | None = None,
        told: Told = lambda name, turns: None,
    ) -> None:
        """`stopwatch(name)` times a block; drawing is counted as capture, handing over to a sink as encode.

        `is_dimmed` says of a time whether its frame is drawn with less contrast.

        `pages` and `moments` get every frame, `sinks` every picture of a frame; without a view there are no pictures.
        `raise_if_interrupted` is called before each frame: any number of frames may lie between two steps. `start` is the
        time of the first frame; the time of `begin` when absent. `told` is told once which body turns by more than a third
        of a circle between two frames, and how far.
        """
        self.pages, self.moments, self._between = tuple(pages), tuple(moments), between
        self.view, self.sinks, self.frame_count, self.span = view, tuple(sinks), frame_count, span
        self.title, self.caption, self.stopwatch = title, caption, stopwatch
        self._is_dimmed = is_dimmed
        self._raise_if_interrupted = raise_if_interrupted
        self.drawn_count = 0
        self._walls: Outline | None = None
        self._time_scale = TimeScale()
        self._start, self._is_begun, self._told = start, False, told
        self._paths: PathSamples | None = None
        self._motion: np.ndarray | None = None  # until the first frame has placed the camera

    def begin(self, simulation: "Simulation") -> None:
        """Begin the film: unless a time was given, the first frame shows the present one. A second call changes nothing."""
        if not self._is_begun:
            self._is_begun = True
            self._start = simulation.time if self._start is None else self._start
            self._walls = outline_of(simulation.spec, simulation.start.position)
            self._time_scale = TimeScale.of(simulation.spec.units, self._start + self.span)
            if self.view is not None and self.frame_count > 1:
                self._motion = motion_ahead(simulation, self._start + self.span - simulation.time)
            if self.frame_count > 1 and simulation.start.particle_count <= MOST_PLACES:
                interval = self.span / (self.frame_count - 1)
                self._paths = PathSamples(simulation.spec, interval, self._walls, self._told)

    def steps_until_due(self, simulation: "Simulation") -> int:
        """Until the next frame, or until the next sample of fast motion before it."""
        steps = self.steps_until_frame(simulation)
        if self._paths is None or self.drawn_count >= self.frame_count:
            return steps
        return min(steps, self._paths.steps_until_due(simulation, self._due_time()))

    def steps_until_frame(self, simulation: "Simulation") -> int:
        """Until the last step not after the next frame's time; for the last frame, until the end."""
        self.begin(simulation)
        if self.drawn_count >= self.frame_count:
            return 2**31
        ahead = (self._due_time() - simulation.time) / simulation.dt
        if ahead <= self._between.tolerance:
            return 0
        steps = int(ahead + self._between.tolerance)
        if self._is_last():
            steps = max(1, steps)
        return steps

    def record(self, simulation: "Simulation") -> None:
        """Draw every frame that lies before the next step."""
        with self.stopwatch("capture"):
            snapshot = simulation.snapshot()
        if self._paths is not None and self.drawn_count < self.frame_count:
            self._paths.look(simulation, snapshot, self._due_time())
        while self.drawn_count < self.frame_count:
            self._raise_if_interrupted()
            offset = self._due_time() - simulation.time
            exact = abs(offset) <= self._between.tolerance * simulation.dt
            reach = min(simulation.dt, simulation.time_to_next_phase)
            if not exact and (offset >= reach - simulation.dt * self._between.tolerance or self._is_last()):
                return
            self._show(simulation, snapshot if exact else self._between.particles(simulation, self._due_time()))

    def finish(self, simulation: "Simulation") -> None:
        """Draw the last frame, which rounding of the time may have put a hair past the end."""
        if self.drawn_count == self.frame_count - 1 and self.drawn_count > 0:
            with self.stopwatch("capture"):
                snapshot = simulation.snapshot()
            self._show(simulation, snapshot)

    def _show(self, simulation: "Simulation", snapshot: Snapshot) -> None:
        """Draw the particles at the time of the next frame."""
        frame = self._frame(simulation, snapshot)
        for sink in self.moments:
            sink.add(snapshot, frame)
        self._draw(frame)

    def _frame(self, simulation: "Simulation", snapshot: Snapshot) -> Frame:
        """The frame of a snapshot; accelerations are measured where a picture shows them."""
        acceleration, drawn = None, self.view is not None or bool(self.moments)
        if drawn and simulation.spec.view.wants_acceleration:
            with self.stopwatch("capture"):
                acceleration = simulation.accelerations(snapshot)
        words: dict[str, Any] = {"title": self.title, "extra": self.caption(), "units": simulation.spec.units}
        collides = bool(simulation.spec.contacts)
        frame = Frame.of(snapshot, **words, walls=self._walls, collides=collides, acceleration=acceleration)
        time = self._due_time()
        path = {} if self._paths is None else self._paths.take(simulation, snapshot, time)
        ahead = max(0.0, time - simulation.time) if self._between.velocities_stay else 0.0
        motion, self._motion = self._motion, None
        return replace(
            frame,
            **path,
            ahead=ahead,
            motion=motion,
            time=time,
            clock=self._time_scale.text(time),
            dimmed=self._is_dimmed(time),
        )

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
