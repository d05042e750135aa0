"""Exhausted: errors of Python that say that the machine has no more memory, processes, threads or open files."""

import errno

from mpp_taichi.device.memory_limit import ADVICE
from mpp_taichi.device.thread_count import NO_MORE_THREADS
from mpp_taichi.errors import CapacityError

REASONS = {
    errno.EAGAIN: "the system starts no more processes: end other programs, or allow more (ulimit -u)",
    errno.ENOMEM: f"the system has no more memory for this program: {ADVICE}",
    errno.EMFILE: "this program may open no more files: allow more (ulimit -n)",
    errno.ENFILE: "the system opens no more files: end other programs",
}


def exhausted(error: BaseException) -> CapacityError | None:
    """The error for the user where something of the machine is used up; None for every other error."""
    if isinstance(error, MemoryError):
        words = " ".join(str(error).split())  # NumPy's have the size and the shape
        return CapacityError(f"the system has no more memory for this program{f' ({words})' if words else ''}: {ADVICE}")
    if isinstance(error, RuntimeError) and "start new thread" in str(error):
        return CapacityError(NO_MORE_THREADS)
    reason = REASONS.get(error.errno or 0) if isinstance(error, OSError) else None
    return None if reason is None else CapacityError(reason)
