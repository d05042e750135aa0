"""Large pages for Taichi's fields: an access to memory then rarely waits for the address of its page.

A processor keeps the addresses of one or two thousand pages at hand. With pages of 4 KiB these cover a few megabytes. A program
that jumps about in more memory, as the event-driven solver and the walk of a tree do, waits twice for each access: first for
the address of the page, then for the number itself. Linux from 6.1 on moves memory into pages of 2 MiB on request
[madvise(2), MADV_COLLAPSE]; on other systems nothing is done.
"""

import ctypes
import re
import sys
from collections.abc import Callable, Iterator
from mmap import PAGESIZE
from pathlib import Path

import numpy as np

from mpp_taichi.device.fast_taichi import switch

LARGE_PAGE = 1 << 21
MANY_PARTICLES = 1 << 14
"""From this number on the fields are so large that they gain; the fields of fewer particles fit into the cache."""
MADV_COLLAPSE = 25
PRESENT = 1  # in the answers of mincore
_MAPPING = re.compile(r"([0-9a-f]+)-([0-9a-f]+) rw-p 00000000 00:00 0\s*$")


def use_large_pages() -> int:
    """Move the memory in use by this process into pages of 2 MiB, and return the number of bytes that lie in them now.

    Memory that is not in use, as most of the memory that Taichi reserves, stays unused. Where the system has no large pages
    left, or gives none to programs, nothing changes.
    """
    if not sys.platform.startswith("linux") or not switch.is_on("large_pages"):
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
    """Stretches (address, bytes) of a mapping that consist of whole large pages, of which all small pages are in use."""
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
