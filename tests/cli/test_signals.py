"""Signals: at any moment the program ends in time, with the exit code of the signal, one line, and nothing left over."""

import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml

from mpp_taichi.cli._signals import Interrupted, Interruption
from scenes import kepler

pytestmark = pytest.mark.skipif(os.name == "nt", reason="POSIX signals")
ROOT = Path(__file__).parents[2]
ENVIRONMENT = {**os.environ, "PYTHONPATH": str(ROOT)}


def begin(program, *words):
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    # A background job of a shell is started with interrupts ignored, and so would be its children.
    restore = {"preexec_fn": lambda: signal.signal(signal.SIGINT, signal.SIG_DFL)}
    return subprocess.Popen([sys.executable, "-c", program, *words], env=ENVIRONMENT, **pipes, **restore)


def wait_for_the_lock(process):
    """Wait until the main thread of a program that says "ready" sleeps, which it does in the call behind that word."""
    process.stdout.readline()
    while Path("/proc/self/stat").exists():
        if Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()[0] == "S":
            return
        time.sleep(0.01)
    time.sleep(0.5)


def leftovers():
    return [*Path().glob("**/*.part*"), *Path().glob("**/.*.lock")]


IN_IMPORT = """
import os, signal, sys
from mpp_taichi.cli import entry
class Finder:
    @staticmethod
    def find_spec(name, path=None, target=None):
        if name == sys.argv[2]:
            os.kill(os.getpid(), signal.SIGINT)
sys.meta_path.insert(0, Finder)
entry.main()
"""


@pytest.mark.parametrize("module", ["mpp_taichi.cli._terminal", "mpp_taichi.missing_package", "mpp_taichi.cli.main"])
def test_a_signal_while_the_program_is_imported_is_answered_by_a_line(module):
    process = begin(IN_IMPORT, "schema", module)
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
@pytest.mark.sampled(3)
def test_a_signal_ends_a_run_within_the_compiler_which_makes_other_errors_of_it(tmp_path, monkeypatch, kernel, saved):
    monkeypatch.chdir(tmp_path)
    scene = {**kepler(dt=0.02), "run": {"duration": 4e6}, "view": {"camera": {"position": [0, 0, 5]}}}  # else it is looked for
    Path("s.yaml").write_text(yaml.safe_dump(scene), encoding="utf-8")
    process = begin(IN_COMPILER, "s.yaml", kernel)
    told = "".join(process.communicate(timeout=60))
    assert process.returncode == 143 and "interrupted" in told and "error:" not in told
    assert not leftovers() and [str(each) for each in sorted(Path().glob("**/*.[mn]p*"))] == saved


SLOW_SAMPLES = """
import os, signal, sys, time
from mpp_taichi.cli.main import main
from mpp_taichi.recorders.table import TableRecorder
from mpp_taichi.simulation.watched_launches import WatchedLaunches
before = TableRecorder.record
def record(self, simulation):
    print("sample of step", simulation.step_count, file=sys.stderr, flush=True)
    time.sleep(float(sys.argv[1]))
    before(self, simulation)
TableRecorder.record = record
launch = WatchedLaunches.launch
def launched(self, *words):
    launch(self, *words)
    if self.timings.launch_count == 2:  # the first two launches have one step each, after which no sample is due
        os.kill(os.getpid(), signal.SIGTERM)
WatchedLaunches.launch = launched
sys.exit(main(["run", "s.yaml", "--headless", "--every", "10", "--quiet", "--diagnostics", "t.csv"]))
"""


