"""The reader of scenes: the traps of YAML 1.1, places of faults, `extends`, and the contents of a checked scene."""

import subprocess
import sys
import textwrap

import numpy as np
import pytest

from mpp_taichi import component
from mpp_taichi.errors import SceneError
from mpp_taichi.precision import PRECISIONS
from mpp_taichi.scene.load import load_scene
from mpp_taichi.scene.scalars import read_plain

BASE = """\
particles:
  - body: {mass: 1, position: [0, 0, 0]}
integrator: {leapfrog: {dt: 0.1}}
"""


def scene(**changes):
    return {
        "particles": [{"body": {"mass": 1, "position": [0, 0, 0]}}],
        "integrator": {"leapfrog": {"dt": 0.1}},
        **changes,
    }


def write(folder, text, name="scene.yaml"):
    path = folder / name
    path.write_text(text)
    return path


@pytest.mark.parametrize(
    "text, value",
    [
        ("1e-9", 1e-9),
        ("1e5", 1e5),
        ("1.5E3", 1500.0),
        ("-.5", -0.5),
        (".5", 0.5),
        ("1E3", 1000.0),
        ("5e+3", 5000.0),
        ("1.", 1.0),
        ("+7", 7),
        ("-0", 0),
        ("0", 0),
        ("0x1F", 31),
        ("0o17", 15),
        ("true", True),
        ("False", False),
        ("null", None),
        ("~", None),
        ("", None),
        ("yes", "yes"),
        ("no", "no"),
        ("on", "on"),
        ("off", "off"),
        ("y", "y"),
        ("2020-01-01", "2020-01-01"),
        ("12:30:45.5x", "12:30:45.5x"),
        ("1_000", "1_000"),
        ("e5", "e5"),
        (".", "."),
        ("0x", "0x"),
        ("=", "="),
    ],
)
def test_plain_scalars_are_those_of_yaml_1_2(text, value):
    found = read_plain(text)
    assert found == value and type(found) is type(value)


@pytest.mark.parametrize("text", ["010", "-007", "00", "1:30", "1:30:00", "190:20:30.15", "9" * 5000, "0x" + "f" * 500])
def test_scalars_that_older_readers_misread_are_refused(text):
    with pytest.raises(ValueError):
        read_plain(text)


def test_quoted_scalars_are_text(tmp_path):
    assert load_scene(write(tmp_path, "title: '1.0'\n" + BASE)).title == "1.0"
    assert load_scene(write(tmp_path, 'title: "yes"\n' + BASE)).title == "yes"


def test_anchors_are_expanded(tmp_path):
    text = "particles:\n  - body: &one {mass: 1, position: [0, 0, 0]}\n  - body: *one\nintegrator: {leapfrog: {dt: 1}}\n"
    assert len(load_scene(write(tmp_path, text)).particles) == 2


def test_every_fault_is_reported_at_once_in_the_order_of_the_file(tmp_path):
    text = BASE.replace("mass: 1", "mas: 1").replace("dt: 0.1", "dt: -1") + "rnu: {}\nview: {trails: x}\n"
    path = write(tmp_path, text)
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    places = [fault.removeprefix(f"{path}:").split(": ")[:2] for fault in caught.value.faults]
    assert places == [
        ["2:5", "particles[0].body"],
        ["2:12", "particles[0].body.mas"],
        ["3:29", "integrator.leapfrog.dt"],
        ["4:1", "rnu"],
        ["5:16", "view.trails"],
    ]


def test_rendered_faults_show_the_line_and_a_caret_under_the_place(tmp_path):
    path = write(tmp_path, BASE.replace("dt: 0.1", "dt: sqrt(oops)"))
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    fault, line, caret = caught.value.render().split("\n")
    known = "known: pi, tau, e; names of your own stand under constants:"
    assert fault == f"{path}:3:34: integrator.leapfrog.dt: unknown name 'oops', {known}"
    assert line[caret.index("^") :].startswith("oops")
    assert "\n" not in caught.value.faults[0]


def test_messages_carry_no_control_characters(tmp_path):
    path = write(tmp_path, BASE + '"a\\eb\\nc": 1\n')
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    assert all(character.isprintable() for character in caught.value.faults[0])


