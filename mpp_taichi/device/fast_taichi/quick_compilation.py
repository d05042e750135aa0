"""Compiling long kernels in a tenth of the time."""

from collections.abc import Iterator
from contextlib import contextmanager

import taichi as ti


@contextmanager
def quick_compilation() -> Iterator[None]:
    """Compile the kernels first called inside without Taichi's own optimisation, and leave that to LLVM.

    A whole implicit step or all of a contact solver in one kernel is long, and Taichi's passes over it take four to eight times
    as long as all the rest; they make an implicit step a third faster, contacts not at all. Part of the key of Taichi's cache.
    """
    config = ti.lang.impl.current_cfg()
    before = config.opt_level
    config.opt_level = 0
    try:
        yield
    finally:
        config.opt_level = before
