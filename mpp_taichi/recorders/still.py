"""One picture: the last frame of a film, as a PNG."""

from pathlib import Path
from types import TracebackType

import numpy as np

from mpp_taichi.recorders._lock import OutputLock

FORMATS = (".png",)


class StillRecorder:
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
