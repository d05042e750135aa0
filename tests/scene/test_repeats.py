"""Repeats: the entries that they stand for, and everything that a fault, a path, a schema or a limit has to do with them."""

import json

import jsonschema
import pytest
import yaml

from mpp_taichi.errors import SceneError
from mpp_taichi.scene import yaml_limits
from mpp_taichi.scene.load import load_scene
from mpp_taichi.scene.schema import SCHEMA_FILE

BODY = {"mass": 1, "position": [0, 0, 0]}


def scene(particles, **keys):
    return {"particles": particles, "integrator": {"leapfrog": {"dt": 0.01}}, **keys}


def entries(spec, key="particles"):
    return [(entry.name, entry.parameters) for entry in getattr(spec, key)]


def written(folder, text):
    path = folder / "scene.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def faults(source, **options):
    with pytest.raises(SceneError) as caught:
        load_scene(source, **options)
    return caught.value


def test_a_repeat_is_the_entries_written_one_by_one():
    def body(i):
        return {"body": {"name": f"b_{i}", "mass": i + 1, "position": [0.5 * i, i**2, f"l / {i + 1}"]}}

    def link(i):
        return {"link": {"between": [f"b_{i}", f"b_{i + 1}"], "stiffness": 10.0 + i, "type": "soft"}}

    keys = {"constants": {"l": 3}, "spring_types": {"soft": {"damping": 0.5}}}
    one_by_one = scene([body(i) for i in range(4)], springs=[link(i) for i in range(3)], **keys)
    repeated_body = {"name": "b_{k}", "mass": "k + 1", "position": ["0.5 * k", "k**2", "l / (k + 1)"]}
    repeated = scene(
        [
            {
                "repeat": {
                    "count": 4,
                    "as": "k",
                    "body": repeated_body,
                }
            }
        ],
        springs=[{"repeat": {"count": 3, "link": {"between": ["b_{i}", "b_{i + 1}"], "stiffness": "10 + i", "type": "soft"}}}],
        **keys,
    )
    found, expected = load_scene(repeated), load_scene(one_by_one)
    assert entries(found) == entries(expected)
    assert entries(found, "springs") == entries(expected, "springs")
    assert entries(load_scene(found.resolved)) == entries(expected)


def test_repeats_stand_in_repeats_and_hold_several_entries():
    spec = load_scene(
        scene(
            [
                {"body": {"name": "first", **BODY}},
                {"repeat": {"count": 2, "repeat": {"count": "i + 1", "as": "j", "body": {**BODY, "name": "b{i}{j}"}}}},
                {
                    "repeat": {
                        "count": 2,
                        "entries": [
                            {"polygon": {"name": "p{i}", "count": "3 + i", "radius": 1, "mass": 1}},
                            {"repeat": {"count": "i", "as": "j", "body": {**BODY, "name": "c{i}{j}"}}},
                        ],
                    }
                },
            ]
        )
    )
    assert [entry.parameters["name"] for entry in spec.particles] == ["first", "b00", "b10", "b11", "p0", "p1", "c10"]
    assert spec.particles[5].parameters["count"] == 4


def test_walls_repeat_too_and_a_name_can_be_an_index():
    spec = load_scene(
        scene(
            [{"repeat": {"count": 3, "body": {"mass": 1, "position": ["i", 0, 0], "radius": 0.1}}}],
            springs=[{"repeat": {"count": 2, "link": {"between": ["i", "i + 1"], "stiffness": 1}}}],
            contacts={"hard_spheres": {"solver": "pairwise"}},
            walls=[{"repeat": {"count": 2, "plane": {"point": [0, "-2 - i", 0], "normal": [0, 1, 0]}}}],
        )
    )
    assert [entry.parameters["between"] for entry in spec.springs] == [(0, 1), (1, 2)]
    assert [entry.parameters["point"][1] for entry in spec.walls] == [-2.0, -3.0]


TEXT = """\
constants: {{l: 2}}
particles:
  - body: {{mass: 1, position: [9, 0, 0]}}
  - repeat:
      count: 12
      body: {{name: "b_{{i}}", mass: {mass}, position: [i, 0, 0]}}
integrator: {{leapfrog: {{dt: 0.1}}}}
"""


