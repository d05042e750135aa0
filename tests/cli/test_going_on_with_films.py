"""A film that was cut off goes on with the same command to the files of a run that was not, with the same bytes."""

import os
import signal
import subprocess
import sys

import pytest
from cut_off import KILL, RECORD, TERM, cut_off, run_whole, with_scene

from mpp_taichi.simulation.run_archive import FoundRun

SCENE = """
title: Film
particles:
  - body: {name: a, mass: 1, position: [0, 0, 0], free: false}
  - body: {name: b, mass: 1, position: [1, 0, 0.3]}
springs: [{link: {between: [a, b], stiffness: 200}}]
forces: [{uniform_gravity: {acceleration: [0, 0, -9.81]}}]
integrator: {leapfrog: {dt: 1e-6}}
run: {duration: 4}
view: {trails: 40, color_by: {speed: {}}, legend: true, grid: {}, axes: {}, arrows: [{quantity: velocity}]}
inspect: [{x: time, y: {kinetic_energy: {}}}, {histogram: {speed: {}}}]
record: {panels: right, fps: 30, seconds: 4, size: [200, 120]}
"""
FILES = ("--video", "v.mp4", "--frames", "pictures", "--still", "s.png", "--html", "p.html", "--inspect", "i.csv")
pytestmark = pytest.mark.skipif(not hasattr(signal, "SIGUSR1"), reason="signals of POSIX are used")


def command(*more):
    return [sys.executable, "-m", "mpp_taichi", "record", "s.yaml", *more]


def contents(folder):
    """The bytes of all files but the scene and the archive."""
    files = (path for path in folder.rglob("*") if path.is_file() and path.name != "s.yaml" and path.parent.name != "out")
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


@pytest.fixture
def folder(tmp_path):
    return with_scene(tmp_path, SCENE)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    folder = with_scene(tmp_path_factory.mktemp("whole"), SCENE)
    done = run_whole(command(*FILES, "--no-archive"), folder)
    assert done.returncode == 0, done.stderr
    assert not (folder / "out").exists()
    return contents(folder)


@pytest.mark.parametrize("signals", [(TERM,), (RECORD, KILL), (RECORD, RECORD, TERM)], ids=["TERM", "KILL", "two records"])
@pytest.mark.sampled(3)
def test_all_files_of_a_film_go_on_to_the_same_bytes(whole, folder, signals):
    cut_off(command(*FILES), folder, signals)
    if signals[-1] == TERM:
        assert (folder / "v.mp4").is_file()  # the film until the signal can be watched
    done = run_whole(command(*FILES), folder)
    assert done.returncode == 0, done.stderr
    assert "going on with out/s.run from step" in done.stderr
    found = contents(folder)
    assert set(found) == set(whole)
    assert [name for name in whole if found[name] != whole[name]] == []
    ended = FoundRun(folder / "out" / "s.run")
    assert ended.has_ended
    ended.close()


@pytest.mark.sampled(3)
def test_another_film_and_a_missing_picture_are_refused(folder):
    given = ("--frames", "pictures", "--video", "v.mp4")
    cut_off(command(*given), folder, (RECORD, KILL))
    done = run_whole(command(*given, "--fps", "20"), folder)
    assert done.returncode == 2
    assert "options.film.fps: 30.0 there, 20.0 here" in done.stderr
    assert "--fresh begins anew" in done.stderr
    (folder / "pictures" / "frame_000001.png").unlink()
    kept = sorted(os.listdir(folder / "pictures"))
    done = run_whole(command(*given), folder)
    assert done.returncode == 2
    assert "frame_000001.png: the picture is not there, or has changed; --fresh begins anew" in done.stderr
    assert sorted(os.listdir(folder / "pictures")) == kept
    done = run_whole(command(*given, "--fresh", "--steps", "1000", "--duration", "0.2"), folder)
    assert done.returncode == 0, done.stderr
    assert len(os.listdir(folder / "pictures")) == 6


@pytest.mark.sampled(3)
def test_a_full_disk_costs_the_archive_and_not_the_film(whole, folder):
    """The limit on the size of a file stands for the full disk: the picture fits, a record does not."""
    process = subprocess.Popen(
        command("--still", "s.png"), cwd=folder, stderr=subprocess.PIPE, text=True, preexec_fn=lambda: limit_files(30_000)
    )
    said = ""
    for line in process.stderr:
        said += line
        if "steps/s" in line:
            break
    process.send_signal(RECORD)
    said += process.communicate(timeout=100)[1]
    assert process.returncode == 0, said
    assert said.count("the run goes on without an archive") == 1
    assert contents(folder) == {"s.png": whole["s.png"]}
    assert not (folder / "out" / "s.run").exists()


def limit_files(most):
    import resource

    resource.setrlimit(resource.RLIMIT_FSIZE, (most, most))
