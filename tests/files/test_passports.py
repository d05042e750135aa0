"""Passports: every format gives back what was put in, and other programs read the file as before."""

import json
import subprocess
from xml.etree import ElementTree

import imageio_ffmpeg
import numpy as np
import pytest
from PIL import Image

from mpp_taichi.cli import _passport
from mpp_taichi.cli._passport import keep_verdict, scene_digest, verified
from mpp_taichi.cli.main import main
from mpp_taichi.passport.carried import carrying, stamp
from mpp_taichi.passport.formats import FORMATS, passport_of
from mpp_taichi.recorders.video import VideoRecorder
from mpp_taichi.scene.load import load_scene
from scenes import kepler

FACTS = {"title": "a --> </script> & ]]> Šimó \x00 '\"", "steps": 3, "verified": {"solved": 2}}
PICTURE = np.arange(64 * 48 * 3, dtype=np.uint32).reshape(48, 64, 3).astype(np.uint8)


def write(path):
    """A small file of the format, by the way that the program writes it."""
    if path.suffix in (".mp4", ".webp", ".gif"):
        with VideoRecorder(path, (64, 48), 10.0) as film:
            for _ in range(3):
                film.write(PICTURE)
        return
    if path.suffix == ".png":
        Image.fromarray(PICTURE).save(path)
    elif path.suffix == ".npz":
        np.savez(path, x=np.arange(5.0))
    elif path.suffix == ".svg":
        path.write_text('<svg xmlns="http://www.w3.org/2000/svg"><text>π</text></svg>\n', encoding="utf-8")
    else:
        path.write_text("<!DOCTYPE html>\n<html><body><p>π</p></body></html>\n", encoding="utf-8")
    stamp(path)


def frames(path):
    done = subprocess.run(
        [imageio_ffmpeg.get_ffmpeg_exe(), "-v", "error", "-i", path, "-f", "rawvideo", "-"], capture_output=True
    )
    assert done.returncode == 0 and not done.stderr
    return done.stdout


@pytest.mark.parametrize("suffix", FORMATS)
def test_a_passport_is_given_back_and_the_rest_of_the_file_is_as_without(suffix, tmp_path):
    plain, stamped = tmp_path / f"plain{suffix}", tmp_path / f"stamped{suffix}"
    write(plain)
    with carrying(FACTS):
        write(stamped)
    assert passport_of(plain) is None and passport_of(stamped) == FACTS
    if suffix in (".mp4", ".webp", ".gif"):
        assert frames(stamped) == frames(plain) != b""
    if suffix in (".png", ".webp", ".gif"):
        with Image.open(stamped) as one, Image.open(plain) as other:
            one.load()
            assert getattr(one, "n_frames", 1) == getattr(other, "n_frames", 1)
            assert one.convert("RGB").tobytes() == other.convert("RGB").tobytes()
    if suffix == ".npz":
        with np.load(stamped) as found:
            assert found.files == ["x"] and np.array_equal(found["x"], np.arange(5.0))
    if suffix in (".svg", ".html"):
        text = stamped.read_text(encoding="utf-8")
        assert "π" in "".join(ElementTree.fromstring(text.removeprefix("<!DOCTYPE html>\n")).itertext())


def test_the_files_of_a_run_say_what_they_came_from(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    scene = kepler() | {"title": "Secret", "run": {"steps": 20}}
    (tmp_path / "kepler.yaml").write_text(json.dumps(scene), encoding="utf-8")
    files = ["--diagnostics", "t.npz", "--snapshot", "s.npz", "--trajectory", "r.npz"]
    assert main(["run", "kepler.yaml", "--headless", "--quiet", "--backend", "cpu", *files]) == 0
    found = []
    for name in files[1::2]:
        capsys.readouterr()
        assert main(["passport", name, "--json"]) == 0
        found.append(json.loads(capsys.readouterr().out))
    assert found[0] == found[1] == found[2]
    told = found[0]
    assert (told["title"], told["precision"], told["backend"], told["scene_file"]) == ("Secret", "f64", "cpu", "kepler.yaml")
    assert told["scene_sha256"] == scene_digest(load_scene("kepler.yaml"))
    assert told["scene_sha256"] != scene_digest(load_scene("kepler.yaml", overrides=["integrator.leapfrog.dt=0.02"]))
    assert str(tmp_path) not in json.dumps(told)


def test_a_title_of_any_length_leaves_room_in_a_passport(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    body = {"body": {"mass": 1, "position": [0, 0, 0]}}
    scene = {"title": "é" * 20_000, "particles": [body], "integrator": {"leapfrog": {"dt": 0.1}}, "run": {"steps": 1}}
    (tmp_path / "long.yaml").write_text(json.dumps(scene), encoding="utf-8")
    assert main(["run", "long.yaml", "--headless", "--quiet", "--backend", "cpu", "--snapshot", "s.npz"]) == 0
    assert set(passport_of(tmp_path / "s.npz")["title"]) == {"é"}


def test_a_verdict_counts_for_the_versions_and_the_device_that_it_was_made_with(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert verified("cpu", "f64", "this") == "not verified"
    rows = [{"backend": "cpu", "precision": "f64", "status": status} for status in ("solved", "solved", "refused")]
    keep_verdict({"places": ["cpu f64"], "rows": rows, "known": {"devices": {"cpu": "this"}}}, length="quick")
    kept = verified("cpu", "f64", "this")
    assert (kept["solved"], kept["refused"], kept["failed"], kept["length"]) == (2, 1, 0, "quick")
    assert verified("cpu", "f32", "this") == verified("cpu", "f64", "other") == "not verified"
    monkeypatch.setattr(_passport, "VERSIONS", {**_passport.VERSIONS, "taichi": "1.8"})
    assert verified("cpu", "f64", "this") == "not verified"


@pytest.mark.parametrize(
    ("name", "content", "code", "said"),
    [
        ("a.txt", b"", 2, "files of this kind have none"),
        ("a.npz", b"no archive", 5, "is damaged"),
        ("a.mp4", b"\x00\x00\x00\x08free", 5, "has no passport"),
        ("missing.png", None, 5, "cannot be read"),
    ],
)
def test_a_file_without_a_passport_is_told_in_a_line(name, content, code, said, tmp_path, capsys):
    if content is not None:
        (tmp_path / name).write_bytes(content)
    assert main(["passport", str(tmp_path / name)]) == code
    told = capsys.readouterr().err.strip()
    assert said in told and len(told.splitlines()) == 1
