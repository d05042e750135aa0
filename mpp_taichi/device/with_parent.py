"""Processes that end with their parent, also when the parent was killed and could not end them."""

import os
import sys
import threading
import time

from mpp_taichi.device.thread_count import start_thread

PARENT_VARIABLE = "MPP_TAICHI_PARENT"
LOOK_SECONDS = 0.5


def child_environment() -> dict[str, str]:
    """The environment for a child of this process that calls `end_with_parent`."""
    return {**os.environ, PARENT_VARIABLE: str(os.getpid())}


def end_with_parent(parent: int | None = None) -> None:
    """End this process within a second after the end of its parent, the process of this number.

    Without a number, that of `child_environment` counts; where there is none, nothing is done. A process whose parent has ended
    is given to another one, which the system tells; Windows has no such rule, and there nothing is done either.

    Raises:
        CapacityError: the system starts no thread for it.
    """
    given = os.environ.pop(PARENT_VARIABLE, "")  # for this process only, not for its own children
    number = parent if parent is not None else int(given) if given.isdecimal() else None
    if number is not None and sys.platform != "win32":
        start_thread(threading.Thread(target=_watch, args=(number,), name="parent", daemon=True))


def _watch(parent: int) -> None:
    while os.getppid() == parent:
        time.sleep(LOOK_SECONDS)
    os._exit(1)  # and print nothing: the terminal may belong to another program by now
