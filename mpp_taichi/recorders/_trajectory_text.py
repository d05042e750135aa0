"""Trajectory as text: extended XYZ, one frame after the other."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mpp_taichi.errors import StateError
from mpp_taichi.recorders._extended_xyz import frame_lines
from mpp_taichi.recorders._trajectory_parts import TrajectoryPart
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.walls._base import Enclosure


class TextWriter:
    """Writes the frames of a text file. Where the disk is full, the frames that it holds whole are kept.

    Every method may raise OSError.
    """

    def __init__(self, path: Path) -> None:
        """Nothing is opened yet."""
        self.path = path
        self._place = path.with_name(path.name + ".part")
        self._part: TrajectoryPart | None = None
        self._ends = [0]  # of the frames, in bytes

    def begin(self) -> None:
        """Open the part."""
        self._part = TrajectoryPart.begin(self._place)

    def write(self, snapshot: Snapshot, enclosure: Enclosure) -> None:
        """Append a frame."""
        assert self._part is not None
        data = "".join(f"{line}\n" for line in frame_lines(snapshot, enclosure)).encode()
        self._ends.append(self._ends[-1] + len(data))
        self._part.write(data)

    def at_record(self) -> dict[str, Any]:
        """The frames so far, which are on the disk now."""
        assert self._part is not None
        return {"parts": {"text": self._part.at_record()}}

    def go_on(self, saved: Mapping[str, Any], snapshot: Snapshot) -> None:
        """Take the frames of a record from the part that a killed run has left, or from the file of an interrupted run.

        Raises:
            StateError: they are not there, or have changed.
        """
        length, check = saved["parts"]["text"]
        part = TrajectoryPart.of_leftover(self._place, length, check)
        if part is None:
            try:
                with open(self.path, "rb") as source:
                    part = TrajectoryPart.of_finished(self._place, source, length, check)
            except FileNotFoundError:
                raise StateError(f"{self.path}: its frames are not there") from None
            except StateError as error:
                raise StateError(f"{self.path}: {error}") from None
        self._part, self._ends = part, [0, length]

    def close(self, *, keep: bool) -> None:
        """Cut the text behind its last whole frame and give it its name."""
        if self._part is None:
            return
        try:
            self._part.stream.close()
        finally:
            held = os.path.getsize(self._place)
            whole = max(end for end in self._ends if end <= held)
            if keep and whole:
                os.truncate(self._place, whole)
                os.replace(self._place, self.path)
            self._place.unlink(missing_ok=True)
