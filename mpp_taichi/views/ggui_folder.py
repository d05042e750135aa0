"""A folder of GGUI's own: its panel library reads and writes the file imgui.ini wherever the process happens to be."""

import atexit
import os
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import lru_cache


@contextmanager
def ggui_folder() -> Iterator[None]:
    """A block in an empty folder of this process; calls of GGUI that begin or end a picture, or a window, stand in it."""
    folder = _folder()
    try:
        before = os.getcwd()
    except OSError:  # the working folder has been removed
        before = folder
    os.chdir(folder)
    try:
        yield
    finally:
        with suppress(OSError):
            os.chdir(before)


@lru_cache(maxsize=1)
def _folder() -> str:
    folder = tempfile.mkdtemp(prefix="mpp_taichi_")
    atexit.register(_leave, folder)
    return folder


def _leave(folder: str) -> None:
    """GGUI writes its file once more when the process ends: into a folder that is not there any more."""
    with suppress(OSError):
        os.chdir(folder)
    shutil.rmtree(folder, ignore_errors=True)
