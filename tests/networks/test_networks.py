"""Lattices, their links and spring types: the particles and springs of a scene, and its warnings."""

import logging

import numpy as np
import pytest

from mpp_taichi.errors import SceneError
from mpp_taichi.scene.estimate import estimate
from mpp_taichi.scene.load import load_scene
from mpp_taichi.start.assemble import assemble


def scene(particles, springs=(), **more):
    return {"particles": particles, "springs": list(springs), "integrator": {"leapfrog": {"dt": 0.01}}, **more}


def made(particles, springs=(), **more):
    return assemble(load_scene(scene(particles, springs, **more)))


def body(mass=1, position=(0, 0, 0), **more):
    return {"body": {"mass": mass, "position": list(position), **more}}


def sheet(shape=(4, 3), **more):
    return {"lattice": {"name": "net", "shape": list(shape), "lower": [0, 0, 0], "upper": [3, 2, 1], **more}}


def links(**more):
    return {"lattice_links": {"of": "net", "stiffness": 1, **more}}


# --- lattices -----------------------------------------------------------------------------------------------------------


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    "shape, fixed, held",
    [
        ((4, 3), "none", []),
        ((4, 3), "rim", [0, 1, 2, 3, 4, 7, 8, 9, 10, 11]),
        ((4, 3), "first", [0, 4, 8]),
        ((4, 3), "last", [3, 7, 11]),
        ((4, 3), "ends", [0, 3, 4, 7, 8, 11]),
        ((4, 3), "corners", [0, 3, 8, 11]),
        ((4, 3), "upper_corners", [8, 11]),
        ((5,), "rim", [0, 4]),
        ((5,), "first", [0]),
        ((5,), "ends", [0, 4]),
        ((5,), "upper_corners", [4]),
        ((3, 1, 2), "upper_corners", [3, 5]),
        ((2, 2, 2), "corners", [0, 1, 2, 3, 4, 5, 6, 7]),
        ((1,), "rim", []),
    ],
)
def test_a_lattice_holds_what_it_is_told_to(shape, fixed, held):
    free = made([sheet(shape, fixed=fixed)]).free
    assert np.flatnonzero(~free.all(axis=1)).tolist() == held
    assert (~free[held]).all(), "what is held is held along every axis"


def test_particles_that_are_not_held_have_the_freedom_they_are_given():
    snapshot = made([sheet(fixed="ends", free=[False, False, True], velocity=[1, "u", "sin(pi * v)"])])
    held = [0, 3, 4, 7, 8, 11]
    assert not snapshot.free[held].any() and not snapshot.velocity[held].any()
    others = np.setdiff1d(np.arange(12), held)
    assert (snapshot.free[others] == [False, False, True]).all()
    assert snapshot.velocity[others, 2] == pytest.approx(np.sin(np.pi * snapshot.position[others, 1] / 2))
    assert not snapshot.velocity[others, :2].any()


def test_scatter_displaces_what_is_free_at_random_and_leaves_the_springs_their_rest():
    entry = sheet((30, 20), fixed="first", free=[True, False, True], scatter=[0.5, 0.5, 0.1])
    snapshot, placed = made([entry], [links()]), made([sheet((30, 20))], [links()])
    shift = snapshot.position - placed.position
    held = placed.position[:, 0] == 0.0
    assert not shift[held].any() and not shift[:, 1].any()
    assert np.array_equal(snapshot.springs.rest_length, placed.springs.rest_length)
    for axis, largest in ((0, 0.5), (2, 0.1)):  # uniform in ±largest: Kolmogorov–Smirnov at 0.1 %
        sample = np.sort(shift[~held, axis]) / (2 * largest) + 0.5
        assert np.abs(sample - (np.arange(len(sample)) + 0.5) / len(sample)).max() < 1.95 / np.sqrt(len(sample))
    again, other = made([entry], [links()]), made([entry], [links()], seed=1)
    assert np.array_equal(again.position, snapshot.position) and not np.array_equal(other.position, snapshot.position)


def test_a_displaced_body_stretches_its_springs():
    pair = [body(), body(1, (2, 0, 0), displacement=[1, 0, 0])]
    snapshot = made(pair, [{"link": {"between": [0, 1], "stiffness": 1}}])
    assert snapshot.position[1].tolist() == [3, 0, 0] and snapshot.springs.rest_length.tolist() == [2]


# --- links --------------------------------------------------------------------------------------------------------------