@pytest.mark.parametrize("name", ["missing.yaml", ".", "a\0b.yaml", "x" * 5000])
def test_a_path_that_cannot_be_read_is_one_line(name, tmp_path):
    with pytest.raises(SceneError) as caught:
        load_scene(str(tmp_path / name) if "\0" not in name else name)
    assert len(caught.value.faults) == 1


def test_a_dict_is_a_scene_and_may_hold_numpy():
    spec = load_scene(scene(particles=[{"body": {"mass": np.float64(2), "position": np.array([1.0, 2.0, 3.0])}}]))
    assert spec.particles[0].parameters["position"] == (1.0, 2.0, 3.0)
    with pytest.raises(SceneError, match="cannot stand in a scene"):
        load_scene(scene(title=object()))


def test_a_specification_is_a_scene_and_its_resolved_form_gives_it_again():
    first = load_scene(scene(constants={"a": 2}, run={"duration": "a * 3"}))
    assert load_scene(first) is first
    again = load_scene(first, overrides={"constants.a": 5})
    assert again.run.duration == 15.0 and first.run.duration == 6.0
    assert load_scene(first.resolved).run == first.run


def test_extends_merges_mappings_and_replaces_lists(tmp_path):
    write(tmp_path, BASE + "run: {duration: 5, every: 3}\ntitle: Base\n", "base.yaml")
    path = write(tmp_path, "extends: base.yaml\nrun: {duration: 7}\nparticles:\n  - body: {mass: 2, position: [1, 0, 0]}\n")
    spec = load_scene(path)
    assert (spec.run.duration, spec.run.every, spec.title) == (7.0, 3, "Base")
    assert [entry.parameters["mass"] for entry in spec.particles] == [2.0]
    assert "extends" not in spec.resolved


def test_extends_replaces_another_integrator_whole(tmp_path):
    write(tmp_path, BASE, "base.yaml")
    path = write(tmp_path, "extends: base.yaml\nintegrator: {rk4: {dt: 0.2}}\n")
    assert load_scene(path).integrator.name == "rk4"


def test_a_fault_in_the_base_is_placed_in_the_base(tmp_path):
    base = write(tmp_path, BASE.replace("mass: 1", "mass: x"), "base.yaml")
    path = write(tmp_path, "extends: base.yaml\ntitle: A\n")
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    assert caught.value.faults[0].startswith(f"{base}:2:18: particles[0].body.mass")


def test_extends_is_bounded(tmp_path):
    write(tmp_path, BASE, "s0.yaml")
    for number in range(1, 7):
        write(tmp_path, f"extends: s{number - 1}.yaml\n", f"s{number}.yaml")
    load_scene(tmp_path / "s4.yaml")
    with pytest.raises(SceneError, match="more than 4 scenes"):
        load_scene(tmp_path / "s5.yaml")
    write(tmp_path, "extends: b.yaml\n", "a.yaml")
    write(tmp_path, "extends: a.yaml\n", "b.yaml")
    with pytest.raises(SceneError, match="leads back to itself"):
        load_scene(tmp_path / "a.yaml")


def test_extends_through_a_link_may_not_leave_the_folder(tmp_path):
    inside = tmp_path / "inside"
    inside.mkdir()
    outside = write(tmp_path, BASE, "outside.yaml")
    (inside / "link.yaml").symlink_to(outside)
    path = write(inside, "extends: link.yaml\n")
    with pytest.raises(SceneError, match="outside the scene's folder"):
        load_scene(path)


def test_a_plane_takes_two_components_everywhere_and_refuses_a_third():
    flat = scene(dimensions=2, forces=[{"uniform_gravity": {"acceleration": [0, -1]}}])
    flat["particles"] = [{"body": {"mass": 1, "position": [1, 2], "velocity": [3, 4, 0], "free": [True, False]}}]
    spec = load_scene(flat)
    assert spec.particles[0].parameters["position"] == (1.0, 2.0, 0.0)
    assert spec.particles[0].parameters["free"] == (True, False, True)
    assert spec.forces[0].parameters["acceleration"] == (0.0, -1.0, 0.0)
    flat["particles"] = [{"body": {"mass": 1, "position": [1, 2, 3]}}]
    with pytest.raises(SceneError, match=r"position\[2\]: must be 0 in a scene of dimensions: 2"):
        load_scene(flat)


