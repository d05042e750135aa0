"""Threads of a CPU that share the loops of kernels, in place of Taichi's.

Taichi 1.7.4 puts its threads to sleep after each loop, wakes them for the next one, and lets the calling thread sleep
meanwhile: 25 to 60 µs a loop on a virtual machine, as long as 50,000 particles take to move. Here the calling thread takes its
share, and the others look for the next loop a while before they sleep (worker_threads.c): 2 µs. Who does which part of a loop
was never fixed, so results stay as they were.
"""

import atexit
import ctypes
import functools
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mpp_taichi.device.fast_taichi import bitcode

SOURCE = Path(__file__).with_suffix(".c")
PATIENCE = 50_000  # ns that a thread looks for a loop before it sleeps: the way through Python between two launches is shorter
KNOWN = (1, 7, 4)  # the version of Taichi whose structures worker_threads.c names


def hire() -> None:
    """Install the threads in the Taichi that has just been started.

    Another system, processor or version of Taichi keeps Taichi's own.
    """
    import taichi as ti

    if ti.__version__ != KNOWN or not bitcode.on_linux_x64():
        return
    _leave_before_reset()
    threads = int(ti.lang.impl.current_cfg().cpu_max_num_threads)
    address = _installer()(threads - 1, PATIENCE if threads <= len(os.sched_getaffinity(0)) else 0)
    _Hired.leave = ctypes.CFUNCTYPE(None)(address)


def dismiss() -> None:
    """End the threads: their code is Taichi's, and goes with it."""
    leave, _Hired.leave = _Hired.leave, None
    if leave is not None:
        leave()


class _Hired:
    leave: Callable[[], None] | None = None


@functools.cache
def _installer() -> Any:
    """The kernel that hires and installs."""
    import taichi as ti

    @ti.kernel
    def install(workers: ti.i32, patience: ti.i32) -> ti.i64:
        wanted, nanoseconds, leave = workers, patience, ti.i64(0)
        ti.static(bitcode.call(SOURCE, "prepare", wanted, nanoseconds, leave))
        ti.lang.impl.call_internal("do_nothing")
        return leave

    return install


@functools.cache
def _leave_before_reset() -> None:
    """Have Taichi's reset, and the end of Python, wait for the threads."""
    from taichi.lang import impl

    plain = impl.reset

    @functools.wraps(plain)
    def reset() -> None:
        dismiss()
        plain()

    impl.reset = reset
    atexit.register(dismiss)
