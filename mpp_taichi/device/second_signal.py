"""Second signal: a signal that arrives again ends the process, also where no instruction of Python runs any more.

A kernel or the compiler of Taichi lets no thread of Python run until it returns. A handler that Python sets is only noted then.
System V's `signal` sets the same function of C in such a way that its first call gives the signal back to the system: the
second signal of the same number ends the process at once, with the exit status of this signal. Only C libraries of Linux have
that function; elsewhere the second signal is answered after the kernel.
"""

import ctypes
import signal
from contextlib import suppress
from typing import Any

_armed: set[int] = set()


def arm(number: int) -> None:
    """Let the present handler of a signal be called once; a handler that is set anew by `signal.signal` is not armed."""
    with suppress(AttributeError, OSError, TypeError):
        set_once, get = ctypes.CDLL(None).sysv_signal, ctypes.pythonapi.PyOS_getsig
        set_once.argtypes, set_once.restype = [ctypes.c_int, ctypes.c_void_p], ctypes.c_void_p
        get.argtypes, get.restype = [ctypes.c_int], ctypes.c_void_p
        set_once(number, get(number))
        _armed.add(number)


def is_armed(number: int) -> bool:
    """Whether the handler of a signal was armed by this module."""
    return number in _armed


def put_back(number: int, handler: Any, *, armed: bool) -> None:
    """Set an earlier handler, armed as it was; None stands for a handler that Python does not know."""
    _armed.discard(number)
    signal.signal(number, handler if handler is not None else signal.SIG_DFL)
    if armed:
        arm(number)
