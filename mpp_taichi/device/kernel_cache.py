"""Kernel cache: the folder where Taichi keeps compiled kernels, and a lock that a process which was killed has left in it."""

import functools
import logging
import tempfile
import time
from pathlib import Path
from typing import Any

log = logging.getLogger(__name__)

LOCK = "ticache.lock"
LONGEST = 60.0  # seconds: Taichi holds its lock for milliseconds


def folder_of(ti: Any) -> str:
    """The folder where Taichi keeps compiled kernels unless told otherwise."""
    ti._lib.core.reset_default_compile_config()  # as ti.init does; the options of an earlier ti.init still stand there
    return str(ti.lang.impl.default_cfg().offline_cache_file_path)


@functools.cache
def is_writable(folder: str) -> bool:
    """Whether a file can be made in a folder; a missing folder is made. Warns once where it cannot."""
    try:
        Path(folder).mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return True
    except OSError as error:
        log.warning("compiled kernels are not kept: %s: %s", folder, error.strerror or error)
        return False


def remove_old_lock(folder: str) -> None:
    """Remove the lock of a process that was killed while it held it.

    Taichi 1.7.4 locks the cache by a file that only the process which made it removes. Where the file stays, every later
    process waits 0.2 s for it each time, then finds no kernel, compiles all anew, and keeps none.
    """
    lock = Path(folder) / LOCK
    try:
        if time.time() - lock.stat().st_mtime > LONGEST:
            lock.unlink()
            log.info("removed %s, which a process that was killed had left", lock)
    except OSError:  # there is none, or another process was faster
        return
