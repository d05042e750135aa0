"""Overrides: the changes that `--set` and `overrides=` can make, and the changes that they refuse."""

import pytest

from mpp_taichi.errors import SceneError
from mpp_taichi.scene.load import load_scene

SCENE = {
    "title": "Base",
    "constants": {"k": 2, "twice": "2 * k"},
    "particles": [
        {"body": {"name": "a", "mass": 1, "position": [0, 0, 0]}},
        {"body": {"name": "b", "mass": "k", "position": [1, 0, 0]}},
    ],
    "forces": [{"newtonian_gravity": {"strength": "twice"}}],
    "integrator": {"leapfrog": {"dt": 0.1}},
    "run": {"duration": 10},
    "expect": {"momentum_error_max": {"below": 1e-9}},
}


def test_a_mapping_sets_values():
    spec = load_scene(SCENE, overrides={"integrator.leapfrog.dt": 0.01, "particles[1].body.position": (2, 0, 0)})
    assert spec.integrator.parameters["dt"] == 0.01
    assert spec.particles[1].parameters["position"] == (2.0, 0.0, 0.0)
    assert SCENE["integrator"]["leapfrog"]["dt"] == 0.1


@pytest.mark.parametrize(
    "text, value",
    [
        ("integrator.leapfrog.dt=1e-3", 1e-3),
        ("integrator.leapfrog.dt=k / 100", 0.02),
        ("integrator.leapfrog.dt= .5 ", 0.5),
        ("integrator={leapfrog: {dt: 0.25}}", 0.25),
        ("integrator={rk4: {dt: 0.3}}", 0.3),
        ("constants.k=4", 0.1),
    ],
)
def test_values_are_read_as_in_a_file(text, value):
    assert load_scene(SCENE, overrides=[text]).integrator.parameters["dt"] == value


def test_a_constant_reaches_all_that_depends_on_it():
    spec = load_scene(SCENE, overrides=["constants.k=5"])
    assert spec.forces[0].parameters["strength"] == 10.0 and spec.particles[1].parameters["mass"] == 5.0
    assert spec.resolved["constants"]["k"] == 5


@pytest.mark.parametrize("path", ["particles[1].body.mass", "particles.1.body.mass"])
def test_both_spellings_of_an_index(path):
    assert load_scene(SCENE, overrides=[f"{path}=9"]).particles[1].parameters["mass"] == 9.0


def test_keys_with_defaults_can_be_set_without_a_plus():
    texts = [
        "forces[0].newtonian_gravity.softening=0.5",
        "run.every=7",
        "seed=3",
        "view.camera.field_of_view=60",
        "record.fps=25",
    ]
    spec = load_scene(SCENE, overrides=texts)
    assert spec.forces[0].parameters["softening"] == 0.5
    assert (spec.run.every, spec.seed, spec.view.camera.field_of_view, spec.record.fps) == (7, 3, 60.0, 25.0)


def test_a_plus_adds_constants_entries_and_expectations():
    texts = [
        "+constants.m=3",
        "+particles[2].body={mass: m, position: [5, 0, 0]}",
        "+expect.steps.near=100",
        "expect.steps.within=0",
    ]
    spec = load_scene(SCENE, overrides=texts)
    assert len(spec.particles) == 3 and spec.particles[2].parameters["mass"] == 3.0
    assert {each.quantity for each in spec.expect} == {"momentum_error_max", "steps"}


def test_later_overrides_win():
    assert load_scene(SCENE, overrides=["seed=1", "seed=2"]).seed == 2


def test_an_override_is_split_at_its_first_equals_sign():
    assert load_scene(SCENE, overrides=["title='a=b'"]).title == "a=b"


