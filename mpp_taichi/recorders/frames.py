"""A film as a folder of pictures: frame_000000.png, frame_000001.png, …; needs no encoder."""

from pathlib import Path
from types import TracebackType

import numpy as np

from mpp_taichi.recorders._lock import OutputLock
from mpp_taichi.views.picture import save_picture


class FrameRecorder:
    """Writes each frame to a PNG of its own; a context manager, like `VideoRecorder`.

    Pictures of an earlier run in the same folder are removed first, so that the folder always holds one film.
    """

    def __init__(self, folder: str | Path) -> None:
        """Make the folder.

        Raises:
            OutputError: it cannot be made or is being written by another run.
        """
        self.folder = Path(folder)
        self.frame_count = 0
        self.path = self.folder
        self._lock = OutputLock(self.folder / "frames")
        for old in self.folder.glob("frame_[0-9][0-9][0-9][0-9][0-9][0-9].png"):
            old.unlink()

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
        path = self.folder / f"frame_{self.frame_count:06d}.png"
        save_picture(picture, path)
        self.frame_count += 1

    def close(self) -> None:
        """Release the folder."""
        self._lock.release()

    def abandon(self) -> None:
        """Release the folder; every picture written is whole."""
        self._lock.release()
