"""Interruption: the first signal ends the run after its files are closed, a second signal ends it at once.

Python runs a handler only between two of its own instructions, and a compiler may take seconds between two of them. So a thread
counts the signals, which C's handler reports through a pipe the moment that they arrive.
"""

import os
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType, TracebackType
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

    def __init__(self, *, until_first_step: bool = False) -> None:
        """Begin without a signal; `until_first_step`: as in `at_once` until the run that this records has made a step."""
        self._received: int | None = None
        self._before: dict[int, Any] = {}
        self._counter: _Counter | None = None
        self._at_once = until_first_step

    def __enter__(self) -> "Interruption":
        """Install the handlers; only the main thread may."""
        if threading.current_thread() is threading.main_thread():
            self._before = {number: signal.signal(number, self._receive) for number in SIGNALS}
            if os.name != "nt":  # there, the pipe would have to be a socket
                with suppress(OSError, RuntimeError):  # no file descriptor or no thread is left: the handlers count alone
                    self._counter = _Counter()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        """Put back the handlers that were there."""
        for number, handler in self._before.items():
            signal.signal(number, handler if handler is not None else signal.SIG_DFL)
        if self._counter is not None:
            self._counter.close()
        self._unwrap(error)

    def _unwrap(self, error: BaseException | None) -> None:
        """Raise Interrupted for an error that Taichi made of an Interrupted within its compiler."""
        if self._at_once and isinstance(error, Exception) and not isinstance(error, Interrupted):
            self.raise_if_any()

    @contextmanager
    def unwrapped(self) -> Iterator[None]:
        """A block out of which Interrupted comes as itself, also where Taichi's compiler has made another error of it."""
        try:
            yield
        except Exception as error:
            self._unwrap(error)
            raise

    @contextmanager
    def at_once(self) -> Iterator[None]:
        """Raise Interrupted in the midst of this block when a signal arrives, for work that is not to be saved."""
        self.raise_if_any()
        self._at_once = True
        try:
            with self.unwrapped():
                yield
        finally:
            self._at_once = False

    def _receive(self, number: int, frame: FrameType | None) -> None:
        if self._received is not None:
            os._exit(128 + number)
        self._received = number
        if self._at_once:
            raise Interrupted(number)

    def raise_if_any(self) -> None:
        """Raise Interrupted when a signal has been received."""
        if self._received is not None:
            raise Interrupted(self._received)

    def steps_until_due(self, simulation: "Simulation") -> int:
        """0 when a signal has been received."""
        if simulation.step_count > 0:
            self._at_once = False  # from now on there is something to save
        return 2**31 if self._received is None else 0

    def record(self, simulation: "Simulation") -> None:
        """End the run."""
        self.raise_if_any()

    def restart(self) -> None:
        """Keep a signal that was received."""


class _Counter:
    """Ends the process at the second signal, also while Python's handler waits for a compiler or a kernel to return."""

    def __init__(self) -> None:
        self._end, self._begin = os.pipe()
        os.set_blocking(self._begin, False)
        self._before = -1
        try:
            threading.Thread(target=self._count, name="signals", daemon=True).start()
        except RuntimeError:
            os.close(self._end)
            os.close(self._begin)
            raise
        self._before = signal.set_wakeup_fd(self._begin, warn_on_full_buffer=False)

    def close(self) -> None:
        """Report no more signals; the thread ends."""
        signal.set_wakeup_fd(self._before)
        os.close(self._begin)

    def _count(self) -> None:
        count = 0
        while number := os.read(self._end, 1):
            count += number[0] in SIGNALS
            if count > 1:
                os._exit(128 + number[0])
        os.close(self._end)
