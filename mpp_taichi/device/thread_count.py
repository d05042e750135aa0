"""Thread count: how many threads or processes a user may ask for, and whether the system starts them.

More threads than logical processors only take turns, and every thread takes memory for its stack. So kernels run on as many
threads as the process has processors, at most, and a note says so where more were asked for: a command that was written for a
large machine runs on a small machine as well. More than four threads for each processor, and more than 64, are refused.
"""

import _thread
import logging
import operator
import os
import threading
from typing import Any

from mpp_taichi.errors import ArgumentError, CapacityError

log = logging.getLogger(__name__)

THREADS_PER_PROCESSOR = 4
ALWAYS_ALLOWED = 64
OPENBLAS_VARIABLE = "OPENBLAS_NUM_THREADS"
OPENBLAS_MOST = 64  # threads of the OpenBLAS in NumPy's wheels
NO_MORE_THREADS = "the system starts no more threads: end other programs, or allow more (ulimit -u, ulimit -v)"
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


def bounded(count: int) -> int:
    """The count, or the number of processors of this process where that is less, with a note."""
    most = processors()
    if count > most:
        log.warning("threads: %d instead of %d, as this process has %d processors", most, count, most)
    return min(count, most)


def processors() -> int:
    """The number of logical processors on which this process may run."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def bound_threads_of_numpy() -> None:
    """Let NumPy's linear algebra start no threads, where the system does not start them; before NumPy is imported.

    OpenBLAS prints four lines for each thread that is not started, and sends SIGINT to the process.
    """
    if OPENBLAS_VARIABLE not in os.environ:
        try:
            require_threads(min(processors(), OPENBLAS_MOST) - TAICHIS_OTHERS)
        except CapacityError:
            os.environ[OPENBLAS_VARIABLE] = "1"


def start_thread(thread: threading.Thread) -> None:
    """Start a thread.

    Raises:
        CapacityError: the system does not start it.
    """
    try:
        thread.start()
    except RuntimeError as error:
        _raise_interrupt(error)
        raise CapacityError(NO_MORE_THREADS) from None


def require_threads(count: int) -> None:
    """Start as many threads as Taichi is going to start for `count` of them, and end them again.

    Taichi aborts the process where the system refuses to start one of its threads. The trial takes 0.2 ms for each thread.

    Raises:
        CapacityError: the system does not start them.
    """
    gate, ended = _thread.allocate_lock(), list[_thread.LockType]()
    gate.acquire()
    try:
        for _ in range(count + TAICHIS_OTHERS):
            done = _thread.allocate_lock()
            done.acquire()
            # Not threading.Thread: an interrupt within its start raises a RuntimeError, or leaves a thread that never ends.
            _thread.start_new_thread(_pass, (gate, done))
            ended.append(done)
    except (RuntimeError, MemoryError):
        most = max(0, len(ended) - TAICHIS_OTHERS)
        raise CapacityError(
            f"the system has no room for {count} threads and starts {most}: use fewer --threads, or end other programs"
        ) from None
    finally:
        gate.release()
        for done in ended:
            done.acquire()


def _pass(gate: _thread.LockType, done: _thread.LockType) -> None:
    """Wait at the gate, and say that this thread has ended."""
    gate.acquire()
    gate.release()
    done.release()


def _raise_interrupt(error: BaseException) -> None:
    """Raise the KeyboardInterrupt behind an error: cut off in `Thread.start`, Python's own lock complains in its place."""
    if isinstance(error.__context__, KeyboardInterrupt):
        raise error.__context__ from None
