"""Films by GGUI without a window: the shapes of other films, going on after a kill, and a line where GGUI does not start."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from cut_off import KILL, RECORD, cut_off, run_whole, with_scene
from PIL import Image

from mpp_taichi.cli.main import main
from mpp_taichi.views.ggui_probe import probe

SCENE = """
title: Film
particles:
  - body: {name: a, mass: 1, position: [0, 0, 0], radius: 0.1, free: false}
  - body: {name: b, mass: 1, position: [1, 0, 0.3], radius: 0.15, color: white}
springs: [{link: {between: [a, b], stiffness: 200}}]
forces: [{uniform_gravity: {acceleration: [0, 0, -9.81]}}]
integrator: {leapfrog: {dt: 5.0e-8}}
run: {duration: 1}
view: {trails: 40, labels: true, color_by: {speed: {}}, spring_width: 6}
inspect: [{x: time, y: {kinetic_energy: {}}}]
record: {panels: right, fps: 20, seconds: 1, size: [200, 120]}
"""
GGUI = ("--renderer", "ggui")
SAME = 8  # of 255: drivers of Vulkan do not promise the same rounding in each run


@pytest.fixture(scope="module")
def ggui_works():
    """Skip where GGUI cannot draw without a window."""
    if problem := probe(shown=False):
        pytest.skip(problem)


def command(*words):
    return [sys.executable, "-m", "mpp_taichi", "record", "s.yaml", *words]


def picture(path):
    return np.asarray(Image.open(path)).astype(int)


@pytest.mark.skipif(not hasattr(signal, "SIGUSR1"), reason="signals of POSIX are used")
@pytest.mark.sampled(3)
def test_a_film_by_ggui_has_the_shapes_of_other_films_and_goes_on_after_a_kill(ggui_works, tmp_path, monkeypatch):
    """Without a display. Trails, the camera and the range of colours go on with the run."""
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    folders = {name: with_scene(tmp_path / name, SCENE) for name in ("own", "whole", "cut") if not (tmp_path / name).mkdir()}
    files = ("--frames", "f", "--still", "s.png")
    for name, words in (("own", ()), ("whole", GGUI)):
        done = run_whole(command(*files, *words, "--no-archive"), folders[name])
        assert done.returncode == 0, done.stderr
    cut_off(command(*files, *GGUI), folders["cut"], (RECORD, KILL))
    other = run_whole(command(*files), folders["cut"])
    assert other.returncode == 2 and "options.film.renderer: 'ggui' there, nothing here" in other.stderr
    done = run_whole(command(*files, *GGUI), folders["cut"])
    assert done.returncode == 0 and "going on with" in done.stderr, done.stderr
    names = sorted(os.listdir(folders["whole"] / "f"))
    assert len(names) == 20 and sorted(os.listdir(folders["cut"] / "f")) == names
    for name in names:
        assert np.abs(picture(folders["whole"] / "f" / name) - picture(folders["cut"] / "f" / name)).max() <= SAME
    ours, theirs = (picture(folders[name] / "s.png") for name in ("own", "whole"))
    assert np.array_equal(theirs, picture(folders["whole"] / "f" / names[-1])) and theirs.shape == (120, 200, 3)
    # Edges differ by a pixel, and GGUI is lit from another side; beside the panel each of the shapes is drawn by both.
    shapes = [(each[:, :100].max(axis=2) > 60) for each in (ours, theirs)]
    for one, another in (shapes, shapes[::-1]):
        wider = np.max([np.roll(another, (down, across), (0, 1)) for down in (-1, 0, 1) for across in (-1, 0, 1)], axis=0)
        assert one.sum() > 100 and (one & wider).sum() / one.sum() > 0.9
    assert not np.array_equal(ours, theirs), "one of the two is drawn by the other renderer"


def test_without_a_driver_one_line_says_so_before_anything_is_written(tmp_path):
    with_scene(tmp_path, SCENE)
    given = command("--still", "s.png", *GGUI)
    environment = os.environ | {"VK_ICD_FILENAMES": "/nonexistent", "VK_DRIVER_FILES": "/nonexistent"}
    done = subprocess.run(given, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=100, check=False)
    assert done.returncode == 3
    assert done.stderr.startswith("cannot draw with GGUI: ") and done.stderr.count("\n") == 1
    assert os.listdir(tmp_path) == ["s.yaml"]


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--still", "s.png", "--renderer", "gui"], "invalid choice: 'gui' (choose from"),
        (["--html", "p.html", *GGUI], "a page is drawn by the browser"),
        (["--still", "s.png", "--beside", "dt=1e-3", *GGUI], "two halves are drawn by --renderer own only"),
    ],
)
def test_pictures_that_ggui_does_not_draw_are_refused(words, said, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(with_scene(tmp_path, SCENE))
    try:
        assert main(["record", "s.yaml", *words]) == 2
    except SystemExit as left:  # of the reader of options
        assert left.code == 2
    assert said in capsys.readouterr().err
    assert os.listdir(Path.cwd()) == ["s.yaml"]