@pytest.mark.parametrize(
    "mass, column, i, told, more",
    [
        ("10 - i", 35, 11, "-1 is not allowed", ""),
        ("1 / (i - 3)", 35, 3, "'1 / (i - 3)': division by zero", ""),
        ("l + l / (i - 11)", 39, 11, "'l / (11 - 11)': division by zero", ""),
        ("-l - i", 35, 0, "-2 is not allowed", " (so too for 11 other values)"),
        ("i * lenght", 39, 0, "unknown name 'lenght'", " (so too for 11 other values)"),
    ],
)
def test_a_fault_has_the_place_of_its_text_and_the_value_of_the_variable(mass, column, i, told, more, tmp_path):
    error = faults(written(tmp_path, TEXT.format(mass=mass)))
    (fault,) = [each for each in error.faults if told in each]
    assert f"scene.yaml:6:{column} (i = {i}): particles[" in fault
    assert ".body.mass: " in fault and fault.endswith(more)
    assert error.excerpts[error.faults.index(fault)].splitlines()[1].index("^") == 4 + column - 1


def test_places_behind_a_variable_are_those_of_the_text(tmp_path):
    """The value of the variable is longer than its name, so that a place behind it is not the same in both texts."""
    error = faults(written(tmp_path, TEXT.format(mass="l * i + l / (i - 11)")))
    assert "scene.yaml:6:43 (i = 11): particles[12].body.mass: 'l / (11 - 11)': division by zero" in str(error)


@pytest.mark.parametrize(
    "repeat, told",
    [
        (3, "must be a mapping"),
        ({"body": BODY}, "missing key 'count'"),
        ({"count": 2}, "has nothing to repeat"),
        ({"count": 2, "body": BODY, "polygon": {}}, "has 2 things to repeat: body, polygon"),
        ({"count": 2, "bodi": BODY}, "unknown key 'bodi', did you mean 'body'?"),
        ({"cuont": 2, "body": BODY}, "did you mean 'count'?"),
        ({"count": -1, "body": BODY}, "-1 is not allowed, must be at least 0"),
        ({"count": 2.5, "body": BODY}, "2.5 is not a whole number"),
        ({"count": "n", "body": BODY}, "unknown name 'n'"),
        ({"count": 2, "as": "2i", "body": BODY}, "'2i' cannot be a name"),
        ({"count": 2, "as": "pi", "body": BODY}, "'pi' means something already"),
        ({"count": 2, "as": "k", "body": BODY}, "'k' is a constant of the scene"),
        ({"count": 2, "repeat": {"count": 2, "body": BODY}}, "'i' is the variable of a repeat around this repeat"),
        ({"count": 2, "as": "u", "lattice": {}}, "'u' is a value of each particle here"),
        ({"count": 2, "as": "v", "entries": [{"body": BODY}, {"lattice": {}}]}, "'v' is a value of each particle here"),
        ({"count": 2, "as": "w", "repeat": {"count": 2, "lattice": {}}}, "'w' is a value of each particle here"),
        ({"count": 2, "entries": {"body": BODY}}, "must be a list of entries"),
        ({"count": 2, "body": {**BODY, "name": "b_{i / 0}"}}, "division by zero"),
        ({"count": 2, "body": {**BODY, "name": "b_{j}"}}, "unknown name 'j'"),
    ],
)
def test_a_repeat_that_cannot_be_written_out_says_why(repeat, told):
    assert told in str(faults(scene([{"repeat": repeat}], constants={"k": 1})))


@pytest.mark.parametrize("word", ["repaet", "repeats"])
def test_a_misspelt_repeat_finds_its_word(word):
    assert "did you mean 'repeat'?" in str(faults(scene([{word: {"count": 2, "body": BODY}}])))


def test_a_text_that_names_no_variable_stays():
    """Only braces belong to a repeat in a name; `arm-i` is no difference there."""
    spec = load_scene(scene([{"repeat": {"count": 1, "body": {**BODY, "name": "arm-i", "color": "red"}}}]))
    assert spec.particles[0].parameters["name"] == "arm-i" and spec.particles[0].parameters["color"] == (1.0, 0.0, 0.0)


def test_paths_change_the_text_of_a_repeat_or_an_entry_of_the_scene():
    base = scene([{"repeat": {"count": 3, "body": {"mass": "i + 1", "position": ["i", 0, 0]}}}, {"body": BODY}])
    spec = load_scene(base, overrides=["particles[1].body.mass=9", "particles.repeat.body.position=[2 * i, 0, 0]"])
    assert [entry.parameters["mass"] for entry in spec.particles] == [1.0, 9.0, 3.0, 1.0]
    assert [entry.parameters["position"][0] for entry in spec.particles] == [0.0, 2.0, 4.0, 0.0]
    spec = load_scene(base, overrides={"particles[0].repeat.count": 5, "+particles[6].body": {**BODY, "mass": 7}})
    assert [entry.parameters["mass"] for entry in spec.particles] == [1.0, 2.0, 3.0, 4.0, 5.0, 1.0, 7.0]
    assert "particles has no entry '9'" in str(faults(base, overrides=["particles[9].body.mass=1"]))


