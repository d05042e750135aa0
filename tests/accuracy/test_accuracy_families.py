"""The order in which a study tries methods: what the scene's kind promises, every family once, and only then finer steps."""

import math

import numpy as np
import pytest

import mpp_taichi as mpp
from mpp_taichi import component
from mpp_taichi.accuracy.budget import Budget
from mpp_taichi.accuracy.choice import choose
from mpp_taichi.accuracy.families import ENCOUNTERS, PLANETS, STIFFNESS, kinds_of, promised, representatives
from mpp_taichi.accuracy.ladder import Ladder
from mpp_taichi.accuracy.method_variants import split_variant
from mpp_taichi.accuracy.methods import methods
from mpp_taichi.accuracy.problem import pose
from mpp_taichi.accuracy.sample import Sample
from mpp_taichi.accuracy.store import Store, identity
from mpp_taichi.accuracy.study import Study, StudyWishes
from mpp_taichi.accuracy.sweep import TRIAL_RUNGS, StepSweep
from mpp_taichi.accuracy.workbench import Workbench
from mpp_taichi.scene.load import load_scene
from scenes import kepler

TURNS, ECCENTRICITY = 10, 0.9
SPEED = math.sqrt((1.0 + ECCENTRICITY) / (1.0 - ECCENTRICITY))


def eccentric(target=1e-6):
    """A body on an ellipse of a = 1 around a fixed sun, from pericentre."""
    return {
        "title": "Ellipse",
        "dimensions": 2,
        "particles": [
            {"body": {"mass": 1, "position": [0, 0], "free": False}},
            {"body": {"mass": 1, "position": [1.0 - ECCENTRICITY, 0], "velocity": [0, SPEED]}},
        ],
        "forces": [{"newtonian_gravity": {"strength": 1}}],
        "accuracy": target,
        "run": {"duration": TURNS * 2.0 * math.pi},
    }


def closed_form(time):
    """In long double, from the very numbers of the start."""
    r, v, t = (np.longdouble(x) for x in (1.0 - ECCENTRICITY, SPEED, time))
    a = 1 / (2 / r - v * v)
    e = 1 - r / a
    mean = anomaly = np.sqrt(1 / a**3) * t
    for _ in range(200):
        anomaly -= (anomaly - e * np.sin(anomaly) - mean) / (1 - e * np.cos(anomaly))
    return np.array([a * (np.cos(anomaly) - e), a * np.sqrt(1 - e * e) * np.sin(anomaly), 0])


def three_bodies():
    """Burrau's problem: masses 3, 4 and 5 at rest, each opposite to the side of its length."""
    bodies = [(3, [1, 3]), (4, [-2, -1]), (5, [1, -1])]
    return {
        "title": "Burrau",
        "dimensions": 2,
        "particles": [{"body": {"mass": mass, "position": place}} for mass, place in bodies],
        "forces": [{"newtonian_gravity": {"strength": 1}}],
        "accuracy": 1e-6,
        "run": {"duration": 10},
    }


def springs(stiffness):
    bodies = [{"body": {"mass": 1, "position": [x, 0, 0], "free": x > 0}} for x in (0, 1)]
    return {
        "title": "Spring",
        "particles": bodies,
        "springs": [{"link": {"between": [0, 1], "stiffness": stiffness}}],
        "integrator": {"leapfrog": {"dt": 1e-4}},
        "run": {"duration": 10},
    }


def found_for(scene):
    problem = pose(load_scene(scene))
    return problem, methods(problem)


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("scene", "kinds"),
    [
        (three_bodies(), {ENCOUNTERS}),
        ({**kepler(0.3, dt=0.01), "run": {"duration": 1}}, {ENCOUNTERS, PLANETS}),
        (springs(100.0), set()),
        (springs(1e12), {STIFFNESS}),
    ],
)
def test_methods_are_promised_by_the_kind_of_the_scene(scene, kinds):
    problem, found = found_for(scene)
    assert kinds_of(problem, found.values()) == kinds
    names = promised(problem, found)
    assert all(kinds & set(component.flag("integrators", split_variant(name)[0], "promising_for")) for name in names)
    assert bool(names) == bool(kinds)
    if ENCOUNTERS in kinds:
        assert any(found[name].adaptive for name in names)
    if STIFFNESS in kinds:
        assert any(found[name].implicit for name in names)