def test_a_default_that_leaves_the_plane_is_refused():
    with pytest.raises(SceneError, match="acceleration"):
        load_scene(scene(dimensions=2, forces=[{"uniform_gravity": None}]))


def test_one_quantity_may_be_expected_of_several_particles():
    bodies = [{"body": {"name": name, "mass": 1, "position": [place, 0, 0]}} for place, name in enumerate("abc")]
    expect = {"orbital_period": [{"of": "b", "around": "a", "near": 1, "within": 1}, {"of": "c", "around": "a", "above": 0}]}
    spec = load_scene(scene(particles=bodies, expect=expect))
    assert [each.parameters for each in spec.expect] == [{"of": 1, "around": 0}, {"of": 2, "around": 0}]
    assert spec.expect[0].within == dict.fromkeys(PRECISIONS, 1.0)


def test_an_unknown_quantity_is_told_the_diagnostics_there_are():
    with pytest.raises(SceneError, match="did you mean 'orbital_period'"):
        load_scene(scene(expect={"orbital_perod": {"below": 1}}))


def test_one_s_own_components_are_found_and_checked(tmp_path, monkeypatch):
    folder = tmp_path / "forces"
    folder.mkdir()
    write(
        folder,
        'from mpp_taichi.component import component, param\n\n\n@component\nclass SideWind:\n    """Wind."""\n\n'
        "    speed: float = param(2.0, maximum=3.0)\n    kind: str = param(choices=('steady', 'gusty'))\n",
        "side_wind.py",
    )
    monkeypatch.setattr(component, "extra_folders", [tmp_path])
    spec = load_scene(scene(forces=[{"side_wind": {"kind": "steady"}}]))
    assert spec.forces[0].parameters == {"speed": 2.0, "kind": "steady"}
    with pytest.raises(SceneError) as caught:
        load_scene(scene(forces=[{"side_wind": {"kind": "steadi", "speed": 4}}]))
    assert "must be at most 3" in str(caught.value) and "did you mean 'steady'" in str(caught.value)


@pytest.mark.parametrize(
    "text",
    [
        'class SideWind:\n    """A class of the file\'s name that is not marked."""\n',
        "from mpp_taichi.component import component\n\n\n@component\nclass Wind:\n    pass\n",
        "SPEED = 2.0\n",
    ],
    ids=["unmarked", "other name", "no class"],
)
def test_a_file_without_a_marked_class_of_its_name_is_no_component(text, tmp_path, monkeypatch):
    (tmp_path / "forces").mkdir()
    write(tmp_path / "forces", text, "side_wind.py")
    monkeypatch.setattr(component, "extra_folders", [tmp_path])
    assert "side_wind" not in component.names("forces") and component.find_file("forces", "side_wind") is None
    with pytest.raises(KeyError, match="no file side_wind.py with a class SideWind marked @component"):
        component.declaration("forces", "side_wind")
    with pytest.raises(SceneError, match="unknown force 'side_wind'"):
        load_scene(scene(forces=[{"side_wind": {}}]))


def test_a_helper_of_the_walls_is_no_wall(tmp_path):
    path = write(tmp_path, BASE + "contacts: {hard_spheres: {solver: pairwise}}\nwalls:\n  - outline: {}\n")
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    (fault,) = caught.value.faults
    place = f"{path.name}:{len(path.read_text(encoding='utf-8').splitlines())}:5: walls[0].outline: "
    assert fault.split(place)[1:] == [
        f"unknown wall 'outline', allowed: {', '.join(sorted([*component.names('walls'), 'repeat']))}"
    ]
    assert "outline" not in component.names("walls")


def test_reading_and_assembling_import_no_taichi(tmp_path):
    path = write(tmp_path, BASE + "forces:\n  - newtonian_gravity: {}\n")
    program = f"""
        import sys
        from mpp_taichi.start.assemble import assemble
        from mpp_taichi.scene.estimate import estimate
        from mpp_taichi.scene.load import load_scene
        spec = load_scene({str(path)!r})
        estimate(spec), assemble(spec)
        assert "taichi" not in sys.modules
    """
    subprocess.run([sys.executable, "-c", textwrap.dedent(program)], check=True, timeout=60)
