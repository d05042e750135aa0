"""Available memory: what this process can still allocate, by the machine, its control group and its own limit."""

import contextlib
import sys
from collections.abc import Iterator
from pathlib import Path

GROUPS = Path("/sys/fs/cgroup")


def available_bytes() -> int | None:
    """Memory that can be allocated without swapping, in bytes; None where the system does not report it."""
    return min((max(0, each) for each in _bounds()), default=None)


def _bounds() -> Iterator[int]:
    """The bytes that this process can still take under each bound that the system reports."""
    with contextlib.suppress(OSError, LookupError, ValueError):
        yield _kilobytes("/proc/meminfo", "MemAvailable:")
    with contextlib.suppress(OSError, LookupError, ValueError):
        yield _left_in_group()
    if sys.platform != "win32":
        import resource

        limit = resource.getrlimit(resource.RLIMIT_AS)[0]
        if limit != resource.RLIM_INFINITY:
            with contextlib.suppress(OSError, LookupError, ValueError):
                yield limit - _kilobytes("/proc/self/status", "VmSize:")


def _kilobytes(file: str, name: str) -> int:
    """A number of kilobytes of a table of the kernel, in bytes; LookupError where the table does not have it."""
    lines = Path(file).read_text(encoding="utf-8", errors="replace").splitlines()
    words = next((line.split() for line in lines if line.startswith(name)), [])
    return int(words[1]) * 1024


def _left_in_group() -> int:
    """What a container or a service leaves to this process; the cache of files that can be dropped counts as free.

    ValueError where the control group has no bound, OSError or LookupError where there is none.
    """
    for line in Path("/proc/self/cgroup").read_text(encoding="utf-8").splitlines():
        number, kinds, group = line.split(":", 2)
        if number == "0" and not kinds:  # the second version, where all kinds are one tree
            folder, bound, used, dropped = GROUPS, "memory.max", "memory.current", "inactive_file"
        elif "memory" in kinds.split(","):
            folder, bound, used, dropped = (
                GROUPS / kinds,
                "memory.limit_in_bytes",
                "memory.usage_in_bytes",
                "total_inactive_file",
            )
        else:
            continue
        own = folder / group.lstrip("/")
        folder = own if (own / bound).is_file() else folder  # a container sees its own group as the root
        if (folder / bound).is_file():
            table = dict(entry.split() for entry in (folder / "memory.stat").read_text().splitlines())
            return int((folder / bound).read_text()) - int((folder / used).read_text()) + int(table[dropped])
    raise LookupError("no control group bounds the memory")
