"""Memory limit: whether this process may have the memory that the program and Taichi take before a scene needs any.

`ulimit -v` bounds the addresses of a process. Where the bound is too low, NumPy's linear algebra ends the process, and Taichi
prints a page about its installation; so memory is asked for before they are loaded, and given back.
"""

import mmap
import sys

from mpp_taichi.errors import CapacityError

LEAST_BYTES = 2**29  # of addresses: Python with NumPy and what it loads take a third of a gibibyte
LOADING_BYTES = 2**29  # of Taichi's compiled part
POOL_BYTES = 2**30  # Taichi 1.7.4 takes memory for fields in pieces of this size on the CPU
ADVICE = "allow more memory (ulimit -v), or end other programs"
SIGNS_OF_NO_MEMORY = ("cannot allocate memory", "failed to map segment", "memory allocation", "bad_alloc", "start new thread")
"""Words, in lower case, of the errors that C libraries, the loader of libraries and Taichi raise when memory is short."""


def require_least() -> None:
    """Refuse a limit of addresses with which not even NumPy can be loaded.

    Raises:
        CapacityError: the limit is below `LEAST_BYTES`.
    """
    if sys.platform == "win32":
        return
    import resource

    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    if limit != resource.RLIM_INFINITY and limit < LEAST_BYTES:
        raise CapacityError(
            f"this process may take {limit / 2**20:.0f} MiB of memory, and needs {LEAST_BYTES >> 20} MiB: {ADVICE}"
        )


def require_memory(count: int) -> None:
    """Take so many bytes of memory, and give them back; no page of them is touched. It takes 10 µs.

    Raises:
        CapacityError: the system does not give them.
    """
    try:
        mmap.mmap(-1, count).close()
    except (OSError, MemoryError):
        raise CapacityError(
            f"the system does not give the {count / 2**30:.3g} GiB of memory that Taichi takes: {ADVICE}"
        ) from None


def tells_no_memory(error: BaseException) -> bool:
    """Whether an error of a library says that memory is short."""
    return isinstance(error, MemoryError) or any(sign in str(error).lower() for sign in SIGNS_OF_NO_MEMORY)


def most_resident_bytes() -> int | None:
    """The most memory that this process has had so far, with Taichi, NumPy and kernels; None where the system does not say."""
    try:
        import resource
    except ImportError:  # Windows
        return None
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return int(most if sys.platform == "darwin" else most * 1024)
