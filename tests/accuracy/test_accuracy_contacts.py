"""Studies of accuracy with contacts: the contact solvers against event-driven flight."""

import re

import numpy as np
import pytest
import yaml
from counted_budget import CountedBudget

from mpp_taichi import Simulation, StabilityError, component
from mpp_taichi.accuracy.budget import Budget
from mpp_taichi.accuracy.choice import choose
from mpp_taichi.accuracy.contact_methods import solvers, with_solver
from mpp_taichi.accuracy.flight_reference import fly
from mpp_taichi.accuracy.machine import Machine
from mpp_taichi.accuracy.methods import methods
from mpp_taichi.accuracy.problem import pose
from mpp_taichi.accuracy.reference import distance
from mpp_taichi.accuracy.sample import MeasuredError
from mpp_taichi.accuracy.scattered_convergence import ScatteredConvergence
from mpp_taichi.accuracy.store import Store, identity
from mpp_taichi.accuracy.study import Study, StudyWishes
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


@pytest.mark.sampled(3)
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


@pytest.mark.sampled(3)
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


@pytest.mark.sampled(3)
def test_a_gas_is_looked_at_while_positions_mean_something(tmp_path):
    study = study_of(gas(run={"duration": 60.0}), tmp_path, ("swept",), asks=1500)
    assert study.reference.trusted and study.reference.bar < 1e-4
    assert 3.0 < study.problem.span < 30.0 and study.whole == 60.0
    assert study.store.span == study.problem.span


@pytest.mark.sampled(3)
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


@pytest.mark.sampled(3)
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


def two_disks(**more):
    """Two disks that fall in a box, and meet once."""
    bodies = [([1, 1], [1, 0.3], 1), ([3, 1.2], [-0.5, 0.1], 2)]
    return (
        gas(
            particles=[{"body": {"mass": m, "position": x, "velocity": v, "radius": 0.3}} for x, v, m in bodies],
            forces=[{"uniform_gravity": {"acceleration": [0, -1, 0]}}],
            walls=[{"box": {"lower": [0, 0], "upper": [4, 4]}}],
            run={"duration": 2.0},
        )
        | more
    )


@pytest.mark.sampled(3)
def test_located_contacts_are_compared_by_tolerance_with_an_exact_flight():
    """The flight shares neither the search for contacts nor the integrator with them."""
    scene = two_disks(contacts={"hard_spheres": {"solver": "located", "restitution": 0.9}}, integrator={"ias15": {}})
    problem = pose(load_scene(scene))
    assert set(methods(problem)) == set(component.marked("integrators", "begins_anew")) | {"event_driven"}
    flight, led = (Machine(problem, name, backend="cpu", precision="f64") for name in ("event_driven", "ias15"))
    reference, sample = fly(flight, Budget(1e9))
    assert reference.trusted and sample.evaluations >= 2  # a collision, and bounces off the box
    errors = [reference.errors(led.run(led.configuration(64, epsilon), Budget(1e9))[0])[0].bound for epsilon in (1e-2, 1e-9)]
    assert errors[1] < 1e-12 and errors[0] >= errors[1]


@pytest.mark.sampled(3)
def test_located_contacts_under_another_force_are_their_own_reference(tmp_path):
    scene = two_disks(
        forces=[{"newtonian_gravity": {"strength": 1}}],
        contacts={"hard_spheres": {"solver": "located"}},
        integrator={"adaptive_dop853": {}},
    )
    study = study_of(scene, tmp_path, ("adaptive_dop853",), asks=900)
    assert study.reference.integrator in ("taylor", "ias15") and study.reference.bar < 1e-11
    told = [row.position.value for row in study.rows() if row.position.value is not None]
    assert told and all(row.sample.configuration.integrator not in ("swept", "pairwise") for row in study.rows())


def pair_that_merges():
    """Two bodies that meet at t = π/(2√2) · (a half-way to the centre), and a third that goes round what they become."""
    bodies = [([0, 0, 0], [0, 0, 0], 1, 0.1), ([1, 0, 0], [0, 0.3, 0], 0.5, 0.1), ([3, 0, 0], [0, 0.7, 0.1], 0.01, 0.05)]
    return {
        "title": "Merging",
        "particles": [{"body": {"mass": m, "position": x, "velocity": v, "radius": r}} for x, v, m, r in bodies],
        "forces": [{"newtonian_gravity": {"strength": 1}}],
        "contacts": {"hard_spheres": {"solver": "merging"}},
        "integrator": {"leapfrog": {"dt": 0.01}},
        "run": {"duration": 5.0},
    }


