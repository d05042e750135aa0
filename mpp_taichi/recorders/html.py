"""A film as one HTML file: the frames of a run, and a player that turns, plays and plots them in a browser, offline."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, replace
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from mpp_taichi.archive import object_state
from mpp_taichi.atomic_file import whole_text
from mpp_taichi.errors import CapacityError, StateError
from mpp_taichi.recorders._html_page import Recording, page
from mpp_taichi.recorders._lock import OutputLock
from mpp_taichi.recorders._page_paths import SHARES, PathPoints
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.views._base import Frame
from mpp_taichi.views.appearance import Appearance
from mpp_taichi.views.camera import HORIZON
from mpp_taichi.views.legend import legend_lines
from mpp_taichi.views.trails import Trails

FORMATS = (".html", ".htm")
SELDOM_NEW = ("radius", "color", "between", "spring_color", "outline")  # equal arrays of many frames are kept once
MOST_ENTRIES = 20_000_000  # particles times frames: 160 MB in a browser, and as much in the file


class HtmlRecorder:
    """Keeps frames and writes them into one page; a context manager, like `VideoRecorder`, that leaves a whole file or none."""

    def __init__(self, path: str | Path, size: tuple[int, int], fps: float) -> None:
        """A page at `fps` frames a second, whose first view is made for a picture of (width, height) pixels.

        Raises:
            OutputError: the folder cannot be written, or the file is being written by another run.
        """
        self.path, self.size, self.fps = Path(path), size, fps
        self._frames: list[Frame] = []
        self._speeds: list[np.ndarray] = []
        self._paths: list[PathPoints | None] = []  # for the trails, before each frame
        self._trails = Trails(0)
        self._spec: SceneSpec | None = None
        self._appearance: Appearance | None = None
        self._names: Sequence[str] = ()
        self._rows: Sequence[dict[str, Any]] = ()
        self._closed = False
        self._in_archive = 0  # frames
        self._lock = OutputLock(self.path)

    @property
    def frame_count(self) -> int:
        """Frames kept so far."""
        return len(self._frames)

    def __enter__(self) -> "HtmlRecorder":
        """The recorder itself."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        """Write the page; after an exception nothing is written."""
        if kind is None and self._frames:
            self.close()
        self.abandon()

    def begin(self, spec: SceneSpec, names: Sequence[str], rows: Sequence[dict[str, Any]], frame_count: int) -> None:
        """Take the contents of the page: the scene, its particles' names, and the samples of energies, a list that grows.

        Raises:
            CapacityError: so many particles in so many frames are more than a page can hold.
        """
        most = MOST_ENTRIES // max(1, len(names))
        if frame_count > most:
            raise CapacityError(
                f"{self.path}: {frame_count:,} frames of {len(names):,} particles are more than a page can hold, "
                f"allowed: {most:,} frames; take fewer, by --fps or --duration"
            )
        self._spec, self._names, self._rows = spec, names, rows
        self._appearance = Appearance(spec.view, spec.dimensions)
        self._trails = Trails(min(1, spec.view.trails))

    def add(self, frame: Frame) -> None:
        """Keep one frame as it is drawn; a particle farther away than any picture reaches is left out."""
        if self._appearance is not None:
            frame = self._appearance.dress(frame)
        with np.errstate(invalid="ignore"):
            seen = (np.abs(frame.position) < HORIZON).all(axis=1)
        place = frame.position if seen.all() else np.where(seen[:, None], frame.position, np.nan)
        if frame.velocity is not None:
            self._speeds.append(np.where(seen, np.linalg.norm(frame.velocity, axis=1), np.nan).astype(np.float32))
        self._paths.append(self._path(frame))
        last = self._frames[-1] if self._frames else frame
        same = {name: getattr(last, name) for name in SELDOM_NEW if np.array_equal(getattr(last, name), getattr(frame, name))}
        bare: dict[str, Any] = dict.fromkeys(("velocity", "path_index", "path_time", "path"))
        self._frames.append(replace(frame, position=place, ahead=0.0, **bare, **same))

    def _path(self, frame: Frame) -> PathPoints | None:
        """Places since the last frame of the particles that have turned far from frame to frame, now or before."""
        if self._appearance is None or not self._trails.length:
            return None
        self._trails.add(self._appearance.with_drawn_velocity(frame))
        known = self._paths[-1] if self._paths else None
        index = np.zeros(0, np.int64) if frame.path_index is None else frame.path_index
        index = index if known is None else np.union1d(index, known[0])
        return (index, self._trails.newest_points(index, SHARES)) if len(index) and self._paths else None

    # For the archive of a run, see `RunOutput`.

    @property
    def pending(self) -> int:
        """Bytes of the frames that no record holds yet, about."""
        return sum(frame.position.nbytes for frame in self._frames[self._in_archive :])

    def begin_anew(self) -> None:
        """Do nothing: an old page stays until the new one is whole."""

    def news(self) -> list[dict[str, Any]]:
        """The frames since the last record: of each the fields that differ from the frame before, and the speeds."""
        found = []
        for number in range(self._in_archive, len(self._frames)):
            frame, before = self._frames[number], self._frames[number - 1] if number else None
            values = {each.name: getattr(frame, each.name) for each in fields(Frame)}
            new = {key: value for key, value in values.items() if before is None or not _same(value, getattr(before, key))}
            speed = self._speeds[number] if number < len(self._speeds) else None
            found.append({"frame": new, "speed": speed, "path": self._paths[number]})
        self._in_archive = len(self._frames)
        return found

    def at_record(self) -> dict[str, Any]:
        """The number of frames, and the ranges of colours."""
        ranges = object_state.captured({"appearance": self._appearance, "trails": self._trails})
        return {"frame_count": self.frame_count, "ranges": ranges}

    def stop(self) -> None:
        """Do nothing: the frames are kept for the page itself."""

    def go_on(self, simulation: Any, saved: Mapping[str, Any], news: Iterator[list[dict[str, Any]]]) -> None:
        """Take the frames of a record.

        Raises:
            StateError: frames are missing.
        """
        for entry in (each for entries in news for each in entries):
            self._frames.append(replace(self._frames[-1], **entry["frame"]) if self._frames else Frame(**entry["frame"]))
            if entry["speed"] is not None:
                self._speeds.append(entry["speed"])
            self._paths.append(entry.get("path"))
        if self.frame_count != saved["frame_count"]:
            raise StateError(f"it holds {self.frame_count:,} of {saved['frame_count']:,} frames of {self.path}")
        self._in_archive = self.frame_count
        objects = {"appearance": self._appearance, "trails": self._trails}  # archives of version 0.1.0 may lack the trails
        object_state.restore(saved["ranges"], {name: objects[name] for name in saved["ranges"]["roots"] if name in objects})

    def close(self) -> None:
        """Write the page under its name, if that was not done before.

        Raises:
            OutputError: it cannot be written.
        """
        if self._closed:
            return
        assert self._spec is not None
        legend = [] if self._appearance is None else legend_lines(replace(self._appearance.legend(), lines=()))
        found = (self._spec, self._frames, self._speeds, self._names, self._rows, self.size, self.fps, legend, self._paths)
        recording = Recording(*found)
        try:
            whole_text(self.path, page(recording), "the page")
        finally:
            self.abandon()

    def abandon(self) -> None:
        """Release the name; harmless after `close`."""
        self._closed = True
        self._lock.release()


def _same(value: Any, before: Any) -> bool:
    """Whether two values of a field are equal, bit for bit."""
    if isinstance(value, np.ndarray) and isinstance(before, np.ndarray):
        return value is before or (
            value.dtype == before.dtype and value.shape == before.shape and value.tobytes() == before.tobytes()
        )
    return type(value) is type(before) and bool(value == before)
