"""Thread count: how many threads or processes may be asked for.

More threads than logical processors take turns, and every thread takes memory for its stack. Four threads for each logical
processor are enough to measure the loss. On every machine 64 threads are allowed, so that a command that was written for a
large machine runs on a small machine as well.
"""

import operator
import os
from typing import Any

from mpp_taichi.errors import ArgumentError

THREADS_PER_PROCESSOR = 4
ALWAYS_ALLOWED = 64


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
