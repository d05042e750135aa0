"""The workers of a program that was killed end by themselves."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml

from mpp_taichi.device.with_parent import LOOK_SECONDS
from scenes import kepler

pytestmark = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="children are looked up in /proc")
ROOT = Path(__file__).parents[2]
LONG = {**kepler(dt=0.02), "run": {"duration": 4e6}}
COMMANDS = {
    "check": ["check", "a.yaml", "b.yaml", "--jobs", "2"],
    "compare": ["compare", "a.yaml", "--budget", "600"],
    "beside": ["record", "a.yaml", "--beside", "dt=0.01", "--frames", "film", "--size", "64x48"],
}


def descendants(process):
    """Numbers of all processes below a process."""
    parents = {}
    for entry in Path("/proc").glob("[0-9]*/stat"):
        try:
            words = entry.read_text().rpartition(")")[2].split()
            parents[int(entry.parent.name)] = int(words[1])
        except OSError:  # it ended meanwhile
            continue
    found = {process}
    while more := {child for child, parent in parents.items() if parent in found} - found:
        found |= more
    return found - {process}


def is_running(number):
    try:
        return Path(f"/proc/{number}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


@pytest.mark.parametrize("verb", COMMANDS)
@pytest.mark.sampled(3)
def test_no_worker_outlives_a_killed_program(verb, tmp_path):
    for name in ("a.yaml", "b.yaml"):
        (tmp_path / name).write_text(yaml.safe_dump(LONG), encoding="utf-8")
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-m", "mpp_taichi", *COMMANDS[verb]]
    silent = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    process = subprocess.Popen(command, cwd=tmp_path, env=environment, **silent)
    deadline = time.monotonic() + 60
    while not (below := descendants(process.pid)) and time.monotonic() < deadline:
        time.sleep(0.05)
    time.sleep(1.0)  # past the start of Python in the workers
    below = descendants(process.pid)
    process.send_signal(signal.SIGKILL)
    process.wait()
    deadline = time.monotonic() + 20 * LOOK_SECONDS
    while any(map(is_running, below)) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert below and not any(map(is_running, below))
