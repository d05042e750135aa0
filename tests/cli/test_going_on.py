"""A run of the command line that was cut off goes on with the same command, and has the results of a run that was not."""

import os
import signal
import sys

import numpy as np
import pytest
from cut_off import KILL, RECORD, TERM, cut_off, run_whole, with_scene

SCENE = """
title: Kept
particles:
  - body: {name: a, mass: 1, position: [0, 0, 0], free: false}
  - body: {name: b, mass: 1, position: [1, 0, 0.3]}
  - body: {name: c, mass: 0.7, position: [1.7, 0, 0.9]}
springs: [{link: {between: [a, b], stiffness: 200}}, {link: {between: [b, c], stiffness: 80}}]
forces: [{uniform_gravity: {acceleration: [0, 0, -9.81]}}]
integrator: {leapfrog: {dt: 1e-6}}
timeline: [{at: 1.00000012, set: {"springs[0].link.stiffness": 150}}]
run: {duration: 24.00000012}
inspect: [{x: time, y: {kinetic_energy: {}}}]
expect: {oscillation_period: {of: c, axis: z, above: 0}}
"""
OUTPUTS = ("--diagnostics", "table.csv", "--snapshot", "end.npz", "--inspect", "panels.csv")
pytestmark = pytest.mark.skipif(not hasattr(signal, "SIGUSR1"), reason="signals of POSIX are used")


def command(*more):
    return [sys.executable, "-m", "mpp_taichi", "run", "s.yaml", "--headless", *OUTPUTS, *more]


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The results of a run that was not cut off."""
    folder = with_scene(tmp_path_factory.mktemp("whole"), SCENE)
    done = run_whole(command("--no-archive"), folder)
    assert done.returncode == 0, done.stderr
    assert not (folder / "out").exists()
    return folder


def results(folder):
    end = np.load(folder / "end.npz")
    arrays = {key: end[key].tobytes() for key in end}
    return (folder / "table.csv").read_bytes(), (folder / "panels.csv").read_bytes(), arrays


@pytest.mark.parametrize("signals", [(TERM,), (RECORD, KILL)], ids=["TERM", "USR1 and KILL"])
@pytest.mark.sampled(3)
def test_the_same_command_goes_on_to_the_same_results(whole, tmp_path, signals):
    with_scene(tmp_path, SCENE)
    assert cut_off(command(), tmp_path, signals) in (143, -KILL)
    archive = tmp_path / "out" / "s.run"
    assert archive.is_file()
    with open(archive, "ab") as stream:  # as if the machine had stopped while a record was written
        stream.write(b"MREC\x02\x00")
    done = run_whole(command(), tmp_path)
    assert done.returncode == 0, done.stderr
    assert "going on with out/s.run from step" in done.stderr
    assert "6 bytes, is lost" in done.stderr
    assert results(tmp_path) == results(whole)
    done = run_whole(command("--steps", "10"), tmp_path)  # the run has ended: a new command begins anew
    assert done.returncode == 0
    assert "going on" not in done.stderr


@pytest.mark.sampled(3)
def test_another_scene_is_refused_until_it_begins_anew(tmp_path):
    with_scene(tmp_path, SCENE)
    assert cut_off(command(), tmp_path, (TERM,)) == 143
    (tmp_path / "s.yaml").write_text(SCENE.replace("stiffness: 80", "stiffness: 81"))
    done = run_whole(command("--steps", "10"), tmp_path)
    assert done.returncode == 2
    assert "springs[1].link.stiffness: 80 there, 81 here" in done.stderr
    assert "options.steps: nothing there, 10 here" in done.stderr
    assert len(done.stderr.splitlines()) == 1 or "--fresh" in done.stderr.splitlines()[-1]
    done = run_whole(command("--steps", "10", "--fresh"), tmp_path)
    assert done.returncode == 0, done.stderr
    assert not (tmp_path / "out" / "s.run").exists()


def test_a_run_that_ends_before_the_first_record_leaves_nothing(tmp_path):
    with_scene(tmp_path, SCENE)
    before = set(os.listdir(tmp_path))
    assert run_whole(command("--steps", "10"), tmp_path).returncode == 0
    assert set(os.listdir(tmp_path)) - before == {"table.csv", "end.npz", "panels.csv"}
