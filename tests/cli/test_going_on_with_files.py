"""A run that writes a trajectory is cut off and goes on with the same command; its file is that of a run that was not."""

import os
import signal
import sys

import pytest
from cut_off import KILL, RECORD, TERM, cut_off, run_whole, with_scene

SCENE = """
title: Kept
particles:
  - body: {name: a, mass: 1, position: [0, 0, 0], free: false}
  - body: {name: b, mass: 1, position: [1, 0, 0.3]}
springs: [{link: {between: [a, b], stiffness: 200}}]
forces: [{uniform_gravity: {acceleration: [0, 0, -9.81]}}]
integrator: {leapfrog: {dt: 1e-6}}
run: {duration: 60}
"""
pytestmark = pytest.mark.skipif(not hasattr(signal, "SIGUSR1"), reason="signals of POSIX are used")


def command(*more):
    return [sys.executable, "-m", "mpp_taichi", "run", "s.yaml", "--headless", "--every", "119993", *more]


@pytest.fixture
def folder(tmp_path):
    return with_scene(tmp_path, SCENE)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The bytes of the files of a run that was not cut off."""
    folder = with_scene(tmp_path_factory.mktemp("whole"), SCENE)
    found = {}
    for name in ("t.npz", "t.xyz"):
        done = run_whole(command("--no-archive", "--trajectory", name), folder)
        assert done.returncode == 0, done.stderr
        found[name] = (folder / name).read_bytes()
    assert sorted(os.listdir(folder)) == ["s.yaml", "t.npz", "t.xyz"]
    return found


@pytest.mark.sampled(3)
@pytest.mark.parametrize("signals", [(TERM,), (RECORD, KILL)], ids=["TERM", "USR1 and KILL"])
@pytest.mark.parametrize("name", ["t.npz", "t.xyz"])
def test_a_trajectory_goes_on_to_the_same_bytes(whole, folder, name, signals):
    cut_off(command("--trajectory", name), folder, signals)
    done = run_whole(command("--trajectory", name), folder)
    assert done.returncode == 0, done.stderr
    assert "going on with out/s.run from step" in done.stderr
    assert (folder / name).read_bytes() == whole[name]
    assert sorted(os.listdir(folder)) == ["out", "s.yaml", name] or signals == (TERM,)
    assert not [each for each in os.listdir(folder) if "part" in each or "lock" in each]


@pytest.mark.sampled(2)
@pytest.mark.parametrize("name", ["t.npz", "t.xyz"])
def test_frames_that_are_missing_or_changed_are_refused(whole, folder, name):
    cut_off(command("--trajectory", name), folder, (RECORD, KILL))
    parts = sorted(each for each in os.listdir(folder) if each.endswith(".part"))
    assert parts
    with open(folder / parts[0], "r+b") as stream:
        stream.seek(100)
        stream.write(b"\x07")
    done = run_whole(command("--trajectory", name), folder)
    assert done.returncode == 2
    (line,) = [each for each in done.stderr.splitlines() if "error" in each or "--fresh" in each]
    assert "its frames are not there; --fresh begins anew" in line
    assert sorted(each for each in os.listdir(folder) if each.endswith(".part")) == parts
    os.truncate(folder / parts[0], 90)
    assert run_whole(command("--trajectory", name), folder).returncode == 2
    (folder / name).write_bytes(whole[name][:-7000] if name == "t.xyz" else b"PK")
    done = run_whole(command("--trajectory", name), folder)
    assert (done.returncode == 2) == (name == "t.npz"), done.stderr
    done = run_whole(command("--trajectory", name, "--fresh", "--steps", "10"), folder)
    assert done.returncode == 0, done.stderr
    assert not [each for each in os.listdir(folder) if "part" in each or "lock" in each]


@pytest.mark.sampled(3)
def test_a_run_killed_twice_takes_the_frames_of_the_interrupted_file(whole, folder):
    cut_off(command("--trajectory", "t.npz"), folder, (TERM,))
    cut_off(command("--trajectory", "t.npz"), folder, (KILL,))
    for part in folder.glob("*.part"):
        part.unlink()
    done = run_whole(command("--trajectory", "t.npz"), folder)
    assert done.returncode == 0, done.stderr
    assert (folder / "t.npz").read_bytes() == whole["t.npz"]