@pytest.mark.sampled(2)
@pytest.mark.parametrize("shape", [(4, 3), (5,), (1, 4), (3, 2, 4), (1, 1), (2, 1, 3)])
@pytest.mark.parametrize("kind", ["nearest", "diagonal", "bending"])
def test_links_are_all_pairs_at_their_distance(shape, kind):
    """Found again by looking at every pair of places: which coordinates differ, and by how much."""
    spec = load_scene(scene([body(), sheet(shape)], [links(neighbors=kind)]))
    springs = assemble(spec).springs
    counts = (*shape, 1, 1)[:3]
    places = np.array([(i, j, k) for k in range(counts[2]) for j in range(counts[1]) for i in range(counts[0])])
    wanted = {"nearest": [0, 0, 1], "diagonal": [0, 1, 1], "bending": [0, 0, 2]}[kind]
    expected = {
        (a + 1, b + 1)
        for a in range(len(places))
        for b in range(a + 1, len(places))
        if sorted(np.abs(places[a] - places[b])) == wanted
    }
    assert {tuple(sorted(pair)) for pair in springs.between.tolist()} == expected
    assert len(springs) == len(expected) == estimate(spec).spring_count


def test_links_of_several_kinds_have_their_own_parameters():
    kinds = {"nearest": (5.0, 0.1, 3 * 3 + 4 * 2), "diagonal": (2.0, 0.2, 2 * 3 * 2), "bending": (0.5, 0.0, 2 * 3 + 4 * 1)}
    entries = [links(neighbors=kind, stiffness=d, damping=c) for kind, (d, c, _) in kinds.items()]
    springs = made([sheet()], entries).springs
    begin = 0
    for stiffness, damping, count in kinds.values():
        own = slice(begin, begin + count)
        assert set(springs.stiffness[own]) == {stiffness} and set(springs.damping[own]) == {damping}
        begin += count
    assert begin == len(springs)


def test_prestretch_divides_the_placed_length_unless_the_rest_length_is_said():
    link = {"between": [0, 1], "stiffness": 1, "prestretch": 1.25}
    pair = [body(), body(1, (2, 0, 0))]
    assert made(pair, [{"link": link}]).springs.rest_length == pytest.approx(1.6)
    assert made(pair, [{"link": {**link, "rest_length": 0.3}}]).springs.rest_length == 0.3


# --- spring types -------------------------------------------------------------------------------------------------------

TYPES = {"steel": {"stiffness": 50, "damping": 0.1, "color": [1, 0, 0]}, "rubber": {"stiffness": 2, "prestretch": 2}}


def test_a_type_gives_what_the_entry_does_not_say():
    springs = [
        {"link": {"between": [0, 1], "type": "steel"}},
        {"link": {"between": [0, 1], "type": "steel", "damping": 0, "color": [0, 0, 1]}},
        {"link": {"between": [0, 1], "type": "rubber", "stiffness": 3}},
        links(type="rubber", of="net"),
    ]
    del springs[-1]["lattice_links"]["stiffness"]
    found = made([body(), body(1, (2, 0, 0)), sheet((2,))], springs, spring_types=TYPES).springs
    assert found.stiffness.tolist() == [50, 50, 3, 2]
    assert found.damping.tolist() == [0.1, 0, 0, 0]
    assert found.rest_length.tolist() == [2, 2, 1, 1.5]
    assert found.color.tolist() == [[1, 0, 0], [0, 0, 1], [0.4, 0.4, 1], [0.4, 0.4, 1]]


SCENE_WITH_TYPE = """\
particles:
  - body: {mass: 1, position: [0, 0, 0]}
  - body: {mass: 1, position: [1, 0, 0]}
spring_types:
  steel: {stiffness: 50, damping: 0.1}
springs:
  - link: {between: [0, 1], type: steel}
integrator: {leapfrog: {dt: 0.01}}
"""


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    "old, new, fault",
    [
        ("type: steel", "type: stele", "s.yaml:7:35: springs[0].link.type: unknown spring type 'stele', did you mean 'steel'?"),
        ("type: steel", "type: 5", "s.yaml:7:35: springs[0].link.type: must be text, not 5"),
        (", type: steel", "", "s.yaml:7:5: springs[0].link: missing key 'stiffness'"),
        (
            "stiffness: 50, ",
            "",
            "s.yaml:7:5: springs[0].link: missing key 'stiffness' (D), and its type 'steel' does not say it",
        ),
        (
            "stiffness: 50",
            "stiffness: -50",
            "s.yaml:5:22: spring_types.steel.stiffness: -50 is not allowed, must be at least 0",
        ),
        ("stiffness: 50", "stifness: 50", "s.yaml:5:11: spring_types.steel.stifness: unknown key 'stifness', did you mean"),
        ("{stiffness: 50, damping: 0.1}", "50", "s.yaml:5:10: spring_types.steel: must be a mapping"),
    ],
)
def test_a_fault_of_a_type_is_located(old, new, fault, tmp_path):
    path = tmp_path / "s.yaml"
    assert old in SCENE_WITH_TYPE
    path.write_text(SCENE_WITH_TYPE.replace(old, new))
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    assert len(caught.value.faults) == 1 and fault in str(caught.value)