@pytest.mark.sampled(3)
def test_spheres_that_are_left_after_mergers_are_compared_and_other_mergers_have_no_number():
    machine = machine_of(pair_that_merges(), "leapfrog")
    runs = [machine.run(machine.configuration(steps), Budget(1e9))[0] for steps in (1001, 8009)]
    ends = [run.end for run in runs]
    gone = np.isnan(ends[0][:, 0])
    assert gone.sum() == 1 and ends[0][gone, 1] == [0.0]  # the lighter body is a part of the heavier
    largest, _ = distance(*ends, 1.0)
    assert 0.0 < largest < 1e-4 and largest == np.linalg.norm((ends[0] - ends[1])[~gone], axis=1).max()
    apart, other = ends[0].copy(), ends[0].copy()
    apart[gone] = 0.5  # did not merge
    other[gone, 1] = 2.0  # merged with the third body
    assert distance(apart, ends[1], 1.0) == distance(other, ends[1], 1.0) == (np.inf, np.inf)
    assert MeasuredError.against(np.inf, 1e-6).bound == np.inf and str(MeasuredError.against(np.inf, 1e-6)) == "–"


@pytest.mark.sampled(3)
def test_the_bar_of_a_reference_with_contacts_holds_its_error():
    """By halved steps from 192 on the bar was 18 times too small: contacts fall into the same places of the steps."""
    machine = machine_of(pair_that_merges(), "leapfrog")
    fine = machine.run(machine.configuration(20_011), Budget(1e9))[0].end
    runs = ScatteredConvergence(2, 192)
    for _ in range(6):
        runs.add(*machine.run(machine.configuration(runs.next_steps), Budget(1e9), follow=True))
        runs.refine()
    found = runs.reference()
    error, _ = distance(found.end, fine, found.size)
    assert found.trusted and error < found.bar < 1e-4


@pytest.mark.sampled(3)
def test_a_target_with_contacts_is_reached_by_flight_and_kept_as_a_scene(tmp_path):
    spec = load_scene(two_disks(accuracy=1e-6))
    found = choose(spec, tmp_path, integrators=("event_driven", "swept"), precisions=("f64",), seconds=30.0)
    assert (found.integrator, found.quantity) == ("event_driven", "position")
    ends = []
    for scene in (
        found.settle(spec),
        load_scene(found.settle(spec).resolved),
        two_disks(integrator={"leapfrog": {"dt": 1e-3}}),
    ):
        with Simulation(scene, backend="cpu", precision="f64") as simulation:
            simulation.run()
            ends.append(simulation.snapshot().position)
    assert np.array_equal(*ends[:2]) and np.abs(ends[0] - ends[2]).max() < 1e-2  # of first order, with steps of 1e-3


@pytest.mark.sampled(3)
def test_a_target_beyond_the_meaning_of_positions_is_refused_in_a_line(tmp_path):
    spec = load_scene(gas(run={"duration": 60.0}, accuracy=1e-3))
    with pytest.raises(
        StabilityError, match="positions mean nothing beyond t = .*, before the end, .*shorten run.duration"
    ) as told:
        choose(spec, tmp_path, integrators=("swept",), precisions=("f64",), seconds=30.0)
    assert "\n" not in str(told.value) and told.value.exit_code == 4


@pytest.mark.sampled(3)
def test_contacts_that_end_with_a_phase_are_compared_with_flight(tmp_path):
    scene = two_disks(timeline=[{"at": 1.2, "set": {"contacts": None, "walls": []}}])
    study = study_of(scene, tmp_path, ("swept",), asks=600)
    assert [stretch.spec.contacts is None for stretch in study.problem.stretches] == [False, True]
    assert study.reference.integrator == "event_driven" and study.quantity == "position"
    errors = [row.position.bound for row in study.rows() if row.sample.configuration.integrator == "swept"]
    assert 0.0 < min(errors) < 1e-2
