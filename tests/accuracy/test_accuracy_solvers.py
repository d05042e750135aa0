"""Studies of accuracy with several solvers of gravity: names, methods, errors of the tree, the solver of the scene."""

import dataclasses
import json

import numpy as np
import pytest

from mpp_taichi.accuracy import force_solvers
from mpp_taichi.accuracy.budget import Budget
from mpp_taichi.accuracy.choice import Choice
from mpp_taichi.accuracy.findings import findings
from mpp_taichi.accuracy.machine import Machine
from mpp_taichi.accuracy.methods import for_reference, methods
from mpp_taichi.accuracy.problem import pose
from mpp_taichi.accuracy.store import Store, identity
from mpp_taichi.accuracy.study import Study, StudyWishes
from mpp_taichi.cli.main import main
from mpp_taichi.device.backends import import_taichi
from mpp_taichi.errors import SceneError
from mpp_taichi.scene.load import load_scene
from mpp_taichi.simulation.simulation import Simulation
from scenes import kepler

COUNT, STEPS, SPAN, SOFTENING = 4000, 4, 0.1, 0.05


def stars(count=COUNT, *, accuracy=None, integrator="leapfrog", **more):
    """Plummer's sphere, by a tree where an accuracy is given."""
    solver = {} if accuracy is None else {"solver": "tree", "accuracy": accuracy}
    return {
        "title": "Stars",
        "seed": 1,
        "particles": [{"plummer": {"name": "stars", "count": count}}],
        "forces": [{"newtonian_gravity": {"strength": 1.0, "softening": SOFTENING, **solver}}],
        "integrator": {integrator: {"dt": SPAN / STEPS}},
        "run": {"duration": SPAN},
        **more,
    }


def with_forces(scene, *others):
    return {**scene, "forces": [*scene["forces"], *others]}


def direct_energy(now):
    """Kinetic plus potential energy of a snapshot, pair by pair in NumPy."""
    potential = 0.0
    for i in range(len(now.mass) - 1):
        apart = np.sqrt(((now.position[i + 1 :] - now.position[i]) ** 2).sum(1) + SOFTENING**2)
        potential -= now.mass[i] * (now.mass[i + 1 :] / apart).sum()
    return 0.5 * (now.mass * (now.velocity**2).sum(1)).sum() + potential


# --- names ------------------------------------------------------------------------------------------------------------


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    "name, parts",
    [
        ("leapfrog", ("leapfrog", None)),
        ("pefrl+tree-1e-3", ("pefrl", 1e-3)),
        ("rk4+tree-1e-1", ("rk4", 0.1)),
        ("yoshida4+tree-2.5e-5", ("yoshida4", 2.5e-5)),
    ],
)
def test_a_name_says_what_sums_the_forces_and_back(name, parts):
    assert force_solvers.split(name) == parts
    assert force_solvers.joined(*parts) == name


@pytest.mark.sampled(2)
@pytest.mark.parametrize("accuracy", ["", "x", "0.5", "1e-9", "nan"])
def test_no_such_accuracy(accuracy, tmp_path, capsys):
    name = f"leapfrog+tree-{accuracy}"
    with pytest.raises(ValueError, match=r"1e-06 to 0\.1"):
        force_solvers.split(name)
    path = tmp_path / "scene.yaml"
    path.write_text(json.dumps(kepler()), encoding="utf-8")
    assert main(["accuracy", str(path), "--until", "1", "--integrators", name]) == 2
    assert name in capsys.readouterr().err


# --- what is compared -------------------------------------------------------------------------------------------------


def names_of(scene, asked=()):
    return [name for name in methods(pose(load_scene(scene)), asked) if "+" in name]


def test_the_scenes_own_integrator_is_tried_by_a_tree_where_one_may_pay():
    several = [force_solvers.joined("leapfrog", accuracy) for accuracy in force_solvers.ACCURACIES]
    assert names_of(stars()) == several
    assert names_of(stars(force_solvers.FEWEST_BODIES - 1)) == []
    assert names_of(stars(50), ["pefrl+tree-1e-2", "pefrl"]) == ["pefrl+tree-1e-2"]
    assert names_of(stars(accuracy=3e-3)) == ["leapfrog+tree-3e-3", *several]


def test_no_tree_is_tried_where_none_is_allowed():
    assert names_of(stars(integrator="hermite4")) == []
    assert names_of(with_forces(stars(), {"coulomb": {"coulomb_constant": 1.0}})) == []
    assert names_of(stars(50), ["ias15+tree-1e-2"]) == []


def test_the_same_scene_by_a_tree_is_the_same_problem_with_a_method_of_its_own():
    direct, tree, by_default = (pose(load_scene(stars(100, accuracy=a))) for a in (None, 1e-2, 1e-3))
    unsaid = stars(100, accuracy=1e-3)
    del unsaid["forces"][0]["newtonian_gravity"]["accuracy"]
    assert direct.identity() == tree.identity()
    assert (direct.own_method, tree.own_method) == ("leapfrog", "leapfrog+tree-1e-2")
    assert pose(load_scene(unsaid)).own_method == by_default.own_method == "leapfrog+tree-1e-3"
    softer = stars(100)
    softer["forces"][0]["newtonian_gravity"]["softening"] = 0.06
    assert pose(load_scene(softer)).identity() != direct.identity()


