"""Films from an archive: with the view of the run they have the bytes of its film, and any other view can be drawn."""

import json
import os
import signal
import sys
from pathlib import Path

import numpy as np
import pytest
from cut_off import KILL, RECORD, cut_off, run_whole, with_scene
from PIL import Image
from remade_archives import remade

from mpp_taichi.archive.record_file import END, STATE
from mpp_taichi.cli.main import main

SCENE = """
title: Film
particles:
  - body: {name: a, mass: 1, position: [0, 0, 0], free: false}
  - body: {name: b, mass: 1, position: [1, 0, 0.3]}
springs: [{link: {between: [a, b], stiffness: 200}}]
forces: [{uniform_gravity: {acceleration: [0, 0, -9.81]}}]
integrator: {leapfrog: {dt: 1e-6}}
timeline: [{at: 1.0000005, set: {"springs[0].link.stiffness": 150}}]
run: {duration: 4}
view: {trails: 40, color_by: {speed: {}}, legend: true, grid: {}, axes: {}}
inspect: [{x: time, y: {kinetic_energy: {}}}]
record: {panels: right, fps: 30, seconds: 2, size: [200, 120]}
"""
OUTPUTS = ("--video", "v.mp4", "--frames", "pictures", "--html", "p.html")
pytestmark = pytest.mark.skipif(not hasattr(signal, "SIGUSR1"), reason="signals of POSIX are used")


def command(*words):
    return [sys.executable, "-m", "mpp_taichi", *words]


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A film with its archive, and the archive as it was before the run had come to its end."""
    folder = with_scene(tmp_path_factory.mktemp("run"), SCENE)
    cut_off(command("record", "s.yaml", *OUTPUTS), folder, (RECORD, KILL))
    (folder / "cut.run").write_bytes((folder / "out" / "s.run").read_bytes())
    done = run_whole(command("record", "s.yaml", *OUTPUTS), folder)
    assert done.returncode == 0, done.stderr
    return folder


def pictures(folder):
    """The pictures of a folder, in their order."""
    return [np.asarray(Image.open(path)) for path in sorted(Path(folder).iterdir())]


@pytest.mark.sampled(3)
def test_the_film_of_the_same_view_has_the_same_bytes(run, tmp_path):
    before = (run / "out" / "s.run").read_bytes()
    done = run_whole(command("replay", str(run / "out" / "s.run"), *OUTPUTS), tmp_path)
    assert done.returncode == 0, done.stderr
    for name in ("v.mp4", "p.html"):
        assert (tmp_path / name).read_bytes() == (run / name).read_bytes()
    names = sorted(os.listdir(run / "pictures"))
    assert sorted(os.listdir(tmp_path / "pictures")) == names
    assert all((tmp_path / "pictures" / name).read_bytes() == (run / "pictures" / name).read_bytes() for name in names)
    assert (run / "out" / "s.run").read_bytes() == before
    assert not (tmp_path / "out").exists()


@pytest.mark.sampled(3)
def test_a_part_shows_the_moments_of_the_whole(run, tmp_path, capsys, monkeypatch):
    """Without trails, panels and colours that remember earlier frames, a frame is that of the whole film at its time."""
    monkeypatch.chdir(tmp_path)
    plain = [
        word
        for change in ("view.trails=0", "view.legend=false", "view.color_by=null", "record.panels=none")
        for word in ("--set", change)
    ]
    plain += ["--set", "view.caption=false"]
    plain += ["--set", "view.camera={position: [0.5, -4, 0], look_at: [0.5, 0, 0], up: [0, 0, 1]}"]  # as for the whole
    archive = str(run / "out" / "s.run")
    assert main(["replay", archive, "--frames", "whole", *plain, "--quiet"]) == 0
    step = 4 / 59
    section = ["--from", repr(30 * step), "--until", repr(40 * step), "--duration", str(11 / 30)]
    assert main(["replay", archive, "--frames", "part", *section, *plain, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert "computed again from t = " in found["rewound"]
    whole, part = pictures("whole"), pictures("part")
    assert (len(whole), len(part)) == (60, 11)
    for k, picture in enumerate(part):
        assert np.abs(picture.astype(int) - whole[30 + k]).max() <= 8, k  # the times differ by rounding, and so edges do


@pytest.mark.sampled(3)
def test_another_camera_and_the_share_of_the_frames(run, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    archive = str(run / "out" / "s.run")
    words = ["replay", archive, "--frames", "a", "--from", "1", "--until", "2", "--size", "80x60", "--quiet"]
    assert main(words) == 0
    found = pictures("a")
    assert len(found) == 15  # a quarter of the run
    assert found[0].shape == (60, 80, 3)
    words[3] = "b"
    assert main([*words, "--set", "view.camera.field_of_view=20"]) == 0
    assert not np.array_equal(pictures("b")[0], found[0])


@pytest.mark.sampled(3)
def test_the_film_of_a_run_that_goes_on_ends_at_its_last_record(run, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["replay", str(run / "cut.run"), "--json"]) == 0
    last = json.loads(capsys.readouterr().out)["time"]
    assert main(["replay", str(run / "cut.run"), "--frames", "a", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["time"] == last
    assert len(os.listdir("a")) == max(2, round(60 * last / 4))
    assert main(["replay", str(run / "cut.run"), "--frames", "b", "--until", "3.9"]) == 2
    assert "is not within the run, 0 to" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--frames", "a", "--set", "integrator.leapfrog.dt=1"], "only view… and record… can be changed"),
        (["--frames", "a", "--set", "viewer.x=1"], "only view… and record… can be changed"),
        (["--frames", "a", "--set", "view.kamera.zoom=2"], "kamera"),
        (["--frames", "a", "--at", "1"], "are of one moment"),
        (["--fps", "10"], "are of a film"),
        (["--renderer", "own"], "are of a film"),
        (["--frames", "a", "--from", "nan"], "--from must be a finite time"),
        (["--frames", "a", "--from", "3", "--until", "2"], "is not within the run"),
        (["--frames", "a", "--from", "-1"], "is not within the run"),
        (["--video", "v.txt"], "--video"),
    ],
)
def test_what_cannot_be_shown_is_refused(run, tmp_path, monkeypatch, capsys, words, said):
    monkeypatch.chdir(tmp_path)
    assert main(["replay", str(run / "out" / "s.run"), *words]) == 2
    told = capsys.readouterr().err
    assert said in told and "Traceback" not in told
    assert not os.listdir(tmp_path)


def test_an_archive_without_a_state_has_no_film(run, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    without = remade(run / "cut.run", tmp_path / "a.run", lambda kind, data: data, leave=(STATE, END))
    assert main(["replay", str(without), "--frames", "a"]) == 2
    assert "it has no state" in capsys.readouterr().err
