"""A film as a folder of pictures: frame_000000.png, frame_000001.png, …; needs no encoder."""

import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from mpp_taichi.errors import OutputError, StateError
from mpp_taichi.recorders._lock import OutputLock
from mpp_taichi.recorders._no_news import NoNews
from mpp_taichi.views.picture import save_picture


class FrameRecorder(NoNews):
    """Writes each frame to a PNG of its own; a context manager, like `VideoRecorder`.

    Pictures of an earlier run in the same folder are removed first, so that the folder always holds one film.
    """

    def __init__(self, folder: str | Path, *, waits: bool = False) -> None:
        """Make the folder; one that `waits` removes no picture of an earlier run until `begin_anew` or `go_on`.

        Raises:
            OutputError: it cannot be made or is being written by another run.
        """
        self.folder = Path(folder)
        self.frame_count = 0
        self.path = self.folder
        self._lock = OutputLock(self.folder / "frames")
        self._sizes: list[int] = []  # of the files, in bytes
        self._on_disk = 0  # files that are forced to the disk
        if not waits:
            self.begin_anew()

    def __enter__(self) -> "FrameRecorder":
        """The recorder itself."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        """Release the folder; every picture written is whole."""
        self.close()

    def write(self, picture: np.ndarray) -> None:
        """Add one frame: uint8, shape (height, width, 3).

        Raises:
            OutputError: the disk is full or the folder gone.
        """
        path = self._path(self.frame_count)
        save_picture(picture, path)
        self._sizes.append(path.stat().st_size)
        self.frame_count += 1

    # For the archive of a run, see `RunOutput`.

    def begin_anew(self) -> None:
        """Remove the pictures of an earlier run."""
        self._remove_from(0)

    def at_record(self) -> dict[str, Any]:
        """The sizes of the pictures, which are on the disk now.

        Raises:
            OutputError: one of them is gone.
        """
        try:
            for number in range(self._on_disk, self.frame_count):
                with open(self._path(number), "rb+") as stream:
                    os.fsync(stream.fileno())
        except OSError as error:
            raise OutputError(f"{self.folder}: cannot write the pictures: {error.strerror or error}") from error
        self._on_disk = self.frame_count
        return {"sizes": np.array(self._sizes, dtype=np.int64)}

    def go_on(self, simulation: Any, saved: Mapping[str, Any], news: Iterator[list[Any]]) -> None:
        """Keep the pictures of a record, and remove those after it.

        Raises:
            StateError: a picture is missing, or has another size.
        """
        sizes = saved["sizes"].tolist()
        for number, size in enumerate(sizes):
            path = self._path(number)
            if not path.is_file() or path.stat().st_size != size:
                raise StateError(f"{path}: the picture is not there, or has changed")
        self._sizes, self.frame_count, self._on_disk = sizes, len(sizes), len(sizes)
        self._remove_from(len(sizes))

    def _path(self, number: int) -> Path:
        return self.folder / f"frame_{number:06d}.png"

    def _remove_from(self, first: int) -> None:
        for old in self.folder.glob("frame_[0-9][0-9][0-9][0-9][0-9][0-9].png"):
            if int(old.stem[-6:]) >= first:
                old.unlink()
        for torn in self.folder.glob("frame_[0-9][0-9][0-9][0-9][0-9][0-9].part.png"):
            torn.unlink()

    def close(self) -> None:
        """Release the folder."""
        self._lock.release()

    def abandon(self) -> None:
        """Release the folder; every picture written is whole."""
        self._lock.release()
