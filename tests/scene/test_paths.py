"""The key `path` of a body: formulas that are no path, what a path cannot be beside, each told in one located line."""

import argparse
import logging
import math

import pytest
from told_faults import told

from mpp_taichi import SceneError, Simulation, component
from mpp_taichi.accuracy.problem import pose
from mpp_taichi.cli import compare
from mpp_taichi.errors import BackendError, PrecisionError, StateError, UnsupportedError
from mpp_taichi.exporters._source import Source
from mpp_taichi.exporters.catalogue import export
from mpp_taichi.scene.load import load_scene
from mpp_taichi.scene.path_checks import MOST_DRIVEN
from mpp_taichi.start.assemble import assemble
from mpp_taichi.sweep.structure import key_of, why_alone

TEXT = """\
constants: {{a: 0.1, w: 3}}
particles:
  - body: {{name: support, mass: 1, {support}}}
  - body: {{name: bob, mass: 1, position: [1, 0, 0]}}
springs:
  - link: {{between: [support, bob], stiffness: 20}}
integrator:
  {integrator}: {{dt: 0.01}}
run: {{duration: 2}}
{more}
"""
PATH = 'path: ["a*sin(w*t)", "0", 0]'


def written(tmp_path, support=PATH, integrator="leapfrog", more=""):
    file = tmp_path / "scene.yaml"
    file.write_text(TEXT.format(support=support, integrator=integrator, more=more))
    return str(file)


@pytest.mark.parametrize(
    ("path", "place", "message"),
    [
        ('["a*sin(b*t)", "0", "0"]', "3:50: particles[0].body.path[0]", "unknown name 'b'"),
        ('["0", "a*x", "0"]', "3:51: particles[0].body.path[1]", "unknown name 'x'"),
        ('["log(t)", "0", "0"]', "3:44: particles[0].body.path[0]", "x is no finite number at t = 0, must be one at all times"),
        ('["0", "0", "sqrt(t)"]', "3:54: particles[0].body.path[2]", "x′ is no finite number at t = 0"),
        ('["t^1.5", "0", "0"]', "3:44: particles[0].body.path[0]", "x″ is no finite number at t = 0"),
        ('["sqrt(1 - t)", "0", "0"]', "3:44: particles[0].body.path[0]", "is no finite number at t = 1"),
        ('["a*floor(t)", "0", "0"]', "3:46: particles[0].body.path[0]", "floor has no derivative, which a path needs"),
        ('["a*(t", "0", "0"]', "3:4", "particles[0].body.path"),
        ('["a*t", "0"]', "3:42: particles[0].body.path", "a list of 3 formulas"),
        ("0.1", "3:42: particles[0].body.path", "a list of 3 formulas"),
    ],
)
def test_a_bad_formula_is_told_in_one_located_line(tmp_path, path, place, message):
    found = told(written(tmp_path, f"path: {path}"))
    assert len(found) == 1, found
    assert found[0].startswith(place) and message in found[0], found


@pytest.mark.parametrize(
    ("more", "name"),
    [
        ("position: [0, 0, 0]", "position"),
        ("velocity: [0, 1, 0]", "velocity"),
        ("displacement: [0, 1, 0]", "displacement"),
        ("free: false", "free"),
        ("semi_major_axis: 1", "semi_major_axis"),
        ("eccentricity: 0.1", "eccentricity"),
    ],
)
def test_a_path_alone_places_the_body(tmp_path, more, name):
    found = told(written(tmp_path, f"{PATH}, {more}"))
    assert found == [
        f"3:5: particles[0].body: has a path and {name}: the path says where the body is at all times, leave one of them out"
    ]


def test_a_constant_may_not_hide_the_time(tmp_path):
    file = written(tmp_path, 'path: ["t", "0", "0"]')
    text = open(file).read().replace("w: 3}", "t: 3}")
    open(file, "w").write(text)
    assert "t is the time here and a constant of the scene, rename the constant" in told(file)[0]


CONTACTS = "contacts: {hard_spheres: {solver: pairwise}}"
BESIDE = {
    "contacts": ({"more": CONTACTS}, "a body on a path cannot be beside contacts:"),
    "centre": ({"more": "move_to_center_of_mass: true"}, "so move_to_center_of_mass is not allowed beside it"),
    "tangent": (
        {"more": "inspect: [{y: [{lyapunov: {}}]}]"},
        "lyapunov needs the derivative of every step, which bodies on a path do not have",
    ),
}


