"""Large pages for Taichi's fields: a place far away is then found without a look into tables that are far away too.

A processor keeps the addresses of one or two thousand pages at hand. With 4 KiB a page that is a few megabytes, and a program
that jumps about in more, as the event-driven solver and the walk of a tree do, waits twice for what it reads. Linux from 6.1 on
moves memory into pages of 2 MiB when asked to  [madvise(2), MADV_COLLAPSE]; elsewhere nothing is done.
"""

import ctypes
import re
import sys
from collections.abc import Callable, Iterator
from mmap import PAGESIZE
from pathlib import Path

import numpy as np

LARGE_PAGE = 1 << 21
MANY_PARTICLES = 1 << 14
"""From so many on fields are large enough to gain by it: the fields of fewer lie at hand anyway."""
MADV_COLLAPSE = 25
PRESENT = 1  # in the answers of mincore
_MAPPING = re.compile(r"([0-9a-f]+)-([0-9a-f]+) rw-p 00000000 00:00 0\s*$")


def use_large_pages() -> int:
    """Move all memory of this process that is in use, page by page of 2 MiB, into large pages; the bytes that are in such now.

    What is not in use, as most of what Taichi reserves, stays unused. Where the system has no such pages to give, or keeps
    them from programs, everything goes on as before.
    """
    if not sys.platform.startswith("linux"):
        return 0
    try:
        mappings = Path("/proc/self/maps").read_text().splitlines()
        library = ctypes.CDLL(None)
        advise, in_core = library.madvise, library.mincore
    except (OSError, AttributeError):
        return 0
    advise.argtypes = (ctypes.c_void_p, ctypes.c_size_t, ctypes.c_int)
    in_core.argtypes = (ctypes.c_void_p, ctypes.c_size_t, ctypes.c_void_p)
    moved = 0
    for line in mappings:
        if found := _MAPPING.match(line):
            for first, size in _in_use(in_core, *(int(group, 16) for group in found.groups())):
                moved += size * (advise(first, size, MADV_COLLAPSE) == 0)
    return moved


def _in_use(in_core: Callable[[int, int, int], int], first: int, end: int) -> Iterator[tuple[int, int]]:
    """Runs (address, bytes) of whole large pages of a mapping, all of whose small pages are in use."""
    first, end = -(-first // LARGE_PAGE) * LARGE_PAGE, end // LARGE_PAGE * LARGE_PAGE
    if end <= first:
        return
    pages = np.zeros((end - first) // PAGESIZE, np.uint8)
    if in_core(first, end - first, pages.ctypes.data) != 0:
        return
    whole = (pages.reshape(-1, LARGE_PAGE // PAGESIZE) & PRESENT).all(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], whole, [False]])))
    for begin, stop in edges.reshape(-1, 2).tolist():
        yield first + begin * LARGE_PAGE, (stop - begin) * LARGE_PAGE
