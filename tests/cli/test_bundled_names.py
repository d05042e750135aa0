"""Scenes of the program by their names: they run, are listed and copied, and a wrong name is answered by the nearest."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

import mpp_taichi as mpp
from mpp_taichi.cli.main import main
from mpp_taichi.scene import bundled
from mpp_taichi.scene.bundled import bundled_scenes
from mpp_taichi.scene.load import load_scene
from mpp_taichi.scene.schema import SCHEMA_FILE

ROOT = Path(__file__).parents[2]
NAMES = sorted(bundled_scenes())


@pytest.fixture(autouse=True)
def empty_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_every_file_of_the_folder_has_a_name_of_its_own():
    assert len(NAMES) == len(list((ROOT / "scenes").rglob("*.yaml"))) >= 45


def test_a_scene_runs_by_its_name_from_any_folder(capsys):
    assert main(["run", "oscillator", "--headless", "--steps", "3", "--backend", "cpu", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["steps"] == 3


def test_a_bare_name_is_run(capsys):
    assert main(["sun_earth", "--dry-run"]) == 0
    assert "Sun and Earth" in capsys.readouterr().out


def test_python_takes_a_name():
    with mpp.Simulation("kepler", backend="cpu") as simulation:
        assert simulation.spec.title == "Kepler's ellipse"


def test_a_file_goes_before_a_scene_of_the_program(empty_folder):
    body = {"mass": 1, "position": [0, 0, 0]}
    mine = {"title": "Mine", "particles": [{"body": body}], "integrator": {"euler": {"dt": 1}}}
    (empty_folder / "kepler").write_text(yaml.safe_dump(mine))
    assert load_scene("kepler").title == "Mine"


def test_another_package_named_scenes_is_not_taken_for_ours(tmp_path, monkeypatch):
    (tmp_path / "scenes").mkdir()
    (tmp_path / "scenes" / "foreign.yaml").touch()
    package = tmp_path / "mpp_taichi"
    monkeypatch.setattr(bundled, "PACKAGE", package)
    monkeypatch.setattr(bundled, "PLACES", (package / "scenes", tmp_path / "scenes"))
    assert bundled_scenes.__wrapped__() == {}
    (package / "scenes").mkdir(parents=True)
    (package / "scenes" / "own.yaml").touch()
    assert list(bundled_scenes.__wrapped__()) == ["own"]


def test_the_list_has_every_scene_under_a_topic_with_title_and_description(capsys):
    assert main(["scenes", "--json"]) == 0
    scenes = json.loads(capsys.readouterr().out)["scenes"]
    assert sorted(each["name"] for each in scenes) == NAMES
    assert all(each["title"] and each["description"] and "fault" not in each for each in scenes)
    topics = {each["name"]: each["topic"] for each in scenes}
    assert topics["ring_heavy"] == "Gravity"  # known from the scene that it extends
    assert (topics["rope"], topics["piston"]) == ("Springs", "Hard spheres")


@pytest.mark.parametrize("force", ["newtonian_gravity", "newtonian_gravity: {strength: 1}"])
def test_gravity_is_a_topic_with_and_without_parameters(force, tmp_path, capsys):
    (tmp_path / "own.yaml").write_text(f"title: Own\nforces:\n  - {force}\n")
    assert main(["scenes", str(tmp_path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["scenes"][0]["topic"] == "Gravity"


def test_the_list_is_not_wider_than_the_terminal(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "72")
    assert main(["scenes"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert max(map(len, lines[:-1])) <= 72
    assert {line for line in lines if line and not line.startswith(" ")} >= {"Gravity", "Springs", "Hard spheres"}


def test_the_list_of_a_folder_names_a_broken_file_and_shows_no_control_characters(empty_folder, capsys):
    (empty_folder / "broken.yaml").write_text("title: [")
    (empty_folder / "loud.yaml").write_text('title: "a\\u001b[2Jb"\ndescription: mine')
    assert main(["scenes", "."]) == 0
    told = capsys.readouterr().out
    assert "broken.yaml:2" in told and "mine" in told and "\x1b" not in told


def test_the_list_can_be_searched(capsys):
    assert main(["scenes", "--about", "PENDULUM"]) == 0
    assert "double_pendulum" in (told := capsys.readouterr().out) and "kepler" not in told
    assert main(["scenes", "--about", "zebra"]) == 2


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.sampled(3)
def test_a_copy_is_the_same_scene_with_its_comments(name, empty_folder, capsys):
    assert main(["new", "deeper/my.yaml", "--like", name]) == 0
    copy = Path("deeper/my.yaml")
    text, original = copy.read_text(encoding="utf-8"), bundled_scenes()[name].read_text(encoding="utf-8")
    assert load_scene(copy).resolved == load_scene(name).resolved
    assert text.splitlines()[0] == f"# yaml-language-server: $schema={SCHEMA_FILE.as_uri()}"
    changed = [pair for pair in zip(text.splitlines(), original.splitlines(), strict=True) if pair[0] != pair[1]]
    assert len(changed) <= 2  # the schema, and the scene that it extends


def test_a_copy_never_replaces_a_file(empty_folder, capsys):
    Path("my.yaml").write_text("mine")
    assert main(["new", "my.yaml"]) == 2
    assert Path("my.yaml").read_text() == "mine" and "exists already" in capsys.readouterr().err


def test_a_bundled_scene_can_be_extended_and_a_file_goes_before_it(empty_folder):
    Path("mine.yaml").write_text("extends: kepler\ntitle: Mine\n")
    assert load_scene("mine.yaml").resolved == {**load_scene("kepler").resolved, "title": "Mine"}
    Path("kepler").write_text("extends: sun_earth\nseed: 7\n")
    assert load_scene("mine.yaml").seed == 7


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["rong"], "'rong' is neither a verb nor a scene, did you mean 'ring'?"),
        (["run", "keppler"], "keppler: no such file and no scene of the program, did you mean kepler?"),
        (["run", "scenes/kepler.yaml"], "the program has a scene of this name: mpp-taichi run kepler"),
        (["run", "mine2.yaml"], "mine2.yaml: no such file, did you mean mine.yaml?"),
        (["run", "zzz.yaml"], "zzz.yaml: no such file\n"),
        (["new", "a.yaml", "--like", "keppler"], "did you mean 'kepler'?"),
        (["new", "a.txt"], "the suffix must be one of .yaml, .yml"),
        (["scenes", "nowhere"], "nowhere is no folder"),
        (["run", "kepler", "--hedless"], "unknown argument --hedless, did you mean '--headless'?"),
        (["accuracy", "kepler", "--buget=3s"], "unknown argument --buget=3s, did you mean '--budget'?"),
    ],
)
def test_a_wrong_word_names_the_nearest(words, said, capsys):
    Path("mine.yaml").write_text("title: Mine")
    assert main(words) == 2
    assert said in capsys.readouterr().err


def test_the_place_of_the_schema_is_printed(capsys):
    assert main(["schema", "--path"]) == 0
    assert json.loads(Path(capsys.readouterr().out.strip()).read_text(encoding="utf-8"))["$schema"]


def test_no_words_at_all_say_how_to_begin():
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    done = subprocess.run([sys.executable, "-m", "mpp_taichi"], capture_output=True, text=True, env=environment, check=True)
    assert "mpp-taichi ring" in done.stdout and "mpp-taichi scenes" in done.stdout