@pytest.mark.parametrize("kind", BESIDE)
def test_what_a_path_cannot_be_beside_is_refused(tmp_path, kind):
    given, message = BESIDE[kind]
    found = told(written(tmp_path, **given))
    assert any(each.startswith("3:5: particles[0].body.path: ") and message in each for each in found), found


def scene(**more):
    return {
        "particles": [{"body": {"mass": 1.0, "path": ["0.1*sin(3*t)", 0, 0]}}, {"body": {"mass": 1.0, "position": [1, 0, 0]}}],
        "springs": [{"link": {"between": [0, 1], "stiffness": 20.0}}],
        "integrator": {"leapfrog": {"dt": 0.01}},
        "run": {"duration": 1.0},
        **more,
    }


def test_a_periodic_box_is_refused():
    pair = {"pair": {"potential": "exp(-r)", "cutoff": 1.0}}
    box = {"periodic_box": {"lower": [-2, -2, -2], "upper": [2, 2, 2]}}
    with pytest.raises(SceneError, match="a body on a path cannot be in a periodic_box"):
        load_scene(scene(forces=[pair], walls=[box]))


def test_an_accuracy_key_is_refused():
    given = {key: value for key, value in scene(accuracy=1e-3).items() if key != "integrator"}
    with pytest.raises(SceneError, match="accuracy: compares methods that do not move bodies on a path, choose the integrator"):
        load_scene(given)


@pytest.mark.parametrize("name", [each for each in component.names("integrators") if each != "event_driven"])
def test_every_other_integrator_is_refused_by_name(name):
    parameters = {"dt": 0.01}
    if name == "langevin":
        parameters |= {"temperature": 1.0, "friction": 1.0}
    given = scene(integrator={name: parameters})
    if component.flag("integrators", name, "takes_paths"):
        load_scene(given)
        return
    with pytest.raises(SceneError, match=rf"integrator\.{name}: does not move bodies on a path, allowed: .*leapfrog"):
        load_scene(given)


def test_a_body_without_mass_is_refused_beside_a_pair_force():
    given = scene(forces=[{"coulomb": {}}])
    given["particles"][0]["body"]["mass"] = 0.0
    with pytest.raises(SceneError, match=r"particles\[0\]\.body\.mass: a body on a path needs a mass above 0 beside coulomb"):
        load_scene(given)


def test_too_many_paths_are_refused():
    given = scene()
    given["particles"] += [{"body": {"mass": 1.0, "path": [str(k), "t", "0"]}} for k in range(2, MOST_DRIVEN + 2)]
    with pytest.raises(SceneError, match=f"{MOST_DRIVEN + 1} bodies of the scene are on a path, allowed: {MOST_DRIVEN}"):
        load_scene(given)


@pytest.mark.parametrize("precision", ["f32c", "ds", "df64"])
def test_precisions_with_low_parts_are_refused(precision):
    with pytest.raises(PrecisionError, match=f"bodies on a path have no low parts, so they cannot run in {precision}"):
        Simulation(scene(), backend="cpu", precision=precision)


def test_a_sine_in_f64_is_refused_on_vulkan(software_vulkan):
    with pytest.raises(PrecisionError, match="a path calls .*, which vulkan has only in f32"):
        Simulation(scene(), backend="vulkan", precision="f64")


def test_copies_side_by_side_are_refused():
    start = assemble(load_scene(scene()))
    for plan in ("auto", "replicas"):
        with pytest.raises(BackendError, match="the plan replicas has no bodies on a path; run one copy of the scene"):
            Simulation(scene(), backend="cpu", plan=plan, replica_starts=[start, start])


def test_members_of_a_sweep_are_run_alone_and_do_not_share_a_path():
    one, other = (load_scene(scene(constants={"a": a})) for a in (1.0, 2.0))
    paths = [{"mass": 1.0, "path": ["a*sin(3*t)", 0, 0]}]
    specs = [
        load_scene(scene(constants={"a": a}, particles=[{"body": paths[0]}, *scene()["particles"][1:]]))
        for a in (1.0, 2.0, 2.0)
    ]
    keys = [key_of(each, assemble(specs[0])) for each in specs]
    assert keys[0] != keys[1] and keys[1] == keys[2]
    assert key_of(one, assemble(one)) == key_of(other, assemble(one))
    assert why_alone(one) == "bodies on a path are moved for one copy at a time"


