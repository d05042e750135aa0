"""Worker threads that share the parallel loops of kernels on a CPU, in place of Taichi's own.

Taichi 1.7.4 puts its threads to sleep after each loop, wakes them for the next loop, and lets the calling thread sleep
meanwhile. This takes 25 to 60 µs a loop on a virtual machine, as long as 50,000 particles take to move. Here the calling thread
takes its share of each loop, and the worker threads poll for the next loop for a while before they sleep (worker_threads.c):
2 µs a loop. Taichi never fixed which thread takes which part of a loop, so the results stay the same.
"""

import atexit
import ctypes
import functools
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from mpp_taichi.device.fast_taichi import bitcode, switch

SOURCE = Path(__file__).with_suffix(".c")
PATIENCE = 50_000  # ns that a thread polls for a loop before it sleeps: the way through Python between two launches is shorter


def install() -> None:
    """Have Taichi's reset, and the end of Python, wait for the end of the threads."""
    from taichi.lang import impl

    plain = impl.reset

    @functools.wraps(plain)
    def reset() -> None:
        stop()
        plain()

    impl.reset = reset
    atexit.register(stop)


def start() -> None:
    """Start the threads in the Taichi runtime that has just been started.

    Another system or processor keeps Taichi's own threads, and so does a process in which this part is off.
    """
    import taichi as ti

    if not switch.is_on("worker_threads") or not bitcode.on_linux_x64():
        return
    threads = int(ti.lang.impl.current_cfg().cpu_max_num_threads)
    address = _installer()(threads - 1, PATIENCE if threads <= len(os.sched_getaffinity(0)) else 0)
    _Running.stop = ctypes.CFUNCTYPE(None)(address)


def stop() -> None:
    """End the threads; Taichi holds their code, and its reset removes the code."""
    stop_running, _Running.stop = _Running.stop, None
    if stop_running is not None:
        stop_running()


def let_go() -> None:
    """Forget the threads without ending them: in a forked child they do not exist."""
    _Running.stop = None


class _Running:
    stop: Callable[[], None] | None = None  # ends the threads that run; None where none run


@functools.cache
def _installer() -> Any:
    """The kernel that starts the threads and hands them to Taichi's runtime."""
    import taichi as ti

    @ti.kernel
    def hand_over(workers: ti.i32, patience: ti.i32) -> ti.i64:
        wanted, nanoseconds, address_of_stop = workers, patience, ti.i64(0)
        ti.static(bitcode.call(SOURCE, "prepare", wanted, nanoseconds, address_of_stop))
        ti.lang.impl.call_internal("do_nothing")
        return address_of_stop

    return hand_over
