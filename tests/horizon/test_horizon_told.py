"""The horizon in the summary, in tables, films and pages; and nothing of it where a scene does not ask for it."""

import json
import re
import subprocess
import sys

import numpy as np
import pytest
import yaml
from PIL import Image

from mpp_taichi import SceneError
from mpp_taichi.cli.main import main
from mpp_taichi.scene.load import load_scene
from mpp_taichi.views.dimming import CONTRAST, dim
from scenes import kepler

COARSE = {"integrator": {"leapfrog": {"dt": 0.02}}, "run": {"duration": 40.0}, "horizon": True}


@pytest.fixture(scope="module")
def outputs(tmp_path_factory):
    """A film of 9 frames, a page and a table of a run that has a horizon before its end, and its JSON object."""
    folder = tmp_path_factory.mktemp("told")
    scene = folder / "coarse.yaml"
    scene.write_text(yaml.safe_dump(kepler() | COARSE))
    command = [
        "record",
        scene,
        "--frames",
        folder / "frames",
        "--html",
        folder / "page.html",
        "--diagnostics",
        folder / "t.csv",
    ]
    size = ["--size", "160x120", "--fps", "3", "--duration", "3", "--json", "-q"]
    done = subprocess.run(
        [sys.executable, "-m", "mpp_taichi", *map(str, command), *size], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return folder, json.loads(done.stdout)


@pytest.mark.sampled(3)
def test_the_summary_tells_the_time_and_the_cause(outputs):
    found = outputs[1]["horizon"]
    assert found["found"] == "before_end" and found["by"] == "step" and 0.0 < found["time"] < 40.0
    assert found["sentence"].startswith(
        f"positions are valid until t ≈ {found['time']:.3g}; then the error by the step exceeds"
    )


def test_a_table_has_a_column_of_valid_rows(outputs):
    folder, told = outputs
    table = np.genfromtxt(folder / "t.csv", delimiter=",", names=True)
    assert ((table["time"] <= told["horizon"]["time"]) == (table["valid"] == 1.0)).all()
    assert set(table["valid"]) == {0.0, 1.0}


def test_frames_beyond_the_horizon_are_dimmed_and_every_frame_says_until_when_it_is_valid(outputs):
    folder, told = outputs
    page = (folder / "page.html").read_text()
    header = json.loads(re.search(r'<script[^>]*type="application/json"[^>]*>(.*?)</script>', page, re.DOTALL)[1])
    beyond = [time > told["horizon"]["time"] for time in header["times"]]
    assert header["dimmed"] == beyond and len(set(beyond)) == 2
    assert all(f"valid until t ≈ {told['horizon']['time']:.3g}" in text for text in header["captions"])
    pictures = np.stack([np.asarray(Image.open(file)) for file in sorted((folder / "frames").glob("*.png"))])
    text, bodies = pictures[:, :45, :70].max(axis=(1, 2, 3)), pictures[:, 60:].max(axis=(1, 2, 3))
    assert text.min() > 0.85 * 240  # of the blue of the caption's ink, whose thin strokes cover no pixel as a whole
    assert bodies[beyond].max() < 0.6 * bodies[~np.array(beyond)].min()


def test_dimming_keeps_the_background_and_takes_contrast():
    background = (0.2, 0.4, 0.9)
    ground = np.rint(255.0 * np.array(background)).astype(np.uint8)
    picture = np.stack([ground, np.array([255, 255, 255], np.uint8)])[None]
    dim(picture, background)
    assert (picture[0, 0] == ground).all()
    # One rounding of the level, and one of the background that the table has unrounded.
    assert np.abs(picture[0, 1] - (ground + CONTRAST * (255.0 - ground))).max() <= 1.0


@pytest.mark.sampled(3)
def test_without_the_key_nothing_is_searched_imported_or_said(tmp_path):
    scene = tmp_path / "plain.yaml"
    scene.write_text(yaml.safe_dump(kepler() | {"run": {"duration": 0.1}}))
    code = (
        "import sys; from mpp_taichi.cli.main import main\n"
        f"main(['run', {str(scene)!r}, '--headless', '--json', '--diagnostics', {str(tmp_path / 't.csv')!r}])\n"
        "print([name for name in sys.modules if 'mpp_taichi.horizon' in name], file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert "horizon" not in json.loads(done.stdout) and done.stderr.strip().endswith("[]")
    assert "valid" not in (tmp_path / "t.csv").read_text()


def test_a_run_without_an_end_known_to_the_scene_is_searched_up_to_the_end_asked_for(capsys, tmp_path):
    scene = tmp_path / "endless.yaml"
    given = kepler() | COARSE
    del given["run"]
    scene.write_text(yaml.safe_dump(given))
    assert main(["run", str(scene), "--headless", "--json", "-q", "--steps", "50", "--snapshot", str(tmp_path / "s.npz")]) == 0
    assert json.loads(capsys.readouterr().out)["horizon"]["end"] == pytest.approx(1.0)


def test_the_key_is_true_or_false():
    with pytest.raises(SceneError, match="horizon: must be true or false"):
        load_scene(kepler() | {"horizon": "often"})
    assert load_scene(kepler()).horizon is None
