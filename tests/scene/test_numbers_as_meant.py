"""A number of a scene is the number that a person means, or it is refused at its place: the whole class of YAML 1.1's traps."""

import datetime

import pytest

from mpp_taichi.errors import SceneError
from mpp_taichi.scene.load import load_scene

TEXT = """\
particles:
  - body:
      position: [0, 0, 0]
      mass: {mass}
integrator: {{leapfrog: {{dt: 0.1}}}}
"""
MEANT = {
    "1e5": 1e5,
    "1E+5": 1e5,
    "1_000": 1000.0,
    "0x10": 16.0,
    "0o10": 8.0,
    "0b11": 3.0,
    "1.": 1.0,
    ".5": 0.5,
    "+3": 3.0,
    "2026 - 11 - 20": 1995.0,
    "1000/10/4": 25.0,
    "(2026-11)-20": 1995.0,
    "1/2": 0.5,
}
REFUSED = (
    "2026-11-20",
    "2026-1-5",
    "20-11-2026",
    "2026/11/20",
    "20/11/2026",
    "2026-11-20T10:30:00",
    "2026-11-20 10:30:00",
    "1:30",
    "1:30:00",
    "190:20:30.15",
    "1:75",
    "010",
    "-010",
    "09",
    "1,000",
    "3,14",
    "1 000",
    "yes",
    "no",
    "on",
    "off",
    "y",
    "true",
    "False",
    "null",
    "~",
    ".inf",
    "-.inf",
    "+.INF",
    ".nan",
    ".NaN",
    "inf",
    "nan",
    "infinity",
    "1e400",
    "1e-400",
    "2 * 1e-400",
    "1e-310",
    "1j",
    "50%",
    "1e",
    "0x",
    "0o8",
    "1.2.3",
    "۱۲",
)


def load(tmp_path, written):
    path = tmp_path / "scene.yaml"
    path.write_text(TEXT.format(mass=written), encoding="utf-8")
    return load_scene(path)


@pytest.mark.parametrize("quote", ["", '"'])
@pytest.mark.parametrize("written, meant", MEANT.items())
def test_a_number_is_read_as_a_person_means_it(written, meant, quote, tmp_path):
    # Text in quotes is an expression, in which 0o10 and 1_000 are numbers as well.
    spec = load(tmp_path, f"{quote}{written}{quote}")
    assert spec.particles[0].parameters["mass"] == meant


@pytest.mark.parametrize("quote", ["", '"'])
@pytest.mark.parametrize("written", REFUSED)
def test_what_is_no_number_is_refused_with_file_line_and_column(written, quote, tmp_path):
    with pytest.raises(SceneError) as caught:
        load(tmp_path, f"{quote}{written}{quote}")
    assert len(caught.value.faults) == 1
    assert caught.value.faults[0].startswith(f"{tmp_path / 'scene.yaml'}:4:")


@pytest.mark.parametrize("written", [datetime.date(2026, 11, 20), "2026-11-20", True, 1e-310, 1j, b"5", None])
def test_a_mapping_from_python_is_read_by_the_same_rules(written):
    particles = [{"body": {"mass": written, "position": [0, 0, 0]}}]
    with pytest.raises(SceneError, match="mass"):
        load_scene({"particles": particles, "integrator": {"leapfrog": {"dt": 0.1}}})


@pytest.mark.parametrize("written", ["2026-11-20", "1:30", "010", "yes", ".nan", "1e-400"])
def test_an_override_is_read_by_the_same_rules(written, tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text(TEXT.format(mass="1"), encoding="utf-8")
    with pytest.raises(SceneError):
        load_scene(path, overrides=[f"particles[0].body.mass={written}"])


@pytest.mark.parametrize("written", ["2026-11-20", "yes", "'010'", "'1:30'", "1e5x"])
def test_the_same_words_remain_text_where_text_is_meant(written, tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text(f"title: {written}\n" + TEXT.format(mass="1"), encoding="utf-8")
    assert load_scene(path).title == written.strip("'")


@pytest.mark.parametrize("written", ["yes", "no", "on", "off", "1", "'true'"])
def test_a_flag_is_true_or_false(written, tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text(TEXT.format(mass=f"1\n      free: {written}"), encoding="utf-8")
    with pytest.raises(SceneError, match=r"scene\.yaml:5:"):
        load_scene(path)
