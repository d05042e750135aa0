"""Interruption: the first signal ends the run after its files are closed, a second signal ends it at once.

Python runs a handler only between two of its own instructions, and a library may take minutes between two of them. So a thread
counts the signals, which C's handler reports through a pipe the moment that they arrive. It ends the process at the second
signal, and at the first one where nothing is to be saved and Python does not answer in time. A kernel or the compiler of Taichi
does not let this thread run either; there, the second signal ends the process by `device/second_signal.py`, and SIGTERM alone
after some time by `device/unanswered_signal.py`.
"""

import os
import select
import signal
import threading
import time as clock
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from types import FrameType, TracebackType
from typing import TYPE_CHECKING, Any

from mpp_taichi.cli._terminal import put_last_interruption, say
from mpp_taichi.device import second_signal, unanswered_signal
from mpp_taichi.recorders._lock import release_all

if TYPE_CHECKING:
    from mpp_taichi.simulation.simulation import Simulation

SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))
ANSWER_SECONDS = unanswered_signal.SECONDS  # for Python to answer the first signal, where nothing is to be saved


class Interrupted(Exception):  # noqa: N818 - it is no error
    """A signal asked the run to end; `code` is the exit code, 128 + signal."""

    def __init__(self, number: int) -> None:
        super().__init__(signal.Signals(number).name)
        self.code = 128 + number


class Interruption:
    """Catches SIGINT, SIGTERM and SIGHUP while its block runs; as a recorder it stops the run between two launches.

    The handlers replace an ignored SIGINT too, which a job inherits that a script started with `&`. An ignored SIGHUP stays
    ignored, as the program `nohup` wants it.
    """

    def __init__(self, *, until_first_step: bool = False) -> None:
        """Begin without a signal; `until_first_step`: as in `at_once` until the run that this records has made a step."""
        self._received: int | None = None
        self._before: dict[int, tuple[Any, bool]] = {}  # handler, and whether it was armed
        self._counter: _Counter | None = None
        self._at_once = until_first_step

    def __enter__(self) -> "Interruption":
        """Install the handlers; only the main thread may."""
        if threading.current_thread() is threading.main_thread():
            for number in SIGNALS:
                if signal.getsignal(number) is signal.SIG_IGN and number != signal.SIGINT:
                    continue
                armed = second_signal.is_armed(number)
                self._before[number] = signal.signal(number, self._receive), armed
                second_signal.arm(number)
            if os.name != "nt":  # there, the pipe would have to be a socket
                with suppress(OSError, RuntimeError):  # no file descriptor or no thread is left: the handlers count alone
                    self._counter = _Counter.followed_by(self._leave_unanswered)
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        """Put back the handlers that were there."""
        for number, (handler, armed) in self._before.items():
            second_signal.put_back(number, handler, armed=armed)
        if self._counter is not None:
            self._counter.leave()
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
            self.raise_if_any()  # where something in the block has taken the exception for an error of its own
        finally:
            self._at_once = False

    def _receive(self, number: int, frame: FrameType | None) -> None:
        if self._received is not None:
            os._exit(128 + number)
        self._received = number
        second_signal.put_back(number, self._receive, armed=False)  # Python runs, and knows a better end than the system
        if self._at_once:
            raise Interrupted(number)

    def _leave_unanswered(self, number: int) -> None:
        """End the process in the thread of the counter, where Python has not answered the first signal; nothing is saved."""
        if self._received is None and self._at_once:
            release_all()
            say(f"interrupted by {Interrupted(number)}")
            os._exit(put_last_interruption(128 + number))

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
    """Ends the process at the second signal, also while Python's handler waits for a library to return.

    Interruptions within each other share one counter. Some time after the first signal it calls the function of the innermost.
    """

    present: "_Counter | None" = None

    @classmethod
    def followed_by(cls, unanswered: Callable[[int], None]) -> "_Counter":
        """The counter of this process, for one more interruption."""
        found = cls.present = cls.present or cls()
        found._unanswered.append(unanswered)
        return found

    def __init__(self) -> None:
        self._unanswered: list[Callable[[int], None]] = []
        self._end, self._begin = os.pipe()
        self._watcher = unanswered_signal.watch(self._end, SIGNALS)
        os.set_blocking(self._begin, False)
        self._before = -1
        try:
            threading.Thread(target=self._count, name="signals", daemon=True).start()
        except RuntimeError:
            unanswered_signal.end(self._watcher)
            os.close(self._end)
            os.close(self._begin)
            raise
        self._before = signal.set_wakeup_fd(self._begin, warn_on_full_buffer=False)

    def leave(self) -> None:
        """The innermost interruption ends; after the last one no more signals are reported, and the thread ends."""
        self._unanswered.pop()
        if self._unanswered:
            return
        _Counter.present = None
        signal.set_wakeup_fd(self._before)
        unanswered_signal.end(self._watcher)
        os.close(self._begin)

    def _count(self) -> None:
        poll, count, due = select.poll(), 0, 0.0
        poll.register(self._end, select.POLLIN)
        first = 0
        while True:
            left = None if due == 0.0 else max(0.0, due - clock.monotonic()) * 1000.0
            if not poll.poll(left):
                for unanswered in self._unanswered[-1:]:
                    unanswered(first)
                due = 0.0
                continue
            number = os.read(self._end, 1)
            if not number:
                break
            count += number[0] in SIGNALS
            if count > 1:
                os._exit(128 + number[0])
            if count == 1 and not first:
                first, due = number[0], clock.monotonic() + ANSWER_SECONDS
        os.close(self._end)
