"""Thread count: how many threads or processes a user may ask for, and whether the system starts them.

More threads than logical processors take turns, and every thread takes memory for its stack. Four threads for each logical
processor are enough to measure the loss. On every machine 64 threads are allowed, so that a command that was written for a
large machine runs on a small machine as well.
"""

import operator
import os
import threading
from typing import Any

from mpp_taichi.errors import ArgumentError, CapacityError

THREADS_PER_PROCESSOR = 4
ALWAYS_ALLOWED = 64
TAICHIS_OTHERS = 5  # threads that Taichi starts beside the threads for loops, most of them for its compiler


def most_threads() -> int:
    """The largest number of threads or processes that may be asked for on this machine."""
    return max(ALWAYS_ALLOWED, THREADS_PER_PROCESSOR * (os.cpu_count() or 1))


def allowed_threads() -> str:
    """The range of thread counts, for messages."""
    return f"a whole number from 1 on, at most {most_threads()} on this machine"


def check_threads(threads: Any) -> int | None:
    """The number of threads as an int; None, which asks for a thread on every logical processor, stays None.

    Raises:
        ArgumentError: the value is no whole number from 1 to `most_threads()`.
    """
    if threads is None:
        return None
    try:
        count = 0 if isinstance(threads, bool) else operator.index(threads)
    except TypeError:
        count = 0
    if not 1 <= count <= most_threads():
        raise ArgumentError(f"threads={threads!r} must be {allowed_threads()}")
    return count


def require_threads(count: int) -> None:
    """Start as many threads as Taichi is going to start for `count` of them, and end them again.

    Taichi aborts the process where the system refuses to start one of its threads. The trial takes 0.2 ms for each thread.

    Raises:
        CapacityError: the system does not start them.
    """
    end = threading.Event()
    started: list[threading.Thread] = []
    try:
        for _ in range(count + TAICHIS_OTHERS):
            thread = threading.Thread(target=end.wait)
            thread.start()
            started.append(thread)
    except (RuntimeError, MemoryError):
        most = max(0, len(started) - TAICHIS_OTHERS)
        raise CapacityError(
            f"the system has no room for {count} threads and starts {most}: use fewer --threads, or end other programs"
        ) from None
    finally:
        end.set()
        for thread in started:
            thread.join()