@pytest.mark.parametrize(("seconds", "samples"), [(0.0, 2), (1.0, 1)])
@pytest.mark.sampled(3)
def test_an_interrupted_run_takes_its_last_sample_only_where_samples_are_quick(seconds, samples, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    scene = kepler(dt=0.02, integrator="rk4")
    Path("s.yaml").write_text(yaml.safe_dump({**scene, "run": {"duration": 4e3}}), encoding="utf-8")
    process = begin(SLOW_SAMPLES, str(seconds))
    _, told = process.communicate(timeout=60)
    assert process.returncode == 143 and told.count("sample of step") == samples
    assert len(Path("t.csv").read_text().splitlines()) == samples + 1 and Path("out/s.interrupted.npz").is_file()


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
    wait_for_the_lock(process)
    process.send_signal(signal.SIGTERM)
    time.sleep(0.2)
    process.send_signal(signal.SIGINT)
    began = time.monotonic()
    assert process.wait(timeout=20) == 130 and time.monotonic() - began < 2.0
    process.communicate()


IN_KERNEL = """
import ctypes
from mpp_taichi.cli._signals import Interruption
from mpp_taichi.device.held_signals import signals_held
mutex = ctypes.create_string_buffer(64)
lock = ctypes.PyDLL(None).pthread_mutex_lock  # which lets no other thread of Python run, as a kernel of Taichi
with Interruption() as outer, outer.at_once():
    with signals_held():
        pass
    with Interruption():
        pass
    lock(mutex)
    print("ready", flush=True)
    lock(mutex)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="System V's signal in a C library of Linux")
@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_a_second_signal_ends_the_process_where_no_thread_of_python_runs(number):
    process = begin(IN_KERNEL)
    wait_for_the_lock(process)
    process.send_signal(number)
    time.sleep(0.2)
    assert process.poll() is None
    process.send_signal(number)
    try:
        assert process.wait(timeout=20) == -number
    finally:
        process.kill()
        process.communicate()


def watchers_of(number):
    """The processes whose command line names the number of a process that they watch."""
    found = []
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        with contextlib.suppress(OSError):
            found += [path] * (f"\0{number}\0".encode() in path.read_bytes())
    return found


IMPATIENT = "from mpp_taichi.device import unanswered_signal\nunanswered_signal.SECONDS = 0.2" + IN_KERNEL


@pytest.mark.skipif(sys.platform != "linux", reason="the handlers of a process, as /proc of Linux shows them")
@pytest.mark.parametrize(("number", "code"), [(signal.SIGTERM, -signal.SIGTERM), (signal.SIGINT, None)])
@pytest.mark.sampled(3)
def test_one_sigterm_ends_the_process_where_no_thread_of_python_runs(number, code):
    """And an interrupt from the keyboard waits: its second one is at hand."""
    process = begin(IMPATIENT)
    wait_for_the_lock(process)
    process.send_signal(number)
    try:
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(timeout=20 if code else 1.5)
        assert process.poll() == code
    finally:
        process.kill()
        process.communicate()
    until = time.monotonic() + 20.0
    while watchers_of(process.pid):
        assert time.monotonic() < until


AT_ONCE = "_signals.ANSWER_SECONDS = 0.1\nwith Interruption() as interruption, interruption.at_once():"
UNANSWERED = "from mpp_taichi.cli import _signals" + IN_C.replace("with Interruption():", AT_ONCE)


def test_a_signal_that_python_cannot_answer_ends_a_process_with_nothing_to_save():
    process = begin(UNANSWERED)
    wait_for_the_lock(process)
    process.send_signal(signal.SIGTERM)
    _, told = process.communicate(timeout=20)
    assert process.returncode == 143 and told == "interrupted by SIGTERM\n"


def test_an_ignored_hangup_stays_ignored_and_an_ignored_ctrl_c_does_not():
    """The program nohup ignores SIGHUP; a shell ignores SIGINT in a job that a script starts with `&`."""
    before = {number: signal.signal(number, signal.SIG_IGN) for number in (signal.SIGHUP, signal.SIGINT)}
    try:
        with Interruption() as interruption:
            os.kill(os.getpid(), signal.SIGHUP)
            interruption.raise_if_any()
            os.kill(os.getpid(), signal.SIGINT)
            with pytest.raises(Interrupted):
                interruption.raise_if_any()
        assert signal.getsignal(signal.SIGHUP) is signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


IN_VERB = """
import os, signal, sys
from mpp_taichi import atomic_file
from mpp_taichi.cli.main import main
from mpp_taichi.scene import load
def leave(*_, **__):
    os.kill(os.getpid(), signal.SIGTERM)
place, name = {"atomic_file": (atomic_file.os, "replace"), "load": (load, "load_scene")}[sys.argv.pop(1)]
setattr(place, name, leave)
sys.exit(main())
"""


@pytest.mark.parametrize(("place", "words"), [("atomic_file", ["convert", "s.yaml", "s.csv"]), ("load", ["explain", "s.yaml"])])
def test_a_signal_ends_a_verb_with_its_code_and_without_half_a_file(place, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("s.yaml").write_text(yaml.safe_dump({**kepler(dt=0.02), "run": {"duration": 1.0}}), encoding="utf-8")
    process = begin(IN_VERB, place, *words, "--json")
    out, told = process.communicate(timeout=60)
    assert process.returncode == 143 and told == "interrupted by SIGTERM\n"
    assert json.loads(out) == {"status": "interrupted", "exit_code": 143}
    assert not leftovers() and [path.name for path in Path().iterdir()] == ["s.yaml"]
