"""Long lists of particles: read without YAML's parser, with the same result, the same messages, and in little time."""

import time

import numpy as np
import pytest

from mpp_taichi.errors import SceneError
from mpp_taichi.generators.body import Body
from mpp_taichi.scene import rows
from mpp_taichi.scene.load import load_scene
from mpp_taichi.start.assemble import assemble

HEAD = "title: long\nconstants: {k: 2}\n"
TAIL = "integrator:\n  leapfrog: {dt: 0.01}\nrun: {duration: 1}\n"
COUNT = 400


def numbers(seed):
    """Numbers as people and programs write them."""
    random = np.random.default_rng(seed)
    forms = ("{:.3f}", "{:g}", "{!r}", "{:.2e}", "{:+.1f}", "{:.0f}")
    while True:
        yield forms[random.integers(len(forms))].format(float(random.normal()))


def flow(made, i):
    return f"  - body: {{position: [{next(made)}, {next(made)}, {next(made)}], mass: 1}}\n"


def block(made, i):
    lines = (f"- body:\n    mass: {i}.5\n    position:\n", *(f"    - {next(made)}\n" for _ in range(3)))
    return "".join(lines) + "    velocity: [0, 0, 0]\n"


def named(made, i):
    extra = ", velocity: [k, 2*k, 1]" if i % 7 == 0 else ", radius: .5, color: [0.5, 1, 0]" if i % 5 == 0 else ""
    return f"- body: {{ name: b_{i}, mass: 0x10, position: [{next(made)}, {i}, 5.]{extra} }}\n"


def mixed(made, i):
    if i % 50 == 3:
        return f"  - ring: {{count: {i + 1}, inner_radius: {i + 1}.5, outer_radius: {i + 2}, mass: 1, name: r{i}}}\n"
    around = "" if i < 300 else ", around: 5, semi_major_axis: 2.5, mass: 1.0"
    return f"  - body: {{{around[2:]}}}\n" if around else flow(made, i)


STYLES = {"flow": flow, "block": block, "named": named, "mixed": mixed}


def scene(style, *, count=COUNT, head=HEAD, tail=TAIL):
    made = numbers(3)
    return head + "particles:\n" + "".join(style(made, i) for i in range(count)) + tail


def by_parser(monkeypatch, path):
    """The result of YAML's parser and of the model for every entry."""
    with monkeypatch.context() as patch:
        patch.setattr(rows, "FEWEST", 10**9)
        return outcome(path)


def outcome(path):
    """A scene as data, or its faults."""
    try:
        spec = load_scene(path)
    except SceneError as error:
        return error.faults
    return [(each.name, each.parameters, each.location) for each in spec.particles], spec.resolved, spec.integrator.location


@pytest.mark.parametrize("style", STYLES)
def test_the_scene_is_the_one_that_the_parser_reads(style, tmp_path, monkeypatch):
    path = tmp_path / "long.yaml"
    gravity = "forces:\n  - newtonian_gravity: {softening: 0.1}\n" if style == "mixed" else ""
    path.write_text(scene(STYLES[style], tail=gravity + TAIL), encoding="utf-8")
    found, expected = outcome(path), by_parser(monkeypatch, path)
    assert isinstance(found[0], list) and found == expected
    assert [type(v) for _, each, _ in found[0] for v in each.values()] == [
        type(v) for _, each, _ in expected[0] for v in each.values()
    ]


FAULTS = {
    "a negative mass": lambda text: text.replace("mass: 1}", "mass: -1}", 2),
    "a word for a number": lambda text: text.replace("mass: 1}", "mass: heavy}", 1),
    "a number for a name": lambda text: text.replace("mass: 1}", "mass: 1, name: 5}", 1),
    "a name twice": lambda text: text.replace("mass: 1}", "mass: 1, name: same}", 2),
    "a key twice": lambda text: text.replace("mass: 1}", "mass: 1, mass: 2}", 1),
    "an unknown key": lambda text: text.replace("mass: 1}", "mas: 1}", 1),
    "two components": lambda text: text.replace("mass: 1}", "mass: 1}\n    ring: {}", 1),
    "no end": lambda text: text.replace("mass: 1}", "mass: 1", 1),
    "a leading zero": lambda text: text.replace("mass: 1}", "mass: 010}", 1),
    "too large": lambda text: text.replace("mass: 1}", "mass: 1e301}", 1),
    "a long integer": lambda text: text.replace("mass: 1}", f"mass: {'9' * 28}}}", 1),
    "a vector of two": lambda text: text.replace("mass: 1}", "mass: 1, velocity: [1, 2]}", 1),
    "an entry that is no mapping": lambda text: text.replace("  - body:", "  - 5\n  - body:", 1),
    "a comment": lambda text: text.replace("mass: 1}", "mass: 1} # heavy", 1),
    "a line in two": lambda text: text.replace("mass: 1}", "mass: 1\n  }", 1),
    "a number in two lines": lambda text: text.replace("mass: 1}", "mass: 1\n     2}", 1),
    "a dash within brackets": lambda text: text.replace("mass: 1}", "mass:\n  - 1}", 1),
    "an anchor": lambda text: text.replace("mass: 1}", "mass: &m 1}", 1),
    "an empty line": lambda text: text.replace("mass: 1}", "mass: 1}\n", 1),
    "Windows": lambda text: text.replace("\n", "\r\n"),
    "in a plane": lambda text: text.replace("title: long", "dimensions: 2"),
    "in a text": lambda text: text.replace("particles:", "particles: |"),
    "twice": lambda text: text + "particles: []\n",
    "a second document": lambda text: text + "---\na: b\n",
    "a quoted text before": lambda text: 'description: "\n' + text.replace(TAIL, '"\n' + TAIL),
    "in brackets": lambda text: "{a: \n" + text + "}",
}


