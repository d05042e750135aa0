"""Interruption: the first signal ends the run after its files are closed, a second signal ends it at once."""

import os
import signal
import threading
from types import FrameType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from mpp_taichi.simulation.simulation import Simulation

SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))


class Interrupted(Exception):  # noqa: N818 - it is no error
    """A signal asked the run to end; `code` is the exit code, 128 + signal."""

    def __init__(self, number: int) -> None:
        super().__init__(signal.Signals(number).name)
        self.code = 128 + number


class Interruption:
    """Catches SIGINT, SIGTERM and SIGHUP while its block runs; as a recorder it stops the run between two launches.

    The handlers replace an ignored SIGINT too, which a job inherits that a script started with `&`.
    """

    def __init__(self) -> None:
        """Begin without a signal."""
        self._received: int | None = None
        self._before: dict[int, Any] = {}

    def __enter__(self) -> "Interruption":
        """Install the handlers; only the main thread may."""
        if threading.current_thread() is threading.main_thread():
            self._before = {number: signal.signal(number, self._receive) for number in SIGNALS}
        return self

    def __exit__(self, *_: object) -> None:
        """Put back the handlers that were there."""
        for number, handler in self._before.items():
            signal.signal(number, handler if handler is not None else signal.SIG_DFL)

    def _receive(self, number: int, frame: FrameType | None) -> None:
        if self._received is not None:
            os._exit(128 + number)
        self._received = number

    def raise_if_any(self) -> None:
        """Raise Interrupted when a signal has been received."""
        if self._received is not None:
            raise Interrupted(self._received)

    def steps_until_due(self, simulation: "Simulation") -> int:
        """0 when a signal has been received."""
        return 2**31 if self._received is None else 0

    def record(self, simulation: "Simulation") -> None:
        """End the run."""
        self.raise_if_any()

    def restart(self) -> None:
        """Keep a signal that was received."""
