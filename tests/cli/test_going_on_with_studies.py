"""A study that was cut off goes on with the same command: what it has finished is not done again."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from mpp_taichi.archive.record_file import STATE, RecordFile
from mpp_taichi.errors import MppError

ROOT = Path(__file__).parents[2]
KILL, TERM = getattr(signal, "SIGKILL", 9), signal.SIGTERM
SCENE = """
title: Studied
particles:
  - body: {{name: sun, mass: 1, position: [0, 0, 0]}}
  - body: {{name: planet, mass: 1e-3, position: [1, 0, 0], velocity: [0, 1, 0]}}
forces: [{{newtonian_gravity: {{strength: 1}}}}]
integrator: {{leapfrog: {{dt: {dt}}}}}
run: {{duration: {duration}}}
expect: {{relative_energy_error_max: {{below: 1}}}}
"""
QUICK, SLOW = SCENE.format(dt="1e-2", duration=1), SCENE.format(dt="1e-6", duration=1000)
pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals of POSIX are used")


QUICKLY = """
import sys
from mpp_taichi.archive import journal
from mpp_taichi.cli import _check_in_parallel
from mpp_taichi.cli.main import main
from mpp_taichi.simulation import run_archive
journal.AFTER, run_archive.EVERY, run_archive.SHARE = 0.0, 0.05, 0.2
_check_in_parallel.PROGRAM = (sys.executable, *sys.orig_argv[1:3], "check")
sys.exit(main())
"""


def started(folder, *words):
    """A process of the program, whose journal is written from the first result on, and archives of runs very often."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    streams = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE, "text": True}
    return subprocess.Popen([sys.executable, "-c", QUICKLY, *words], cwd=folder, env=environment, **streams)


def finished(folder, *words, code=0):
    """The JSON object, and the words on standard error, of a command that runs to its end."""
    process = started(folder, *words, "--json")
    out, told = process.communicate(timeout=600)
    assert process.returncode == code, told
    return json.loads(out), told


def records(folder, pattern):
    """Number of records in the journal."""
    for path in folder.glob(pattern):
        try:
            file = RecordFile.open(path, to_append=False)
        except MppError:  # it is being made
            return 0
        file.close()
        return sum(record.kind == STATE for record in file.records)
    return 0


def cut_off(folder, pattern, count, number, *words):
    """Start a command, and end it by a signal when its journal has so many records."""
    process = started(folder, *words)
    deadline = time.monotonic() + 300
    while records(folder, pattern) < count and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.02)
    assert process.poll() is None, process.communicate()[1]
    process.send_signal(number)
    told = process.communicate(timeout=60)[1]
    assert process.returncode in (-KILL, 128 + TERM), told
    assert "Traceback" not in told


@pytest.mark.parametrize("number", [KILL, TERM], ids=["KILL", "TERM"])
@pytest.mark.sampled(3)
def test_check_takes_the_verdicts_that_were_finished(tmp_path, number):
    for name, text in {"a": QUICK, "b": SLOW}.items():
        (tmp_path / f"{name}.yaml").write_text(text)
    command = ["check", "a.yaml", "b.yaml", "--jobs", "1"]
    cut_off(tmp_path, "out/check-*.journal", 1, number, *command)
    (tmp_path / "b.yaml").write_text(QUICK)  # so that the test ends; a changed scene is checked anew
    found, told = finished(tmp_path, *command)
    assert "going on with out/check-" in told and "1 of 2 scenes are taken from it" in told
    assert "checking b.yaml" in told and "checking a.yaml" not in told
    assert found["went_on"]["results"] == 1
    assert [scene["status"] for scene in found["scenes"]] == ["ok", "ok"]
    assert list((tmp_path / "out").iterdir()) == []


@pytest.mark.parametrize("jobs", ["1", "2"])
@pytest.mark.sampled(3)
def test_check_goes_on_within_a_scene(tmp_path, jobs):
    """Two scenes, so that each is checked by a process of its own where there are two jobs."""
    for name in "ab":
        (tmp_path / f"{name}.yaml").write_text(SCENE.format(dt="1e-6", duration=20))
    command = ["check", "a.yaml", "b.yaml", "--jobs", jobs]
    cut_off(tmp_path, "out/check-*.runs/*.run", 2, KILL, *command)  # the first may be that of the start
    found, _ = finished(tmp_path, *command)
    assert any("went_on" in scene and scene["went_on"]["step"] > 0 for scene in found["scenes"])
    assert list((tmp_path / "out").iterdir()) == []
    whole = json.loads(started(tmp_path, *command, "--no-archive", "--json").communicate(timeout=600)[0])
    for name in ("status", "steps", "relative_energy_error_max", "expect"):
        assert [scene[name] for scene in found["scenes"]] == [scene[name] for scene in whole["scenes"]]


@pytest.mark.sampled(3)
def test_check_does_a_changed_scene_again(tmp_path):
    for name, text in {"a": QUICK, "b": SLOW}.items():
        (tmp_path / f"{name}.yaml").write_text(text)
    command = ["check", "a.yaml", "b.yaml", "--jobs", "2"]
    cut_off(tmp_path, "out/check-*.journal", 1, KILL, *command)
    (tmp_path / "a.yaml").write_text(SCENE.format(dt="2e-2", duration=1))
    (tmp_path / "b.yaml").write_text(QUICK)
    found, told = finished(tmp_path, *command)
    assert found["went_on"] is None and "0 of 2 scenes are taken from it" in told
    assert [scene["steps"] for scene in found["scenes"]] == [50, 100]