def test_every_family_has_one_representative():
    _, found = found_for(three_bodies())
    chosen = [found[name].family for name in representatives(found.values())]
    assert sorted(chosen) == sorted({method.family for method in found.values()})


@pytest.fixture(scope="module")
def order(tmp_path_factory):
    """A study with more time than it needs, and the methods of its runs in their order."""
    problem = pose(load_scene(three_bodies()))
    store = Store(tmp_path_factory.mktemp("families"), identity(problem, problem.span, "test"))
    study = Study(problem, store, Budget(200.0), StudyWishes(devices=(("cpu", "f64"),), aim=0.7e-6))
    study.run()
    return study, [sample.configuration.integrator for sample in store]


@pytest.mark.sampled(3)
def test_every_family_is_tried_before_any_ladder_is_climbed_past_its_second_rung(order):
    study, names = order
    families = {method.family for method in study.methods.values() if not method.implicit}  # nothing limits explicit steps
    runs_of_reference = 3
    counts, seen = {}, set()
    for name in names[runs_of_reference:]:
        counts[name] = counts.get(name, 0) + 1
        seen.add(study.methods[name].family)
        if counts[name] > TRIAL_RUNGS:
            break
    assert seen | {study.methods[study.reference.integrator].family} >= families


def test_promised_methods_are_tried_first(order):
    study, names = order
    quick = [name for name in promised(study.problem, study.methods) if not study.methods[name].slow_to_compile]
    first = list(dict.fromkeys(name for name in names if name != study.own.name))[: len(quick)]
    assert set(first) == set(quick)


def test_a_close_encounter_is_left_to_an_adaptive_method(order):
    study, _ = order
    rows = [row for row in study.rows() if row.sample.status == "ok" and row.error("position").bound <= 1e-6]
    fastest = min(rows, key=lambda row: row.seconds)
    assert study.methods[fastest.sample.configuration.integrator].adaptive
    # Where the fastest methods need a thousand evaluations, no ladder of fixed steps is climbed to millions of them.
    assert max(row.sample.evaluations for row in study.rows()) < 1e6


@pytest.mark.sampled(3)
def test_an_eccentric_orbit_is_left_to_an_adaptive_method(tmp_path):
    spec = load_scene(eccentric())
    found = choose(spec, tmp_path, precisions=("f64",))
    assert found.tolerance is not None and found.control
    with mpp.Simulation(found.settle(spec), precision=found.precision) as simulation:
        simulation.run()
        place = simulation.snapshot().position[1]
    error = np.linalg.norm((place - closed_form(spec.run.duration)).astype(float))
    # Of one body on an ellipse ⟨r²⟩ = 1 + 3e²/2 and ⟨r⟩ = −3e/2 along its axis, over whole periods.
    size = math.sqrt(1.0 + 1.5 * ECCENTRICITY**2 - (1.5 * ECCENTRICITY) ** 2)
    assert error / size < 1e-6 * 1.001  # of the size at 65 samples


def test_a_later_precision_has_time_to_compile_in_its_own_share_of_the_budget(tmp_path):
    """Compiled methods get a part of the rest of a share, and not of the whole budget."""
    problem, found = found_for({**kepler(0.3), "run": {"duration": 1.0}})
    spent = [0.0]
    budget = Budget(20.0, clock=lambda: spent[0])
    with Workbench(problem, backend="cpu", precision="f32") as bench:
        sweep = StepSweep(bench, Store(tmp_path, {}), budget, found, lambda _: 0.0, aim=1e-3)
        spent[0] = 16.0  # in f64
        ladder = Ladder("leapfrog", 2, 100.0, 1.0, 1e-6)
        tried = []
        sweep.measure = lambda configuration: tried.append(configuration) or Sample(configuration, 0.1, status="refused")
        sweep.climb([ladder], share=0.95, first="leapfrog")
    assert [each.integrator for each in tried] == ["leapfrog"]
