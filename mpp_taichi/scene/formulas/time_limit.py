"""A limit of the time in which the derivatives of a formula are formed.

The limits of grammar.py keep derivatives short. SymPy asks more of an expression, though, than its derivatives, such as whether
it is real, and may multiply out a power in order to answer: in rare formulas of a hundred parts this takes hours.
"""

import ctypes
import functools
import threading
import time
from collections.abc import Callable
from typing import Any, TypeVar

from mpp_taichi.scene.expressions import ExpressionError

Derive = TypeVar("Derive", bound=Callable[..., Any])
SECONDS_ALLOWED = 20.0
"""Processor time of the derivatives of a formula; the slowest formula that was found among useful ones takes four seconds."""
SECONDS_BETWEEN = 0.25  # two looks at the clock


class _Stopped(BaseException):
    """The time is over. It is no Exception, so that SymPy does not catch it."""


def in_time(derive: Derive) -> Derive:
    """The function with the limit: where it takes longer, ExpressionError."""

    @functools.wraps(derive)
    def limited(*given: Any) -> Any:
        try:
            with _Watch():
                return derive(*given)
        except _Stopped:
            from sympy.core.cache import clear_cache

            clear_cache()  # of what SymPy was about to find out
            told = f"the derivatives of the formula take more than {SECONDS_ALLOWED:g} s; write it more simply"
            raise ExpressionError(told) from None

    return limited  # type: ignore[return-value]


class _Watch:
    """A thread that stops the thread which enters, once it has used up its processor time."""

    def __init__(self) -> None:
        """Watch the present thread."""
        self._watched = threading.get_ident()
        self._lock, self._end, self._is_over = threading.Lock(), threading.Event(), False
        self._until = _processor_time(self._watched) + SECONDS_ALLOWED

    def __enter__(self) -> None:
        """Begin."""
        threading.Thread(target=self._watch, daemon=True).start()

    def __exit__(self, *_: Any) -> None:
        """End. A stop that was sent a moment before comes up in the last line, and the time is over indeed.

        It is not taken back: Python would go on to look for it at every call, and would not come out of the first call under a
        profiler (CPython 3.11).
        """
        with self._lock:
            self._is_over = True
        self._end.set()

    def _watch(self) -> None:
        """Stop the thread; again where the stop was lost, as it is in the destructor of an object."""
        while not self._end.wait(SECONDS_BETWEEN):
            with self._lock:
                if not self._is_over and _processor_time(self._watched) > self._until:
                    # The error comes up in the thread, at its next call.
                    ctypes.pythonapi.PyThreadState_SetAsyncExc(ctypes.c_ulong(self._watched), ctypes.py_object(_Stopped))


def _processor_time(thread: int) -> float:
    """Processor time of a thread, or of the process where the system has no clock of a thread [s]."""
    clock_of = getattr(time, "pthread_getclockid", None)
    return time.process_time() if clock_of is None else time.clock_gettime(clock_of(thread))