@pytest.mark.parametrize("fault", FAULTS)
def test_an_unusual_scene_is_read_or_refused_as_the_parser_does(fault, tmp_path, monkeypatch):
    path = tmp_path / "long.yaml"
    path.write_bytes(FAULTS[fault](scene(flow)).encode())
    assert FAULTS[fault](scene(flow)) != scene(flow)
    assert outcome(path) == by_parser(monkeypatch, path)


def test_an_override_of_one_entry_of_a_long_list_changes_this_entry(tmp_path):
    path = tmp_path / "long.yaml"
    path.write_text(scene(flow), encoding="utf-8")
    changed, before = load_scene(path, overrides=["particles[7].body.mass=5"]), load_scene(path)
    different = [i for i in range(COUNT) if changed.particles[i].parameters != before.particles[i].parameters]
    assert different == [7] and changed.particles[7].parameters["mass"] == 5.0


def test_particles_of_a_long_list_are_where_the_text_says(tmp_path):
    path = tmp_path / "long.yaml"
    path.write_text(scene(mixed, tail="forces:\n  - newtonian_gravity: {softening: 0.1}\n" + TAIL), encoding="utf-8")
    start = assemble(load_scene(path))
    first = [float(word) for word in path.read_text().partition("position: [")[2].partition("]")[0].split(",")]
    assert start.position[0].tolist() == first


def test_bodies_placed_at_once_are_those_placed_one_by_one(tmp_path, monkeypatch):
    path = tmp_path / "long.yaml"
    extra = "  - body: {position: [9, 9, 9], displacement: [.1, 0, 0], free: [true, false, true], mass: 2, name: last}\n"
    path.write_text(scene(mixed, tail=extra + "forces:\n  - newtonian_gravity: {softening: 0.1}\n" + TAIL), encoding="utf-8")
    found = assemble(load_scene(path))
    monkeypatch.setattr(Body, "at_once", lambda entries: None)
    expected = assemble(load_scene(path))
    for key in ("position", "velocity", "mass", "radius", "charge", "color", "free"):
        assert np.array_equal(getattr(found, key), getattr(expected, key)), key
    assert found.name == expected.name


def test_a_body_of_many_that_leaves_the_plane_is_named(tmp_path):
    path = tmp_path / "long.yaml"
    flat = scene(lambda made, i: f"- body: {{position: [{i}, 0], mass: 1, displacement: [0, 0{', 1' * (i == 250)}]}}\n")
    path.write_text(flat.replace("title: long", "dimensions: 2").replace("[0, 0, 1]", "[0, 0, 0]"), encoding="utf-8")
    load_scene(path)
    path.write_text(flat.replace("title: long", "dimensions: 2"), encoding="utf-8")
    with pytest.raises(SceneError, match=r"long.yaml:254:.*particles\[250\].*must be 0 in a scene of dimensions: 2"):
        load_scene(path)


LARGE = 100_000
SECONDS = 6.0  # of processor time: it takes 1.3 s on a processor of its own, and up to three times as long beside other work


@pytest.mark.sampled(3)
def test_a_hundred_thousand_bodies_are_read_in_seconds(tmp_path):
    path = tmp_path / "large.yaml"
    path.write_text(scene(flow, count=LARGE), encoding="utf-8")
    began = time.process_time()
    assert len(load_scene(path).particles) == LARGE
    assert time.process_time() - began < SECONDS


@pytest.mark.parametrize(("count", "differ"), [(200_001, False), (21_000, True)])
def test_a_list_that_is_too_long_is_refused_with_what_to_use_instead(count, differ, tmp_path):
    def entry(made, i):
        return f"- body: {{mass: 1, position: [{i}, 2*{i}, {'k' if differ and i % 20 else 0}]}}\n"

    path = tmp_path / "large.yaml"
    path.write_text(scene(entry, count=count).replace("2*", "" if not differ else "2*"), encoding="utf-8")
    with pytest.raises(SceneError, match=r"more than 200000 .*\.npz or \.csv"):
        load_scene(path)
