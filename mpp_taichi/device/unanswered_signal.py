"""Unanswered signal: the first SIGTERM ends the process also where a kernel or the compiler of Taichi runs for long.

Such a call lets no thread of Python run until it returns, which may take minutes. So a small process of its own watches the
pipe into which C's handler writes each signal. Where nothing has been read from the pipe for SECONDS, no instruction of Python
runs. Where, besides, the handler of SIGTERM or SIGHUP is gone, the signal was SIGTERM or SIGHUP (`second_signal.py` lets a
handler be called once), and the watching process sends it again, which ends the process. The last record of its archive stays.
SIGINT waits for the kernel: the person at the keyboard can press Ctrl-C again. Only on Linux, whose /proc tells which handlers
a process has.
"""

import os
import signal
import sys
from collections.abc import Iterable
from contextlib import suppress

from mpp_taichi.device import second_signal

SECONDS = 1.5  # without an answer
FINAL = ("SIGTERM", "SIGHUP")  # a command is to end by itself, without a second signal
_SOURCE = """
import os, select, sys, time
parent, seconds, numbers = int(sys.argv[1]), float(sys.argv[2]), [int(each) for each in sys.argv[3:]]
poll = select.poll()
poll.register(0, select.POLLIN)
while poll.poll()[0][1] == select.POLLIN:
    time.sleep(seconds)
    if poll.poll(0) == [(0, select.POLLIN)]:
        with open(f"/proc/{parent}/status") as status:
            handled = next(int(line.split()[1], 16) for line in status if line.startswith("SigCgt"))
        for number in numbers:
            if not handled >> (number - 1) & 1:
                os.kill(parent, number)
"""


def watch(pipe: int, numbers: Iterable[int]) -> int | None:
    """Start the process that watches the end of a pipe for these signals; its number, or None where there is none.

    It ends by itself with the last writer of the pipe (poll then says POLLHUP too), which must not be inherited.
    """
    wanted = [str(number) for number in numbers if signal.Signals(number).name in FINAL and second_signal.is_armed(number)]
    if sys.platform != "linux" or not sys.executable or not wanted:
        return None
    words = [sys.executable, "-I", "-S", "-c", _SOURCE, str(os.getpid()), str(SECONDS), *wanted]
    silent = [(os.POSIX_SPAWN_OPEN, number, os.devnull, os.O_WRONLY, 0) for number in (1, 2)]
    with suppress(OSError):  # no process is left, or no memory
        actions = [(os.POSIX_SPAWN_DUP2, pipe, 0), *silent]
        return os.posix_spawn(sys.executable, words, os.environ, file_actions=actions, setsid=True)
    return None


def end(watcher: int | None) -> None:
    """End the process that watches."""
    if watcher is not None:
        with suppress(ProcessLookupError, ChildProcessError):
            os.kill(watcher, signal.SIGKILL)
            os.waitpid(watcher, 0)
