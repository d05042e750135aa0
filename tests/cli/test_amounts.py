"""The size of a run is checked before the computation begins, and a signal ends a film between any two frames."""

import os
import shutil
import signal
import subprocess
import sys
import time
from collections import namedtuple
from pathlib import Path

import pytest
import yaml

from mpp_taichi.cli import _amounts
from mpp_taichi.cli.main import main
from mpp_taichi.device import backends
from scenes import kepler

ROOT = Path(__file__).parents[2]
FILMS = (["--video", "f.mp4"], ["--frames", "f"], ["--still", "f.png"], ["--html", "f.html"])
Usage = namedtuple("Usage", "total used free")


@pytest.fixture
def scene(tmp_path, monkeypatch):
    """Write a scene into an empty working directory, and run there."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)

    def write(**changes):
        content = {**kepler(dt=0.02), "run": {"duration": 2.0}, **changes}
        Path("kepler.yaml").write_text(yaml.safe_dump(content, sort_keys=False), encoding="utf-8")
        return "kepler.yaml"

    return write


@pytest.fixture
def no_start(monkeypatch):
    """Fail where a backend is started."""

    def start(*_, **__):
        raise AssertionError("a backend was started")

    monkeypatch.setattr(backends, "initialise", start)
    backends.stop()


def refusal(capsys, *words):
    """The one line with which words are refused for want of capacity; no file is begun."""
    assert main([*words, "-q"]) == 6
    said = capsys.readouterr().err
    assert said.count("\n") == 1 and "allowed: " in said and os.listdir() == ["kepler.yaml"]
    return said


@pytest.mark.parametrize("film", FILMS, ids=lambda film: film[0])
@pytest.mark.parametrize(
    ("options", "frames"),
    [
        (["--fps", "1e9", "--duration", "10"], "10,000,000,000"),
        (["--fps", "30", "--duration", "1e9"], "30,000,000,000"),
        (["--fps", "1000001", "--duration", "1"], "1,000,001"),
        (["--fps", "1e300", "--duration", "1e300"], "inf"),
    ],
)
def test_a_film_of_too_many_frames_is_refused(scene, no_start, capsys, film, options, frames):
    assert f"has {frames} frames, allowed: 1,000,000;" in refusal(capsys, "record", scene(), *film, *options)


@pytest.mark.parametrize("words", [["record", "--still", "a.png"], ["run"], ["run", "--dry-run", "--video", "a.mp4"]])
def test_a_scene_whose_film_has_too_many_frames_is_refused(scene, no_start, capsys, words):
    name = scene(record={"fps": 1000, "seconds": 86400})
    assert main([words[0], name, *words[1:], "-q"]) == 6
    assert "has 86,400,000 frames, allowed: 1,000,000;" in capsys.readouterr().err


@pytest.mark.parametrize("film", [*FILMS[:3]], ids=lambda film: film[0])
def test_a_picture_that_memory_cannot_hold_is_refused(scene, no_start, capsys, monkeypatch, film):
    monkeypatch.setattr(_amounts, "available_bytes", lambda: 2**30)
    said = refusal(capsys, "record", scene(), *film, "--size", "16384x16384")
    assert "300 frames of 16384x16384 pixels take about 30 GiB of memory, allowed: the 1 GiB" in said


@pytest.mark.parametrize("film", FILMS[:2], ids=lambda film: film[0])
def test_a_film_that_the_disk_cannot_hold_is_refused(scene, no_start, capsys, monkeypatch, film):
    monkeypatch.setattr(shutil, "disk_usage", lambda _: Usage(2**30, 2**29, 2**29))
    said = refusal(capsys, "record", scene(record={"fps": 1000, "seconds": 1000}), *film, "--size", "1920x1080")
    assert "on disk, allowed: the 0.5 GiB" in said


def test_samples_that_memory_cannot_hold_are_refused(scene, no_start, capsys, monkeypatch):
    monkeypatch.setattr(_amounts, "available_bytes", lambda: 2**30)
    name = scene()
    said = refusal(capsys, "run", name, "--headless", "--steps", "1e8", "--every", "1")
    assert "100,000,001 samples take at least 93.1 GiB of memory, allowed: the 1 GiB" in said
    assert said == refusal(capsys, "run", scene(run={"steps": 10**8, "every": 1}), "--headless")


def test_a_trajectory_that_the_disk_cannot_hold_is_refused(scene, no_start, capsys, monkeypatch):
    monkeypatch.setattr(shutil, "disk_usage", lambda _: Usage(2**30, 2**30, 2**10))
    said = refusal(capsys, "run", scene(), "--headless", "--every", "1", "--trajectory", "t.npz")
    assert "101 samples take at least" in said and "that are free for t.npz" in said


@pytest.mark.skipif(os.name == "nt", reason="POSIX signals")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("beside", [[], ["--beside", "integrator=rk4"]], ids=["one picture", "two halves"])
@pytest.mark.sampled(3)
def test_a_signal_ends_a_film_that_has_many_frames_between_two_steps(scene, number, beside):
    words = ["record", scene(run={"steps": 1}), "--frames", "f", "--size", "320x180", "--fps", "1000", "--duration", "900"]
    command = [sys.executable, "-m", "mpp_taichi", *words, *beside, "-q"]
    program = subprocess.Popen(command, stderr=subprocess.PIPE, env={**os.environ, "PYTHONPATH": str(ROOT)})
    try:
        until = time.monotonic() + 60
        while not Path("f/frame_000003.png").exists():
            assert program.poll() is None and time.monotonic() < until
            time.sleep(0.05)
        program.send_signal(number)
        _, said = program.communicate(timeout=5)
    finally:
        program.kill()
        program.communicate()
    assert program.returncode == 128 + number and b"Traceback" not in said
    assert Path("out/kepler.interrupted.npz").exists() and not list(Path("f").glob(".*"))
