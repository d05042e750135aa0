"""Signals held back while a library is imported, which would make an error of its own of them.

Taichi takes an exception within the import of its compiled part for a broken installation, and prints a page about it.
"""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

from mpp_taichi.device import second_signal

NAMES = ("SIGINT", "SIGTERM", "SIGHUP")


@contextmanager
def signals_held() -> Iterator[None]:
    """A block in which a signal with a handler in Python waits; the handler is called when the block ends.

    In another thread than the main thread nothing is done, since Python calls handlers in the main thread only. A signal
    that is ignored, or ends the process without Python, stays as it is.
    """
    held: list[int] = []
    before: dict[int, Any] = {}
    armed = {getattr(signal, name) for name in NAMES if second_signal.is_armed(getattr(signal, name, -1))}

    def hold(number: int, frame: FrameType | None) -> None:
        held.append(number)

    if threading.current_thread() is threading.main_thread():
        for number in (getattr(signal, name) for name in NAMES if hasattr(signal, name)):
            if callable(signal.getsignal(number)):
                before[number] = signal.signal(number, hold)
    try:
        yield
    finally:
        for number, handler in before.items():
            second_signal.put_back(number, handler, armed=number in armed)
        for number in held:
            before[number](number, None)
