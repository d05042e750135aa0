"""Archives that earlier versions have written are read: a run goes on from each of them to the end that its version gave."""

import json
import shutil
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from mpp_taichi.cli.main import main
from mpp_taichi.recorders.kept_pictures import KeptPictures
from mpp_taichi.simulation.run_archive import FoundRun
from mpp_taichi.snapshot import Snapshot

RELEASES = sorted(path for path in (Path(__file__).parent / "releases").iterdir() if path.is_dir())
RUNS = [(release, kind) for release in RELEASES for kind in json.loads((release / "expected.json").read_text())["runs"]]
ROUNDING = 1e-9  # another processor may round sines, roots and products in other ways; 10⁶ steps add that up


class Pictures(list):
    """A film that keeps its pictures."""

    def __init__(self, size):
        super().__init__()
        self.size, self.path = size, "film"

    def write(self, picture):
        self.append(picture.copy())


@pytest.fixture
def placed(tmp_path, monkeypatch):
    """A function that puts the files of a release where its run has left them."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "out").mkdir()

    def place(release, kind):
        for path in release.iterdir():
            into = tmp_path / "out" if path.suffix == ".run" else tmp_path
            shutil.copytree(path, into / path.name) if path.is_dir() else shutil.copy(path, into)
        return json.loads((release / "expected.json").read_text())["runs"][kind]

    return place


@pytest.mark.sampled(2)
@pytest.mark.parametrize(("release", "kind"), RUNS, ids=[f"{release.name} {kind}" for release, kind in RUNS])
def test_a_run_of_an_earlier_release_goes_on(release, kind, placed, capsys):
    wanted = placed(release, kind)
    assert main(wanted["command"]) == 0
    told = capsys.readouterr().err
    assert f"going on with out/{kind}.run from step" in told, told
    end = Snapshot.load(Path("end.npz"))
    assert (end.time, end.step) == (pytest.approx(wanted["time"], abs=0.0, rel=1e-15), wanted["step"])
    for name in ("position", "velocity"):
        np.testing.assert_allclose(getattr(end, name), wanted[name], rtol=ROUNDING, atol=ROUNDING)
    if kind == "film":
        assert len(list(Path("pictures").iterdir())) == wanted["frames"]
        assert Path("film.mp4").stat().st_size > 1000


@pytest.mark.sampled(2)
@pytest.mark.parametrize(("release", "kind"), RUNS, ids=[f"{release.name} {kind}" for release, kind in RUNS])
def test_an_archive_of_an_earlier_release_is_replayed(release, kind, capsys):
    assert main(["replay", str(release / f"{kind}.run"), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert 0.0 < found["time"] < 12.0
    assert found["record_step"] == found["step"]
    assert np.isfinite(found["total_energy"])


@pytest.mark.parametrize("release", RELEASES, ids=[release.name for release in RELEASES])
def test_the_pictures_of_an_earlier_release_are_those_of_its_frames(release):
    found = FoundRun(release / "film.run", to_append=False)
    try:
        film = Pictures((96, 64))
        kept = KeptPictures(film)
        kept.go_on(None, found.state()["outputs"]["VideoRecorder"], found.news("VideoRecorder"))
        kept.stop()
    finally:
        found.close()
    assert len(film) > 3
    for picture, path in zip(film, sorted((release / "pictures").iterdir())):
        with Image.open(path) as frame:
            assert np.array_equal(picture, np.asarray(frame))


@pytest.mark.parametrize("release", RELEASES, ids=[release.name for release in RELEASES])
@pytest.mark.sampled(3)
def test_states_and_trajectories_of_an_earlier_release_are_read(release, placed, capsys):
    wanted = placed(release, "plain")
    words = [each for each in wanted["command"] if not each.startswith(("--inspect", "panels"))]
    assert main([*words, "--rewind", "plain.interrupted.npz"]) == 0
    assert "plain.interrupted.npz, t = " in capsys.readouterr().out
    end = Snapshot.load(Path("end.npz"))
    assert end.time == pytest.approx(12.0)
    np.testing.assert_allclose(end.position, wanted["position"], atol=1e-6)
    with np.load("trajectory.npz") as trajectory:
        assert trajectory["position"].shape == (len(trajectory["time"]), 3, 3)
    assert main(["convert", "trajectory.npz", "trajectory.xyz"]) == 0
