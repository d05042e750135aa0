"""In turn: methods of a simulation that use its device, in the thread that made it and while it lives."""

import functools
from collections.abc import Callable
from typing import Any, Concatenate, ParamSpec, TypeVar

from mpp_taichi.device import one_thread
from mpp_taichi.device.interrupted import tidied_after
from mpp_taichi.errors import MppError

P = ParamSpec("P")
ENDED = (
    "this simulation has ended: it was closed, another one started a different backend or precision, or the program called"
    " ti.init or ti.reset or was forked; make a new Simulation, where `start=` goes on from a saved state"
)
R = TypeVar("R")
S = TypeVar("S", bound=Any)


def require_life(simulation: Any) -> None:
    """Raise MppError where the simulation has ended, or belongs to another thread."""
    if not simulation.is_alive:
        raise MppError(ENDED)
    one_thread.require_owner()


def in_turn(method: Callable[Concatenate[S, P], R]) -> Callable[Concatenate[S, P], R]:
    """The method, which holds the lock of device/one_thread.py and asks `require_life` first.

    An exception out of it, a KeyboardInterrupt too, leaves nothing unfinished in Taichi (device/interrupted.py).
    """

    @functools.wraps(method)
    def call(self: S, *arguments: P.args, **named: P.kwargs) -> R:
        with one_thread.lock:
            require_life(self)
            with tidied_after():
                return method(self, *arguments, **named)

    return call