def test_a_timeline_cannot_change_a_path():
    change = {"at": 0.5, "set": {"particles[0].body.path[0]": "0.2*sin(3*t)"}}
    with pytest.raises(SceneError, match=r"changes particles\[0\]\.body\.path, but particles stay"):
        load_scene(scene(timeline=[change]))
    given = scene(constants={"a": 0.1}, timeline=[{"at": 0.5, "set": {"constants.a": 0.2}}])
    given["particles"][0]["body"]["path"] = ["a*sin(3*t)", 0, 0]
    with pytest.raises(SceneError, match=r"changes particles\[0\]\.body\.path, but particles stay"):
        load_scene(given)
    with Simulation({**given, "timeline": []}, backend="cpu") as simulation:
        simulation.run(steps=2)
        with pytest.raises(SceneError, match=r"changes particles\[0\]\.body\.path"):
            simulation.set("constants.a", 0.3)


def test_a_state_that_is_not_on_the_path_is_refused():
    with Simulation(scene(), backend="cpu") as simulation:
        state = simulation.run(steps=20).snapshot()
    given = scene()
    given["particles"][0]["body"]["path"] = ["0.1*sin(4*t)", 0, 0]
    with pytest.raises(StateError, match=r"at t = 0.2 the state has particle 0 \(body\) .* from its path"):
        Simulation(given, backend="cpu", start=state)


def test_an_accuracy_study_is_refused():
    with pytest.raises(SceneError, match="accuracy compares methods of which most do not move bodies on a path"):
        pose(load_scene(scene()))


def test_a_comparison_with_other_backends_is_refused(tmp_path):
    parser = argparse.ArgumentParser()
    compare.add_arguments(parser)
    with pytest.raises(UnsupportedError, match="no other backend moves bodies on a path: there is nothing to compare"):
        compare.execute(parser.parse_args([written(tmp_path)]))


def test_a_particle_list_has_no_path(tmp_path):
    spec = load_scene(scene())
    with pytest.raises(SceneError, match="a particle list has no bodies on paths"):
        export(Source("scene", assemble(spec), spec), tmp_path / "list.plist")


def test_a_path_is_checked_to_the_last_step():
    given = scene(run={"steps": 300})
    given["particles"][0]["body"]["path"] = ["0.1*sqrt(2 - t)", 0, 0]
    with pytest.raises(SceneError, match="is no finite number at t = 2"):
        load_scene(given)


def test_a_repeat_writes_a_path_for_each_body():
    given = scene(springs=[])
    given["particles"] = [
        {"repeat": {"count": 3, "as": "i", "body": {"mass": 1, "path": ["i", "cos(t + {i})", "0.5*{i}*t"]}}},
        {"body": {"mass": 1.0, "position": [0, 0, 5]}},
    ]
    start = assemble(load_scene(given))
    assert start.driven == (0, 1, 2)
    assert start.position[:3].tolist() == [[k, math.cos(k), 0.0] for k in range(3)]
    assert start.velocity[:3].tolist() == [[0.0, -math.sin(k), 0.5 * k] for k in range(3)]


def test_a_kink_is_warned_of(tmp_path, caplog):
    with caplog.at_level(logging.WARNING):
        assemble(load_scene(written(tmp_path, 'path: ["abs(t - 1)", "0", "0"]')))
    assert "particles[0].body.path: abs has a kink, at which a step loses its order" in caplog.text


def test_a_path_is_read_in_the_plane_with_two_formulas():
    given = scene(dimensions=2)
    given["particles"][0]["body"]["path"] = ["cos(t)", "sin(t)"]
    start = assemble(load_scene(given))
    assert start.position[0].tolist() == [1.0, 0.0, 0.0] and start.velocity[0].tolist() == [0.0, 1.0, 0.0]
    assert start.driven == (0,) and not start.free[0].any() and start.moving[0].all()
