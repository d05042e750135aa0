"""Signals: at any moment the program ends in time, with the exit code of the signal, one line, and nothing left over."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml

from scenes import kepler

pytestmark = pytest.mark.skipif(os.name == "nt", reason="POSIX signals")
ROOT = Path(__file__).parents[2]
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT)}


def begin(program, *words):
    return subprocess.Popen(
        [sys.executable, "-c", program, *words], env=ENVIRONMENT, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def leftovers():
    return [*Path().glob("**/*.part*"), *Path().glob("**/.*.lock")]


@pytest.mark.parametrize("wait", [0.02, 0.1, 0.3])
def test_a_signal_while_the_program_is_imported_is_answered_by_a_line(wait):
    program = "import threading, os, signal, sys, time\nfrom mpp_taichi.cli import entry\n"
    program += f"threading.Timer({wait}, os.kill, (os.getpid(), signal.SIGINT)).start()\nentry.main()\ntime.sleep(9)"
    process = begin(program, "schema")
    _, told = process.communicate(timeout=60)
    assert process.returncode == 130 and told == "interrupted by SIGINT\n"


IN_COMPILER = """
import os, signal, sys
from mpp_taichi.cli.main import main
from taichi.lang import kernel_impl
before = kernel_impl.transform_tree
def transform(*words):
    if words[1].func.func.__name__ == sys.argv[2]:
        os.kill(os.getpid(), signal.SIGTERM)
    return before(*words)
kernel_impl.transform_tree = transform
sys.exit(main(["record", sys.argv[1], "--video", "f.mp4"]))
"""


@pytest.mark.parametrize(("kernel", "saved"), [("_write", []), ("_advance", ["f.mp4", "out/s.interrupted.npz"])])
def test_a_signal_ends_a_run_within_the_compiler_which_makes_other_errors_of_it(tmp_path, monkeypatch, kernel, saved):
    monkeypatch.chdir(tmp_path)
    Path("s.yaml").write_text(yaml.safe_dump({**kepler(dt=0.02), "run": {"duration": 4e6}}), encoding="utf-8")
    process = begin(IN_COMPILER, "s.yaml", kernel)
    _, told = process.communicate(timeout=60)
    assert process.returncode == 143 and "interrupted" in told and "error:" not in told
    assert not leftovers() and [str(each) for each in sorted(Path().glob("**/*.[mn]p*"))] == saved


IN_C = """
import ctypes
from mpp_taichi.cli._signals import Interruption
mutex = ctypes.create_string_buffer(64)  # a mutex of pthreads: locking it twice waits for ever, and signals do not end the call
lock = ctypes.CDLL(None).pthread_mutex_lock
with Interruption():
    lock(mutex)
    print("ready", flush=True)
    lock(mutex)
"""


def test_a_second_signal_ends_the_process_at_once_also_within_a_long_call_of_c():
    process = begin(IN_C)
    process.stdout.readline()
    process.send_signal(signal.SIGTERM)
    time.sleep(0.2)
    process.send_signal(signal.SIGINT)
    began = time.monotonic()
    assert process.wait(timeout=20) == 130 and time.monotonic() - began < 2.0
    process.communicate()
