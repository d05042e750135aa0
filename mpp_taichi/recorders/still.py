"""One picture: the last frame of a film, as a PNG."""

import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from mpp_taichi.errors import StateError
from mpp_taichi.recorders._lock import OutputLock
from mpp_taichi.recorders._no_news import NoNews

FORMATS = (".png",)


class StillRecorder(NoNews):
    """Keeps the latest frame and writes it at the end; a context manager, like `VideoRecorder`.

    All frames of the film are drawn, as trails and panels need them. On an exception the latest frame is written all the same.
    """

    def __init__(self, path: str | Path) -> None:
        """Hold the name.

        Raises:
            OutputError: its folder cannot be made, or it is being written by another run.
        """
        self.path = Path(path)
        self.frame_count = 0
        self._picture: np.ndarray | None = None
        self._lock = OutputLock(self.path)

    def __enter__(self) -> "StillRecorder":
        """The recorder itself."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        """Write the latest frame."""
        self.close()

    def write(self, picture: np.ndarray) -> None:
        """Keep a frame: uint8, shape (height, width, 3)."""
        self._picture = picture
        self.frame_count += 1

    # For the archive of a run, see `RunOutput`.

    def begin_anew(self) -> None:
        """Do nothing: an old picture stays until the new one is whole."""

    def at_record(self) -> dict[str, Any]:
        """The latest frame."""
        saved: dict[str, Any] = {"frame_count": self.frame_count}
        if self._picture is not None:
            saved["shape"] = list(self._picture.shape)
            saved["picture"] = np.frombuffer(zlib.compress(self._picture.tobytes(), 1), np.uint8)
        return saved

    def go_on(self, simulation: Any, saved: Mapping[str, Any], news: Iterator[list[Any]]) -> None:
        """Take the latest frame of a record.

        Raises:
            StateError: it is damaged.
        """
        self.frame_count = saved["frame_count"]
        if "picture" in saved:
            try:
                data = zlib.decompress(saved["picture"].tobytes())
            except zlib.error as error:
                raise StateError(f"the picture {self.path} is damaged: {error}") from None
            self._picture = np.frombuffer(data, np.uint8).reshape(saved["shape"])

    def close(self) -> None:
        """Write the picture; harmless when called twice.

        Raises:
            OutputError: it cannot be written.
        """
        try:
            picture, self._picture = self._picture, None
            if picture is not None:
                from mpp_taichi.views.picture import save_picture  # not imported where only the formats are wanted

                save_picture(picture, self.path)
        finally:
            self._lock.release()

    def abandon(self) -> None:
        """Release the name without a picture."""
        self._lock.release()
