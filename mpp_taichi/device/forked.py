"""Forked: a child process that was forked from one in which Taichi runs.

The threads of Taichi, of its compiler and of worker_threads.py do not come along into the child, and what they had locked stays
locked for ever. A start of Taichi in the child, or the end of its runtime when the child exits, would wait for them without
end. Therefore the child lets go of the runtime without ending it, and a Simulation raises BackendError there.
"""

import ctypes
import os

from mpp_taichi.device import one_thread, own_runtime
from mpp_taichi.device.fast_taichi import worker_threads
from mpp_taichi.errors import BackendError

REFUSAL = (
    "this process was forked from one in which Taichi ran, and its threads did not come along: start processes by"
    " multiprocessing's method spawn, or close every Simulation before the fork"
)


class _Child:
    cannot_start = False  # whether Taichi ran when this process was forked


def install() -> None:
    """Watch the forks of this process, on systems that have them."""
    if hasattr(os, "register_at_fork"):
        os.register_at_fork(after_in_child=_let_go)


def refuse_child() -> None:
    """Raise BackendError in a child that was forked while Taichi ran."""
    if _Child.cannot_start:
        raise BackendError(REFUSAL)


def _let_go() -> None:
    """Leave the runtime of the parent alone in the child."""
    from taichi.lang import impl

    one_thread.begin_anew()
    runtime = impl.get_runtime()
    if runtime.prog is None:
        return
    _Child.cannot_start = True
    if own_runtime.is_own():
        worker_threads.let_go()
        ctypes.pythonapi.Py_IncRef(ctypes.py_object(runtime.prog))  # it never becomes 0, so nothing ends the runtime
        impl.pytaichi = impl.PyTaichi(runtime.kernels)
        for kernel in runtime.kernels:
            kernel.reset()
        own_runtime.end_fields()
