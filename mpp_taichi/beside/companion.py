"""Companion: the run of the right half, in a process of its own, since a process of Taichi runs one backend only.

The run is ahead of the left half by the few moments that the queue and the pipe hold.
"""

import contextlib
import json
import logging
import os
import queue
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any

from mpp_taichi.beside.half_frame import Moment, MomentReceiver
from mpp_taichi.beside.settings import Beside, BesideError
from mpp_taichi.beside.wire import Message, receive
from mpp_taichi.device.thread_count import start_thread
from mpp_taichi.device.with_parent import child_environment
from mpp_taichi.errors import INTERNAL_ERROR_CODE
from mpp_taichi.recorders.video import OWN_GROUP

log = logging.getLogger(__name__)

QUEUED_MOMENTS = 4
LOOK_SECONDS = 0.1  # between two checks for an interruption
END_SECONDS = 20.0  # in which the process may end by itself, as it still writes its cache of kernels
LONGEST_WORDS = 300


class Companion:
    """The process and the messages from it; a context manager that leaves no process behind.

    `look` is called while a message is awaited, and may raise.
    """

    def __init__(self, beside: Beside, options: dict[str, Any], span: float, count: int, look: Callable[[], None]) -> None:
        """Start the process: a film of so many moments over a span of time, under the options of `Simulation`."""
        self._said, self._look = ", ".join(beside.said), look
        self._receiver = MomentReceiver()
        self._messages: queue.Queue[Message | None] = queue.Queue(QUEUED_MOMENTS)
        self._closing = threading.Event()
        self._at_end = False
        self._errors = tempfile.TemporaryFile()
        root = str(Path(__file__).parents[2])
        self._process = subprocess.Popen(
            [sys.executable, "-m", "mpp_taichi.beside.worker"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            env=child_environment() | {"PYTHONPATH": os.pathsep.join([root, os.environ.get("PYTHONPATH", "")])},
            **OWN_GROUP,  # Ctrl-C reaches the left half only, which then ends both
        )
        source = beside.scene.source
        order = {"scene": beside.scene.resolved, "source": source, "folder": str(Path(source).parent.absolute())}
        self._listener = threading.Thread(target=self._listen, name="right half", daemon=True)
        try:
            start_thread(self._listener)
        except BaseException:
            self._process.kill()
            self._process.communicate()
            self._errors.close()
            raise
        with contextlib.suppress(OSError):  # the process has ended already; `begin` raises the error
            assert self._process.stdin is not None
            with self._process.stdin as pipe:
                pipe.write(json.dumps({**order, "options": options, "span": span, "count": count}).encode())

    def __enter__(self) -> "Companion":
        """The companion itself."""
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        """End the process, at once unless it has sent all its moments."""
        self._closing.set()
        if self._at_end:
            with contextlib.suppress(subprocess.TimeoutExpired):
                self._process.wait(END_SECONDS)
        if self._process.poll() is None:
            self._process.kill()
        self._process.wait()
        self._listener.join()
        self._errors.close()

    def begin(self) -> dict[str, Any]:
        """The facts of the run: backend, precision, plan, threads, integrator, dt, particle_count.

        Raises:
            BesideError: the run could not be started.
        """
        words, _ = self._next("ready")
        return words

    def moment(self) -> Moment:
        """The next moment.

        Raises:
            BesideError: the run broke off.
        """
        return self._receiver.moment(*self._next("moment"))

    def end(self) -> dict[str, Any]:
        """The facts at the end of the run: steps.

        Raises:
            BesideError: the run broke off.
        """
        words, _ = self._next("end")
        self._at_end = True
        return words

    def _next(self, kind: str) -> Message:
        while True:
            self._look()
            with contextlib.suppress(queue.Empty):
                message = self._messages.get(timeout=LOOK_SECONDS)
                if message is None:
                    raise BesideError(f"the right half ({self._said}): {self._death()}", INTERNAL_ERROR_CODE)
                words, _ = message
                if words["kind"] == "failed":
                    raise BesideError(f"the right half ({self._said}): {words['text']}", words["exit_code"])
                if words["kind"] == "warning":
                    log.warning("the right half (%s): %s", self._said, words["text"])
                    continue
                assert words["kind"] == kind, f"{kind} was expected, not {words['kind']}"
                return message

    def _listen(self) -> None:
        """Put the messages of the process into the queue: the work of the listener thread."""
        assert self._process.stdout is not None
        with self._process.stdout as pipe:
            while not self._closing.is_set():
                message = receive(pipe)
                while not self._closing.is_set():
                    with contextlib.suppress(queue.Full):
                        self._messages.put(message, timeout=LOOK_SECONDS)
                        break
                if message is None:
                    return

    def _death(self) -> str:
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(5.0)
        self._errors.seek(0)
        lines = self._errors.read().decode("utf-8", "replace").strip().splitlines()
        last = f": {lines[-1][:LONGEST_WORDS]}" if lines else ""
        return f"its process ended with status {self._process.returncode}{last}"
