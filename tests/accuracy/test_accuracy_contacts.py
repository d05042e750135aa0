"""Studies of accuracy with contacts: the contact solvers against event-driven flight."""

import re

import numpy as np
import pytest
import yaml
from counted_budget import CountedBudget

from mpp_taichi import SceneError
from mpp_taichi.accuracy.budget import Budget
from mpp_taichi.accuracy.contact_methods import solvers, with_solver
from mpp_taichi.accuracy.flight_reference import fly
from mpp_taichi.accuracy.problem import pose
from mpp_taichi.accuracy.store import Store, identity
from mpp_taichi.accuracy.study import Study, StudyWishes
from mpp_taichi.accuracy.workbench import Machine
from mpp_taichi.cli.main import main
from mpp_taichi.scene.load import load_scene


def gas(**more):
    """Twelve disks in a box, some twenty collisions."""
    return {
        "title": "Gas",
        "dimensions": 2,
        "seed": 3,
        "particles": [{"gas": {"count": 12, "lower": [0, 0], "upper": [10, 10], "radius": 0.6, "speed": 1}}],
        "contacts": {"hard_spheres": {"solver": "swept"}},
        "walls": [{"box": {"lower": [0, 0], "upper": [10, 10]}}],
        "integrator": {"leapfrog": {"dt": 0.2}},
        "run": {"duration": 4},
    } | more


def study_of(scene, folder, solvers, *, asks=1e9):
    problem = pose(load_scene(scene))
    store = Store(folder, identity(problem, problem.span, "test"))
    study = Study(problem, store, CountedBudget(asks, seconds=1e9), StudyWishes(solvers, (("cpu", "f64"),)))
    study.run()
    return study


def machine_of(scene, name):
    return Machine(pose(load_scene(scene)), name, backend="cpu", precision="f64")


@pytest.mark.thorough
def test_swept_contacts_are_exact_at_any_step_and_pairwise_ones_are_not():
    """Between contacts a gas flies straight, so that nothing depends on the step; pairwise finds them up to a step late."""
    flight = machine_of(gas(), "event_driven")
    reference, sample = fly(flight, Budget(1e9))
    assert reference.trusted and reference.bar < 1e-9 and reference.meaning is None
    assert 10 <= sample.evaluations <= 60  # its collisions
    found = {}
    for name, steps in (("swept", (4, 40)), ("pairwise", (20, 400))):
        machine = machine_of(gas(), name)
        runs = [machine.run(machine.configuration(count), Budget(1e9))[0] for count in steps]
        found[name] = [reference.errors(run)[0].bound for run in runs]
    # A shift of 1e-14 grew to the bar; some hundred roundings of drifts may do ten times as much.
    assert max(found["swept"]) <= 10.0 * reference.bar
    # Late by half of dt = 0.01 on average, at a speed of 1 in a system of size 4, and enlarged by every later collision.
    assert found["pairwise"][0] > found["pairwise"][1] > 1e-3


@pytest.mark.thorough
def test_what_touches_at_one_instant_makes_no_reference(tmp_path):
    """One on two: which of the two is hit first, round-off decides; a shift to either side shows it."""
    half = np.sqrt(0.75)
    bodies = [([-3.0, 0.0], [1.0, 0.0]), ([0.0, 0.5], [0.0, 0.0]), ([0.0, -0.5], [0.0, 0.0])]
    scene = gas(
        particles=[{"body": {"mass": 1, "position": x, "velocity": v, "radius": 0.5}} for x, v in bodies],
        walls=[],
        run={"duration": 3.0 - half + 3.0},
    )
    study = study_of(scene, tmp_path, ("simultaneous",), asks=500)
    assert study.reference.integrator == "event_driven" and not study.reference.trusted
    assert study.reference.meaning == pytest.approx(3.0 - half, abs=study.problem.span / 32)
    assert study.quantity == "energy" and study.problem.span == study.whole  # two collisions are too few to look at a part


@pytest.mark.thorough
def test_a_gas_is_looked_at_while_positions_mean_something(tmp_path):
    study = study_of(gas(run={"duration": 60.0}), tmp_path, ("swept",), asks=1500)
    assert study.reference.trusted and study.reference.bar < 1e-4
    assert 3.0 < study.problem.span < 30.0 and study.whole == 60.0
    assert study.store.span == study.problem.span


def test_springs_and_other_forces_leave_the_scenes_own_solver_as_the_reference(tmp_path):
    drag = gas(forces=[{"linear_drag": {"coefficient": 0.1}}], run={"duration": 0.5})
    spec = load_scene(drag)
    assert "event_driven" not in solvers([spec], "swept") and solvers([spec], "swept")[0] == "swept"
    study = study_of(drag, tmp_path, ("swept",), asks=600)
    assert study.reference.integrator == "swept"


def test_another_solver_keeps_what_solvers_have_in_common():
    spec = load_scene(gas(contacts={"hard_spheres": {"solver": "swept", "restitution": 0.7, "pairs": []}}))
    made = with_solver(spec, "event_driven", 0.5)
    assert made.contacts.solver.parameters["restitution"] == 0.7
    assert (made.contacts.solver.name, made.integrator.name, made.integrator.parameters) == (
        "event_driven",
        "event_driven",
        {"dt": 0.5},
    )
    back = with_solver(made, "resting", 0.1)
    assert (back.contacts.solver.name, back.integrator.name) == ("resting", "leapfrog")
    assert back.contacts.solver.parameters["restitution"] == 0.7


@pytest.mark.thorough
def test_a_solver_that_comes_to_a_standstill_is_a_row_with_the_reason():
    scene = gas(
        particles=[{"body": {"mass": 1, "position": [5, 1], "radius": 0.5}}],
        contacts={"hard_spheres": {"solver": "event_driven", "restitution": 0.5}},
        walls=[{"box": {"lower": [0, 0], "upper": [10, 10], "restitution": 0.5}}],
        forces=[{"uniform_gravity": {"acceleration": [0, -1, 0]}}],
        integrator={"event_driven": {"dt": 0.01}},
        run={"duration": 10.0},
    )
    machine = machine_of(scene, "event_driven")
    sample, _ = machine.run(machine.configuration(64), Budget(1e9))
    assert sample.status == "diverged" and re.match("inelastic collapse at|.* contacts from time 2.9", sample.reason)


@pytest.mark.parametrize(
    ("asked", "said"), [("leapfrog", "allowed are"), ("merging", "not for this scene, which can have swept")]
)
def test_in_a_scene_with_contacts_it_is_their_solvers_that_are_asked_for(tmp_path, capfd, asked, said):
    path = tmp_path / "gas.yaml"
    path.write_text(yaml.safe_dump(gas()), encoding="utf-8")
    code = main(["accuracy", str(path), "--integrators", asked, "--out", str(tmp_path / "out")])
    told = capfd.readouterr().err.strip().splitlines()[-1]
    assert code == 2 and f"--integrators {asked}: {said}" in told and "event_driven" in told


def test_contacts_with_steps_of_a_methods_own_choice_are_not_compared():
    with pytest.raises(SceneError, match="located contacts use the steps of ias15: vary its tolerance"):
        pose(load_scene(gas(contacts={"hard_spheres": {"solver": "located"}}, integrator={"ias15": {}})))