def test_a_type_can_be_overridden_and_a_resolved_scene_is_the_same_scene(tmp_path):
    path = tmp_path / "s.yaml"
    path.write_text(SCENE_WITH_TYPE)
    spec = load_scene(path, overrides=["spring_types.steel.stiffness=70"])
    again = load_scene(spec.resolved)
    assert spec.springs[0].parameters["stiffness"] == again.springs[0].parameters["stiffness"] == 70
    with pytest.raises(SceneError, match="did you mean 'steel'"):
        load_scene(path, overrides=["spring_types.stele.stiffness=70"])


# --- warnings and refusals ----------------------------------------------------------------------------------------------


def warnings_of(caplog, *given, **more):
    caplog.clear()
    with caplog.at_level(logging.WARNING):
        snapshot = made(*given, **more)
    return snapshot, [record.getMessage() for record in caplog.records]


def test_springs_whose_ends_coincide_are_named_once(caplog, tmp_path):
    link = {"between": ["a", "b"], "stiffness": 1}
    pair = [body(name="a"), body(name="b")]
    _, lines = warnings_of(caplog, pair, [{"link": {**link, "rest_length": 1}}, {"link": {**link, "rest_length": 2}}])
    assert len(lines) == 1 and "(1 more such springs)" in lines[0]
    assert "springs[0].link: the ends of the spring between particle 0 (a) and particle 1 (b) are at the same place" in lines[0]
    assert len(warnings_of(caplog, pair, [{"link": link}])[1]) == 1, "at rest as placed: a rest length of 0 by accident"
    assert not warnings_of(caplog, pair, [{"link": {**link, "rest_length": 0}}])[1], "0 in so many words is a linear spring"
    path = tmp_path / "s.yaml"
    path.write_text(SCENE_WITH_TYPE.replace("[1, 0, 0]", "[0, 0, 0]"))
    caplog.clear()
    assemble(load_scene(path))
    assert caplog.records[0].getMessage().startswith(f"{path}:7:5: springs[0].link: ")


ACROSS = {"upper": [3, 2, 0], "fixed": "rim", "displacement": [0, 0, "0.1 * sin(pi * u) * sin(pi * v)"]}


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    "net, springs, more, warned",
    [
        (ACROSS, [links()], {}, True),
        ({**ACROSS, "displacement": [0, 0, 0], "velocity": [0, 0, "sin(pi * u)"]}, [links()], {}, True),
        ({**ACROSS, "shape": [5], "fixed": "ends", "displacement": [0, 0, "0.1 * sin(pi * u)"]}, [links()], {}, True),
        (ACROSS, [links(prestretch=1.5)], {}, False),
        (ACROSS, [links(), links(neighbors="diagonal", prestretch=1.2)], {}, False),
        ({**ACROSS, "displacement": ["0.1 * sin(pi * u)", 0, 0]}, [links()], {}, False),
        ({**ACROSS, "fixed": "upper_corners"}, [links()], {}, False),
        (ACROSS, [links()], {"forces": [{"uniform_gravity": {"acceleration": [0, 0, -1]}}]}, False),
        ({**ACROSS, "upper": [3, 2, 1], "shape": [3, 3, 3]}, [links()], {}, False),
    ],
)
def test_a_slack_net_that_starts_across_itself_is_said_to_have_no_linear_mode(net, springs, more, warned, caplog):
    _, lines = warnings_of(caplog, [sheet(**net)], springs, **more)
    assert ["no linear mode" in line for line in lines] == [True] * warned
    if warned:
        assert lines[0].startswith("scene: springs[0].lattice_links: net has no prestretch")


def test_a_spring_to_itself_is_refused():
    with pytest.raises(SceneError, match="both ends are particle 0"):
        made([body(), body(1, (1, 0, 0))], [{"link": {"between": [0, 0], "stiffness": 1}}])


@pytest.mark.parametrize("free", [True, [True, False, False]])
def test_an_end_without_mass_that_is_free_to_move_is_refused(free):
    pair = [body(), body(0, (1, 0, 0), free=free)]
    with pytest.raises(SceneError, match="particle 1 .* has no mass but a spring"):
        made(pair, [{"link": {"between": [0, 1], "stiffness": 1}}])
