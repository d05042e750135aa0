"""A machine that is short of memory, processes or files: one line that says what would help, and exit code 6; nothing hangs."""

import _thread
import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest
import yaml

from mpp_taichi.archive.journal import Journal
from mpp_taichi.device.thread_count import NO_MORE_THREADS, OPENBLAS_VARIABLE, bound_threads_of_numpy
from mpp_taichi.device.with_parent import end_with_parent
from mpp_taichi.errors import CapacityError
from scenes import kepler

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="limits of processes as Linux has them")
ROOT = Path(__file__).parents[2]
SCENE = {
    **kepler(dt=0.02),
    "run": {"duration": 0.2},
    "record": {"size": [64, 48], "seconds": 0.2, "fps": 10},
    "expect": {"relative_energy_error_max": {"below": 1}},
}
MIB = 2**20
LIMITED = """
import resource, sys
kind, bound = sys.argv.pop(1), int(sys.argv.pop(1))
resource.setrlimit(getattr(resource, kind), (bound, bound))
from mpp_taichi.cli.entry import main
sys.exit(main())
"""
NO_PROCESS = """
import errno, os, subprocess, sys
left = [int(sys.argv.pop(1))]
start = subprocess.Popen._execute_child
def refuse(self, *words):
    left[0] -= 1
    if left[0] < 0:
        raise BlockingIOError(errno.EAGAIN, os.strerror(errno.EAGAIN))
    start(self, *words)
subprocess.Popen._execute_child = refuse
from mpp_taichi.cli.entry import main
sys.exit(main())
"""


def done(program, *words):
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    environment.pop("DISPLAY", None)
    command = [sys.executable, "-c", program, *map(str, words)]
    return subprocess.run(command, env=environment, capture_output=True, text=True, timeout=120, check=False)


@pytest.fixture(autouse=True)
def scene(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("s.yaml", "t.yaml"):
        Path(name).write_text(yaml.safe_dump(SCENE), encoding="utf-8")


@pytest.mark.parametrize("mib", [100, 300, 600, 1200])
@pytest.mark.sampled(3)
def test_too_little_memory_to_start_is_told_in_one_line(mib):
    ended = done(LIMITED, "RLIMIT_AS", mib * MIB, "run", "s.yaml", "--headless", "--quiet")
    assert ended.returncode == 6 and ended.stdout == ""
    assert len(ended.stderr.splitlines()) == 1 and "ulimit -v" in ended.stderr


def test_a_scene_beyond_the_limit_of_this_process_is_refused_before_it_is_made():
    many = {
        **SCENE,
        "particles": [{"lattice": {"shape": [3000, 3000, 1], "lower": [0, 0, 0], "upper": [1, 1, 0], "mass": 1.0}}],
    }
    Path("s.yaml").write_text(yaml.safe_dump(many), encoding="utf-8")
    ended = done(LIMITED, "RLIMIT_AS", 3000 * MIB, "run", "s.yaml", "--headless", "--quiet")
    assert ended.returncode == 6 and len(ended.stderr.splitlines()) == 1
    assert "the scene needs" in ended.stderr and "are available to this process" in ended.stderr


def test_no_process_for_any_check_is_told_in_one_line():
    ended = done(NO_PROCESS, 0, "check", "s.yaml", "t.yaml", "--jobs", "2")
    assert ended.returncode == 6 and ended.stderr == (
        "error: the system starts no more processes: end other programs, or allow more (ulimit -u)\n"
    )


@pytest.mark.sampled(3)
def test_checks_go_on_with_fewer_processes_where_the_system_starts_no_more():
    Path("u.yaml").write_text(Path("s.yaml").read_text(encoding="utf-8"), encoding="utf-8")
    ended = done(LIMITED, "RLIMIT_NOFILE", 12, "check", "s.yaml", "t.yaml", "u.yaml", "--jobs", "3")
    assert ended.returncode == 0 and "3 of 3 scenes pass" in ended.stdout
    assert "scenes are checked at a time" in ended.stderr and "Traceback" not in ended.stderr


def test_info_names_the_backends_that_could_not_be_tried():
    ended = done(NO_PROCESS, 0, "info")
    assert ended.returncode == 0 and "error" not in ended.stderr and "cpu" in ended.stdout


@pytest.mark.parametrize("words", [("--beside", "dt=0.01", "--frames", "f"), ("--video", "f.mp4")])
@pytest.mark.sampled(3)
def test_a_film_without_a_process_is_told_before_the_run(words):
    ended = done(NO_PROCESS, 0, "record", "s.yaml", "--quiet", *words)
    assert ended.returncode == (5 if "--video" in words else 6)
    assert len(ended.stderr.splitlines()) == 1 and "Trace" not in ended.stderr
    assert not list(Path().glob("**/*.lock")) and not list(Path().glob("**/*.part*"))


NO_THREAD = """
import sys, threading
refused, start = sys.argv.pop(1), threading.Thread.start
def limited(self):
    if self.name == refused:
        raise RuntimeError("can't start new thread")
    start(self)
threading.Thread.start = limited
from mpp_taichi.cli.entry import main
sys.exit(main())
"""
FILM = ("--video", "f.mp4")


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("thread", "words"),
    [
        ("ffmpeg messages", FILM),
        ("ffmpeg frames", FILM),
        ("pictures for the archive", FILM),
        ("right half", ("--beside", "dt=0.01", "--frames", "f")),
    ],
)
def test_a_film_without_a_thread_is_told_in_one_line_and_leaves_nothing(thread, words):
    ended = done(NO_THREAD, thread, "record", "s.yaml", "--quiet", *words)
    assert ended.returncode == 6 and ended.stderr.removeprefix("error: ") == f"{NO_MORE_THREADS}\n"
    assert not [path for path in Path().glob("**/*") if path.is_file() and path.suffix != ".yaml"]


def test_a_process_that_cannot_watch_its_parent_is_refused(monkeypatch):
    monkeypatch.setattr(threading.Thread, "start", refuse_thread)
    with pytest.raises(CapacityError, match="starts no more threads"):
        end_with_parent(1)


def test_a_study_goes_on_without_a_journal_where_no_thread_writes_it(monkeypatch, caplog):
    monkeypatch.setattr(threading.Thread, "start", refuse_thread)
    with Journal(Path("a.journal"), {}) as journal:
        journal.put("a", 1)
        journal.put("b", 2)
    assert len(caplog.records) == 1 and not Path("a.journal").exists()


@pytest.mark.parametrize("free", [True, False])
def test_numpy_starts_no_threads_where_the_system_has_no_room_for_them(free, monkeypatch):
    monkeypatch.setenv(OPENBLAS_VARIABLE, "")
    monkeypatch.delenv(OPENBLAS_VARIABLE)
    if not free:
        monkeypatch.setattr(_thread, "start_new_thread", refuse_thread)
    bound_threads_of_numpy()
    assert os.environ.get(OPENBLAS_VARIABLE) == (None if free else "1")


def refuse_thread(*_):
    raise RuntimeError("can't start new thread")