def test_a_scene_that_extends_another_changes_its_counts(tmp_path):
    (tmp_path / "base.yaml").write_text(
        yaml.safe_dump(scene([{"repeat": {"count": "n", "body": {**BODY, "name": "b{i}"}}}], constants={"n": 2}))
    )
    spec = load_scene(written(tmp_path, "extends: base.yaml\nconstants: {n: 4}\n"))
    assert [entry.parameters["name"] for entry in spec.particles] == ["b0", "b1", "b2", "b3"]


def test_a_timeline_changes_entries_and_constants_of_repeats():
    spec = load_scene(
        scene(
            [{"repeat": {"count": 2, "body": {"mass": "(i + 1) * m", "position": ["i", 0, 0]}}}],
            constants={"m": 1},
            timeline=[{"at": 0.1, "set": {"constants.m": 10}}, {"at": 0.2, "set": {"particles[1].body.mass": 5}}],
        )
    )
    masses = [[entry.parameters["mass"] for entry in each.scene.particles] for each in spec.timeline]
    assert masses == [[10.0, 20.0], [10.0, 5.0]]


def test_a_slider_moves_all_springs_of_a_repeat():
    spec = load_scene(
        scene(
            [{"repeat": {"count": 4, "body": {"mass": 1, "position": ["i", 0, 0]}}}],
            spring_types={"soft": {"stiffness": 2}},
            springs=[{"repeat": {"count": 3, "link": {"between": ["i", "i + 1"], "type": "soft"}}}],
            sliders=[{"set": "spring_types.soft.stiffness"}],
        )
    )
    assert [target.entry for target in spec.sliders[0].targets] == [0, 1, 2]


def test_a_repeat_stands_in_a_long_list(tmp_path):
    """Long lists are read without the parser of YAML."""
    lines = "\n".join(f"  - body: {{mass: 1, position: [{i}, 0, 0]}}" for i in range(300))
    repeat = "  - repeat: {count: 3, body: {mass: 2, position: [i, 5, 5]}}"
    spec = load_scene(written(tmp_path, f"particles:\n{lines}\n{repeat}\nintegrator: {{leapfrog: {{dt: 1}}}}\n"))
    assert [entry.parameters["position"][0] for entry in spec.particles[-4:]] == [299.0, 0.0, 1.0, 2.0]


@pytest.mark.parametrize(
    "repeat, number",
    [
        ({"count": 1e300, "body": BODY}, "makes an integer of 997 bits ×"),
        ({"count": 1_000_000_000, "body": BODY}, "makes 1000000000 ×"),
        ({"count": 1000, "repeat": {"count": 1000, "as": "j", "repeat": {"count": 1000, "as": "k", "body": BODY}}}, "1000 × 7"),
        ({"count": 30_000, "repeat": {"count": 0, "as": "j", "repeat": {"count": 9, "as": "k", "body": BODY}}}, ""),
        ({"count": 400_000, "repeat": {"count": 0, "as": "j", "body": BODY}}, "makes 400000 ×"),
        ({"count": 60_000, "entries": [{"body": BODY}] * 3}, "makes 60000 ×"),
    ],
)
def test_repeats_that_make_too_much_are_refused_with_the_number(repeat, number):
    told = str(faults(scene([{"body": BODY}, {"repeat": repeat}] if number else [{"repeat": repeat}])))
    assert (number in told and f"{yaml_limits.NODES_ALLOWED:,}" in told) if number else "one entry at least" in told


@pytest.fixture(scope="module")
def schema():
    return jsonschema.Draft202012Validator(json.loads(SCHEMA_FILE.read_text(encoding="utf-8")))


def test_the_schema_has_repeats(schema):
    good = scene(
        [
            {
                "repeat": {
                    "count": "n",
                    "as": "i",
                    "repeat": {"count": 2, "as": "j", "entries": [{"body": {**BODY, "mass": "i * j"}}]},
                }
            }
        ],
        springs=[{"repeat": {"count": 3, "link": {"between": ["b_{i}", "i + 1"], "stiffness": "i"}}}],
    )
    assert list(schema.iter_errors(good)) == []


@pytest.mark.parametrize(
    "repeat",
    [
        {"body": BODY},
        {"count": 2},
        {"count": -1, "body": BODY},
        {"count": 2, "body": BODY, "entries": []},
        {"count": 2, "bodi": BODY},
        {"count": 2, "body": {"mas": 1}},
        {"count": 2, "as": 3, "body": BODY},
        {"count": 2, "link": {"between": [0, 1], "stiffness": 1}},
    ],
)
def test_the_schema_refuses_what_the_reader_refuses(repeat, schema):
    assert list(schema.iter_errors(scene([{"repeat": repeat}])))
    faults(scene([{"repeat": repeat}]))
