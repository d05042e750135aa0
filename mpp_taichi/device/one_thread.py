"""One thread: the thread of Python that started Taichi is the only one that may use it.

Taichi 1.7.4 lets only the thread that called ti.init make and free fields. Its front end keeps what it compiles in one place
for the whole process, so that two threads that compile at the same time end the process. Therefore simulations that are open at
the same time belong to one thread. In another thread a simulation can be made when they are closed, or when their thread has
ended.

`lock` is held while fields are made or freed, while steps are launched, and while Taichi is started or ended. So a ti.init of
another thread of the program waits until a launch has ended, and the run then sees that its runtime has ended.
"""

import threading

from mpp_taichi.errors import MppError

lock = threading.RLock()
OTHER_WAYS = "close every Simulation before another thread makes one, or give each its own process"


class _Owner:
    thread: threading.Thread | None = None  # that started the present runtime
    ident: int | None = None


def take() -> None:
    """Make the present thread the owner of Taichi's runtime; it has just started it."""
    _Owner.thread, _Owner.ident = threading.current_thread(), threading.get_ident()


def is_owner() -> bool:
    """Whether the present thread started Taichi's runtime."""
    return threading.get_ident() == _Owner.ident


def is_owned_elsewhere() -> bool:
    """Whether another thread started Taichi's runtime and still runs."""
    return _Owner.thread is not None and not is_owner() and _Owner.thread.is_alive()


def require_owner() -> None:
    """Raise MppError in every thread but the owner."""
    if threading.get_ident() != _Owner.ident:
        raise MppError(
            f"this Simulation belongs to the thread {_name()}, which made it, as Taichi allows no other thread: make it and run"
            f" it in one thread; {OTHER_WAYS}"
        )


def refuse_second(count: int) -> None:
    """Raise MppError where another thread has `count` > 0 open simulations."""
    if count > 0 and is_owned_elsewhere():
        raise MppError(f"Taichi works for one thread at a time, and the thread {_name()} has an open Simulation: {OTHER_WAYS}")


def begin_anew() -> None:
    """Make the lock anew: in a forked child the other threads do not exist, and one of them may have held it."""
    global lock
    lock = threading.RLock()


def _name() -> str:
    return repr(_Owner.thread.name) if _Owner.thread is not None else "none"
