"""Stall: whether a program that writes a file goes on, or hangs.

The time without a sign of life is counted in looks. So the time in which this process itself was stopped (Ctrl-Z, SIGSTOP, a
machine that slept) does not count, in which the other program may have been stopped as well.
"""

import os
import subprocess
import time
from pathlib import Path

from mpp_taichi.recorders._process_stat import stat_words

STALL_SECONDS = 60.0  # a program hangs when its file does not grow, and it does not compute, for this time
LOOK_SECONDS = 0.02


def ends_in_time(process: subprocess.Popen[bytes], file: Path, seconds: float) -> bool:
    """Wait for the end of a program; False where it hung for so many seconds, and was killed."""
    seen, silent = _signs_of_life(process, file), 0.0
    while process.poll() is None:
        time.sleep(LOOK_SECONDS)
        silent += LOOK_SECONDS
        now = _signs_of_life(process, file)
        if now != seen:
            seen, silent = now, 0.0
        elif silent > seconds:
            process.kill()
            process.wait()
            return False
    return True


def _signs_of_life(process: subprocess.Popen[bytes], file: Path) -> tuple[int, str]:
    """The size of its file, and on Linux the processor time that it has taken."""
    try:
        size = os.stat(file).st_size
    except OSError:
        size = -1
    return size, " ".join(stat_words(process.pid)[11:13])