def test_what_others_are_measured_against_is_never_summed_by_a_tree():
    found = methods(pose(load_scene(stars(100, accuracy=1e-2))))
    names = [method.name for method in for_reference(found)]
    assert "leapfrog+tree-1e-2" in found and names and not [name for name in names if "+" in name]


# --- what a tree costs and what it gives ------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def runs():
    """The cluster after equal steps, by all pairs and by two trees: name → (sample, machine's energy error, in NumPy)."""
    import_taichi()
    problem, found = pose(load_scene(stars())), {}
    before = direct_energy(problem.start)
    for name in ("leapfrog", "leapfrog+tree-1e-1", "leapfrog+tree-1e-2"):
        machine = Machine(problem, name, backend="cpu", precision="f64")
        sample, _ = machine.run(machine.configuration(STEPS), Budget(1e9))
        found[name] = sample, abs(direct_energy(machine.simulation.snapshot()) / before - 1.0)
        machine.close()
    return found


@pytest.mark.sampled(3)
@pytest.mark.parametrize("accuracy", [1e-1, 1e-2])
def test_positions_are_as_far_off_as_the_accuracy_of_the_forces_says(runs, accuracy):
    exact = runs["leapfrog"][0].end
    sample = runs[force_solvers.joined("leapfrog", accuracy)][0]
    off = np.linalg.norm(sample.end - exact, axis=1)
    # Forces err by less than `accuracy` |a| for 99 of 100 stars. Plummer's sphere of mass 1 and scale 3π/16 has a field of
    # at most 0.39 × (16/3π)², and a near star adds at most 0.39 / (N ε²).
    largest = 0.39 * (16 / (3 * np.pi)) ** 2 + 0.39 / SOFTENING**2 / COUNT
    assert np.quantile(off, 0.99) < accuracy * 0.5 * largest * SPAN**2
    assert off.max() > 1e-13  # and it is another sum


@pytest.mark.sampled(3)
def test_the_energy_of_a_run_by_a_tree_is_summed_pair_by_pair(runs):
    for name, (sample, expected) in runs.items():
        # The last sample is at the end; both sums round by some √N ulp of energies that are not larger than their parts.
        assert sample.energy_errors[-1] == pytest.approx(expected, abs=1e-13), name
    coarse, fine = (runs[f"leapfrog+tree-{accuracy}"][0].energy for accuracy in ("1e-1", "1e-2"))
    assert coarse > fine


@pytest.mark.sampled(6)
def test_a_study_tells_the_tree_from_the_direct_sum(tmp_path):
    import_taichi()
    problem, names = pose(load_scene(stars(800, accuracy=0.1))), ("leapfrog", "leapfrog+tree-1e-1")
    store = Store(tmp_path, identity(problem, SPAN, "1"))
    study = Study(problem, store, Budget(60.0), StudyWishes(names, (("cpu", "f64"),), aim=1e-7))
    study.run()
    found = findings(study, 1e-7)
    assert "+" not in found["reference"]["integrator"] and found["reference"]["trusted"]
    (own,) = [row for row in found["rows"] if row["is_own"]]
    assert own["integrator"] == "leapfrog+tree-1e-1"
    errors = {name: [r["errors"]["position"]["value"] for r in found["rows"] if r["integrator"] == name] for name in names}
    assert min(errors["leapfrog+tree-1e-1"]) > 30 * min(errors["leapfrog"])  # no step mends the error of the tree
    assert "+" not in found["verdict"]["choice"]["integrator"]


# --- what follows ------------------------------------------------------------------------------------------------------


@pytest.mark.sampled(2)
@pytest.mark.parametrize("accuracy", [None, 1e-2])
@pytest.mark.parametrize("chosen", ["pefrl", "leapfrog+tree-1e-4"])
def test_a_choice_brings_its_solver_with_it(accuracy, chosen):
    spec = load_scene(stars(300, accuracy=accuracy))
    fields = {field.name: None for field in dataclasses.fields(Choice)}
    made = Choice(**fields | {"integrator": chosen, "dt": 0.02, "control": ""}).settle(spec)
    integrator, tree = force_solvers.split(chosen)
    for scene in (made, load_scene(made.resolved)):
        gravity = scene.forces[0].parameters
        assert (scene.integrator.name, gravity["solver"]) == (integrator, "direct" if tree is None else "tree")
        assert gravity["accuracy"] == tree
        assert gravity["softening"] == SOFTENING
    with Simulation(made) as simulation:
        assert simulation.total_force.by_tree == (tree is not None)


def test_a_tree_is_refused_where_its_error_cannot_be_measured():
    box = {"walls": [{"box": {"lower": [-9, -9, -9], "upper": [9, 9, 9]}}], "contacts": {"hard_spheres": {"solver": "swept"}}}
    with pytest.raises(SceneError, match="solver: direct"):
        pose(load_scene(stars(20, accuracy=1e-3, **box)))
    with pytest.raises(SceneError, match="up to 100,000 particles, not 100,001"):
        pose(load_scene(stars(force_solvers.MOST_BODIES + 1, accuracy=1e-3)))
