"""Runs of the command line that are cut off by signals, in which an archive is written when it is asked for."""

import signal
import subprocess
import time

from mpp_taichi.archive.record_file import STATE, RecordFile
from mpp_taichi.errors import MppError

KILL, TERM, RECORD = getattr(signal, "SIGKILL", 9), signal.SIGTERM, getattr(signal, "SIGUSR1", 10)
PAUSE = 0.1  # seconds before each signal, so that the run goes on a little


def with_scene(folder, text):
    """The folder, in which s.yaml has the text."""
    (folder / "s.yaml").write_text(text)
    return folder


def run_whole(command, folder):
    """The end of a command that no signal cuts off."""
    return subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300, check=False)


def cut_off(command, folder, signals):
    """Begin a command, and send it signals when it has begun to step; after RECORD its record is waited for."""
    process = subprocess.Popen(command, cwd=folder, stderr=subprocess.PIPE, text=True)
    said = []
    for line in process.stderr:
        said.append(line)
        if "steps/s" in line:
            break
    for each in signals:
        time.sleep(PAUSE)
        before = states(folder)
        process.send_signal(each)
        while each == RECORD and process.poll() is None and states(folder) == before:
            time.sleep(0.02)
    said.append(process.communicate(timeout=100)[1])
    assert process.returncode in (-KILL, 128 + TERM), "".join(said)
    return process.returncode


def states(folder):
    """Number of the whole states in the archive of s.yaml."""
    try:
        file = RecordFile.open(folder / "out" / "s.run", to_append=False)
    except MppError:  # there is none yet
        return 0
    file.close()
    return sum(record.kind == STATE for record in file.records)