@pytest.mark.parametrize(
    "text, message",
    [
        ("integrator.leapfrog.dt=abc", "unknown name 'abc'"),
        ("integrator.leapfrog.dt=-1", "must be above 0"),
        ("integrator.leapfrog.dtt=1", "unknown key 'dtt', did you mean 'dt'?"),
        ("integrator.rk4.dt=1", "unknown key 'rk4' in integrator"),
        ("intgrator.leapfrog.dt=1", "unknown key 'intgrator' in the scene, did you mean 'integrator'?"),
        ("constants.kk=1", "unknown key 'kk' in constants, did you mean 'k'?"),
        ("constants.other=1", "+constants.other=… adds it"),
        ("expect.steps.near=1", "unknown key 'steps' in expect"),
        ("particles[2].body.mass=1", "particles has no entry '2', allowed: 0 to 1"),
        ("particles.x.body.mass=1", "particles has no entry 'x'"),
        ("particles[0].ring.mass=1", "unknown key 'ring' in particles[0]"),
        ("title.x=1", "title is 'Base' and has no 'x'"),
        ("rnu=1", "unknown key 'rnu', did you mean 'run'?"),
        ("seed", "must be path=value"),
        ("=1", "is no path"),
        ("a..b=1", "is no path"),
        (".a=1", "is no path"),
        ("a.=1", "is no path"),
        ("a[x]=1", "is no path"),
        ("a[-1]=1", "is no path"),
        ("seed=[1", "not valid YAML"),
        (r"seed=[1, \2}", "not valid YAML"),
        (r"seed=[\g<1>\n", "not valid YAML"),
        ("seed=!!int 1", "tag"),
        ("seed=1\x00", "U+0000"),
        ("seed=010", "begins with a zero"),
        ("seed=*a", "alias"),
        ("extends=other.yaml", "cannot be overridden"),
        ("contacts={}", "missing key 'hard_spheres'"),
    ],
)
def test_a_fault_is_one_line_placed_at_the_override(text, message):
    with pytest.raises(SceneError) as caught:
        load_scene(SCENE, overrides=[text])
    (fault,) = caught.value.faults
    assert message in fault
    assert fault.startswith(f"--set {text}: ".replace("\x00", "�"))


def test_a_mapping_s_fault_names_path_and_value():
    with pytest.raises(SceneError, match=r"--set integrator\.leapfrog\.dt=-1: integrator\.leapfrog\.dt: -1 is not allowed"):
        load_scene(SCENE, overrides={"integrator.leapfrog.dt": -1})


def test_faults_of_several_overrides_are_all_reported():
    with pytest.raises(SceneError) as caught:
        load_scene(SCENE, overrides=["seed=-1", "run.duration=0", "oops"])
    assert len(caught.value.faults) == 3


def test_an_anchor_s_other_uses_stay_as_they_are(tmp_path):
    path = tmp_path / "scene.yaml"
    path.write_text(
        "particles:\n  - body: &one {mass: 1, position: [0, 0, 0]}\n  - body: *one\nintegrator: {leapfrog: {dt: 1}}\n"
    )
    spec = load_scene(path, overrides=["particles[0].body.mass=5"])
    assert [entry.parameters["mass"] for entry in spec.particles] == [5.0, 1.0]


def test_a_component_that_is_there_once_goes_by_its_name():
    assert load_scene(SCENE, overrides=["forces.newtonian_gravity.softening=0.5"]).forces[0].parameters["softening"] == 0.5
    with pytest.raises(SceneError, match=r"particles has 2 entries 'body', allowed: 0 to 1"):
        load_scene(SCENE, overrides=["particles.body.mass=2"])
    with pytest.raises(
        SceneError, match=r"forces has no entry 'newton_gravity', did you mean 'newtonian_gravity'\? allowed: 0 to 0"
    ):
        load_scene(SCENE, overrides=["forces.newton_gravity.softening=2"])


def test_parameters_of_a_name_without_braces_can_be_set():
    """`- newtonian_gravity` is an entry like any other, and so is `integrator: ias15`."""
    bare = {**SCENE, "forces": ["newtonian_gravity"], "integrator": "ias15"}
    texts = ["forces.newtonian_gravity.strength=3", "forces[0].newtonian_gravity.softening=k", "integrator.ias15.dt=0.5"]
    spec = load_scene(bare, overrides=texts)
    assert (spec.forces[0].parameters["strength"], spec.forces[0].parameters["softening"]) == (3.0, 2.0)
    assert spec.integrator.parameters["dt"] == 0.5
