"""Studies of scenes with a timeline: all phases in turn, and each phase alone."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest
import yaml
from counted_budget import CountedBudget

import mpp_taichi as mpp
from mpp_taichi.accuracy.budget import Budget
from mpp_taichi.accuracy.choice import choose
from mpp_taichi.accuracy.machine import Machine
from mpp_taichi.accuracy.phase_studies import PhaseStudies
from mpp_taichi.accuracy.problem import AS_WRITTEN, pose
from mpp_taichi.accuracy.settled import settled
from mpp_taichi.accuracy.store import Store, identity
from mpp_taichi.accuracy.stretches import LOOKS, legs
from mpp_taichi.accuracy.study import Study, StudyWishes
from mpp_taichi.cli.main import main
from mpp_taichi.scene.load import load_scene

sys.path.insert(0, str(Path(__file__).parents[2] / "tools" / "benchmarks"))
from long_double_reference import reference_end_of_phases

from mpp_taichi.simulation.course import phases_of

SHORT = 1e-4


def planet(**more):
    """An orbit with friction; then without it; then, for a time shorter than any step, heavier; then under stronger gravity."""
    return {
        "title": "Kicked planet",
        "particles": [
            {"body": {"name": "sun", "mass": 1, "position": [0, 0, 0]}},
            {"body": {"name": "planet", "mass": 1e-3, "position": [1, 0, 0], "velocity": [0, 1.1, 0]}},
        ],
        "forces": [{"newtonian_gravity": {"strength": 1}}, {"linear_drag": {"coefficient": 1e-4}}],
        "integrator": {"leapfrog": {"dt": 0.01}},
        "timeline": [
            {"at": 1.0, "set": {"forces.linear_drag.coefficient": 0}},
            {"at": 2.5, "set": {"particles[1].body.mass": 0.01}},
            {"at": 2.5 + SHORT, "set": {"forces.newtonian_gravity.strength": 2, "integrator.leapfrog.dt": 0.005}},
        ],
        "run": {"duration": 3.0},
    } | more


def exact_end(scene):
    """In long double, by code that is no part of the program."""
    spec = load_scene(scene)
    return reference_end_of_phases(phases_of(spec), spec.run.duration)


def machine_of(scene, name):
    return Machine(pose(load_scene(scene)), name, backend="cpu", precision="f64")


def test_steps_are_divided_as_the_scene_divides_its_own():
    problem = pose(load_scene(planet()))
    assert [stretch.number for stretch in problem.stretches] == [0, 1, 2, 3]
    own = [1.0 / 0.01, 1.5 / 0.01, SHORT / 0.01, (0.5 - SHORT) / 0.005]
    assert [stretch.share for stretch in problem.stretches] == pytest.approx(np.array(own) / sum(own))
    parts = legs(problem.stretches, problem.own_steps)
    assert [leg.steps for leg in parts] == pytest.approx(own, rel=0.02, abs=1.0)
    for leg in parts:
        assert leg.time(leg.steps) == pytest.approx(leg.stretch.ended, rel=1e-15) and leg.stops[-1] == leg.steps


@pytest.mark.parametrize("steps", [LOOKS, 100, 777 * 2])
def test_twice_the_steps_are_twice_the_steps_in_every_phase(steps):
    """Else an error in a short phase would not show in the difference of two runs."""
    stretches = pose(load_scene(planet())).stretches
    once, twice = legs(stretches, steps), legs(stretches, 2 * steps)
    assert [2 * leg.steps for leg in once] == [leg.steps for leg in twice]
    assert [[2 * stop for stop in leg.stops] for leg in once] == [list(leg.stops) for leg in twice]


@pytest.mark.sampled(3)
def test_a_run_through_all_phases_has_the_error_that_a_long_double_reference_shows():
    machine = machine_of(planet(), "pefrl")
    end, budget = exact_end(planet()), Budget(1e9)
    ends = [machine.run(machine.configuration(steps), budget)[0] for steps in (256, 512, 1024)]
    errors = [float(np.linalg.norm((sample.end - end).astype(float), axis=1).max()) for sample in ends]
    for coarse, fine in zip(errors, errors[1:]):  # fourth order: 16
        assert 12.0 < coarse / fine < 20.0
    again = machine.run(machine.configuration(256), budget)[0]
    assert np.array_equal(ends[0].end, again.end)


@pytest.mark.sampled(3)
def test_a_settled_scene_takes_the_steps_of_the_pilot_bit_for_bit():
    steps = 300
    machine = machine_of(planet(), "pefrl")
    sample, _ = machine.run(machine.configuration(steps), Budget(1e9))
    made = settled(load_scene(planet()), "pefrl", 3.0 / steps, 3.0, {})
    for scene in (made, load_scene(made.resolved)):
        with mpp.Simulation(scene, backend="cpu", precision="f64") as simulation:
            simulation.run()
            assert np.array_equal(simulation.snapshot().position, sample.end)


def test_energies_are_compared_within_the_phases_that_keep_them():
    machine = machine_of(planet(), "pefrl")
    sample, _ = machine.run(machine.configuration(512), Budget(1e9))
    assert min(sample.times) == 1.0  # friction acts before
    assert 0.0 < sample.energy < 1e-6  # changes of mass and of gravity put far more in, which is no error


def test_an_unlike_timeline_is_another_problem():
    known = pose(load_scene(planet())).identity()
    later = planet()
    later["timeline"] = [{**later["timeline"][0], "at": 1.1}, *later["timeline"][1:]]
    stronger = planet()
    stronger["timeline"][2]["set"]["forces.newtonian_gravity.strength"] = 2.5
    plain = {key: value for key, value in planet().items() if key != "timeline"}
    found = {pose(load_scene(scene)).identity() for scene in (later, stronger, plain)}
    assert len(found) == 3 and known not in found
    assert pose(load_scene(planet())).identity() == known


@pytest.mark.sampled(3)
def test_phases_with_methods_of_their_own_are_run_as_written_and_by_each_method():
    scene = planet()
    scene["timeline"][2]["set"] = {"forces.newtonian_gravity.strength": 2, "integrator": {"rk4": {"dt": 0.005}}}
    problem = pose(load_scene(scene))
    assert problem.own_method == AS_WRITTEN
    names = [
        [each.integrator.name for each in (made, *(event.scene for event in made.timeline))]
        for made in map(problem.with_method, (AS_WRITTEN, "pefrl"))
    ]
    assert names == [["leapfrog"] * 3 + ["rk4"], ["pefrl"] * 4]
    store_free = machine_of(scene, AS_WRITTEN)
    sample, _ = store_free.run(store_free.configuration(problem.own_steps), Budget(1e9))
    assert sample.status == "ok" and sample.configuration.tolerance is None


@pytest.mark.sampled(3)
def test_a_target_is_reached_through_all_phases_and_the_choice_is_kept(tmp_path, monkeypatch):
    scene = planet(timeline=planet()["timeline"][:2])
    spec = load_scene({**scene, "accuracy": 1e-6})
    found = choose(spec, tmp_path, integrators=("pefrl",), precisions=("f64",), seconds=60.0)
    with mpp.Simulation(found.settle(spec), backend="cpu", precision="f64") as simulation:
        simulation.run()
        error = np.linalg.norm((simulation.snapshot().position - exact_end(scene)).astype(float), axis=1).max()
    kept = json.loads(next(tmp_path.glob("samples-*.json")).read_text(encoding="utf-8"))
    error /= kept["notes"]["reference"]["size"]
    assert error < 1e-6 and 0.5 < found.error / error < 2.0
    monkeypatch.setattr(Study, "run", lambda self: pytest.fail("chosen anew"))
    assert choose(spec, tmp_path, precisions=("f64",)) == found


@pytest.mark.sampled(3)
def test_each_phase_has_its_price_list_from_the_state_of_the_reference(tmp_path):
    scene = planet(timeline=planet()["timeline"][:1])
    problem = pose(load_scene(scene))
    store = Store(tmp_path, identity(problem, problem.span, "test"))
    phases = PhaseStudies()
    wishes = StudyWishes(("leapfrog", "pefrl"), (("cpu", "f64"),), reference="pefrl")
    study = Study(problem, store, CountedBudget(900, seconds=1e9), wishes, then=phases.run)
    study.run()
    assert [phase.stretch.number for phase in phases.found] == [0, 1]
    for phase in phases.found:
        assert phase.study.quantity == "position"
        assert phase.study.problem.start.time == phase.stretch.began
    last = phases.found[1].study
    rows = [row for row in last.rows() if row.position.value is not None]
    assert {row.sample.configuration.integrator for row in rows} == {"leapfrog", "pefrl"}
    # The end of the last phase alone, from the begin that the reference gave it, is the end of the whole run.
    assert np.linalg.norm(last.reference.end - exact_end(scene).astype(float), axis=1).max() < 1e-9


@pytest.mark.sampled(3)
def test_the_page_and_the_table_tell_of_each_phase(tmp_path, capsys):
    path = tmp_path / "planet.yaml"
    path.write_text(yaml.safe_dump(planet(timeline=planet()["timeline"][:1])), encoding="utf-8")
    words = [
        "accuracy",
        str(path),
        "--budget",
        "8s",
        "--integrators",
        "leapfrog",
        "--precisions",
        "f64",
        "--backends",
        "cpu",
        "--out",
        str(tmp_path),
    ]
    assert main(words) == 0
    told = capsys.readouterr().out
    found = json.loads((tmp_path / "accuracy.json").read_text(encoding="utf-8"))
    for phase in found["phases"]:
        assert phase["told"] in told and phase["sentence"] in told
    assert [phase["phase"] for phase in found["phases"]] == [1, 2] or "was studied alone" in "".join(found["remarks"])
    page = (tmp_path / "accuracy.html").read_text(encoding="utf-8")
    assert page.count("<h2>Phase ") == len(found["phases"])


def test_sliders_are_studied_at_their_values(tmp_path):
    """A scene with a slider has the error of the scene without it; another value of the slider is another problem."""
    sliders = [{"set": "forces.newtonian_gravity.strength", "from": 0.5, "to": 3}]
    plain = {key: value for key, value in planet().items() if key != "timeline"}
    ends = []
    for scene in (plain, {**plain, "sliders": sliders}):
        machine = machine_of(scene, "leapfrog")
        ends.append(machine.run(machine.configuration(300), Budget(1e9))[0].end)
    assert np.abs(ends[0] - ends[1]).max() < 1e-12  # a constant of the kernel or a number that it loads: rounding
    moved = {**plain, "sliders": sliders, "timeline": [{"at": 1.0, "set": {"forces.newtonian_gravity.strength": 2.0}}]}
    machine = machine_of(moved, "pefrl")
    found = [machine.run(machine.configuration(steps), Budget(1e9))[0].end for steps in (1024, 2048)]
    end = exact_end(moved)
    errors = [float(np.linalg.norm((each - end).astype(float), axis=1).max()) for each in found]
    assert 12.0 < errors[0] / errors[1] < 20.0
