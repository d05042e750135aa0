"""Adaptive methods in a study of accuracy: series of tolerances, and IAS15 as a reference with little round-off."""

from types import SimpleNamespace

import numpy as np
import pytest

import mpp_taichi as mpp
from mpp_taichi.accuracy import adaptive_reference
from mpp_taichi.accuracy.budget import Budget
from mpp_taichi.accuracy.choice import choose
from mpp_taichi.accuracy.ladder import Ladder
from mpp_taichi.accuracy.machine import Machine
from mpp_taichi.accuracy.methods import LOOKS
from mpp_taichi.accuracy.problem import pose
from mpp_taichi.accuracy.reference import ReferenceSolution, size_of
from mpp_taichi.accuracy.stepper import TRIAL, Stepper
from mpp_taichi.scene.load import load_scene

TURNS = 10
START, SPEED = 0.4, 2.0  # the pericentre of an ellipse with a = 1, e = 0.6


def scene(**more):
    """A planet around a fixed sun."""
    return {
        "title": "Kepler",
        "dimensions": 2,
        "particles": [
            {"body": {"mass": 1.0, "position": [0, 0], "free": False}},
            {"body": {"mass": 1.0, "position": [START, 0], "velocity": [0, SPEED]}},
        ],
        "forces": [{"newtonian_gravity": {"strength": 1.0}}],
        "integrator": {"ias15": {}},
        "run": {"duration": TURNS * 2 * np.pi},
    } | more


def closed_form(time):
    """In long double, from the very numbers of the start, rounded as they are; good to 1e-17 of the mean anomaly."""
    r, v, t = (np.longdouble(x) for x in (START, SPEED, time))
    a = 1 / (2 / r - v * v)
    e = 1 - r / a
    mean = np.sqrt(1 / a**3) * t
    anomaly = mean
    for _ in range(60):
        anomaly -= (anomaly - e * np.sin(anomaly) - mean) / (1 - e * np.cos(anomaly))
    return np.array([a * (np.cos(anomaly) - e), a * np.sqrt(1 - e * e) * np.sin(anomaly), 0])


@pytest.fixture
def bench():
    problem = pose(load_scene(scene()))
    machine = Machine(problem, "ias15", backend="cpu", precision="f64")
    yield SimpleNamespace(problem=problem, machine=machine, truth=closed_form(problem.span))
    machine.close()


@pytest.mark.sampled(3)
def test_one_disturbed_launch_does_not_make_an_adaptive_method_dear(monkeypatch):
    """A study leaves out methods whose runs seem to take more than a part of its budget."""
    seconds = iter([5e-3, 1e-4, 2e-4])
    monkeypatch.setattr(Stepper, "_launch_seconds", lambda *_: next(seconds))
    machine = Machine(pose(load_scene(scene())), "adaptive_bogacki_shampine", backend="cpu", precision="f64")
    assert machine.seconds_per_step == TRIAL * 1e-4


@pytest.mark.sampled(3)
def test_one_compilation_serves_all_tolerances(bench):
    """Steps go with the seventh root of the tolerance; the bits of a run do not depend on those before it."""
    ends, steps = [], []
    for tolerance in (1e-9, 1e-4, 1e-9):
        sample, _ = bench.machine.run(bench.machine.configuration(LOOKS, tolerance), Budget(1e9))
        ends.append(sample.end)
        steps.append(sample.dt)
    assert np.array_equal(ends[0], ends[2]) and not np.array_equal(ends[0], ends[1])
    assert steps[0] == steps[2] and steps[1] / steps[0] == pytest.approx(1e5 ** (1 / 7), rel=0.1)


def known(bench, *, error, bar):
    """A reference by another method, with a planted error of its own."""
    end = bench.truth.astype(float) + [0.0, error, 0.0]
    trace = bench.machine.run(bench.machine.configuration(LOOKS, 1e-9), Budget(1e9), follow=True)[1]
    size = size_of(trace)
    return ReferenceSolution("kahan_li8", 8, 8192, np.array([[0.0, 0.0, 0.0], end]), size, bar / size, bar / size, True)


@pytest.mark.sampled(3)
def test_ias15_is_a_reference_as_good_as_its_bar_says(bench):
    samples = []
    found = adaptive_reference.finer(bench.machine, known(bench, error=1e-11, bar=2e-11), Budget(1e9), add=samples.append)
    error = np.linalg.norm((found.end[1] - bench.truth).astype(float)) / found.size
    assert (found.integrator, found.control, found.tolerance) == ("ias15", "epsilon", adaptive_reference.tolerances("ias15")[1])
    assert error <= found.bar < 1e-12  # 1e-12 of a target is known to be reached
    assert [sample.configuration.tolerance for sample in samples] == list(adaptive_reference.tolerances("ias15"))


@pytest.mark.parametrize("error, bar", [(1e-9, 1e-10), (0.0, 1e-16)])
@pytest.mark.sampled(3)
def test_a_reference_that_contradicts_ias15_or_is_better_stays(bench, error, bar):
    before = known(bench, error=error, bar=bar)
    assert adaptive_reference.finer(bench.machine, before, Budget(1e9), add=lambda _: None) is before


@pytest.mark.sampled(3)
def test_a_choice_of_an_adaptive_method_is_one_of_its_tolerance(tmp_path):
    """Of second order: the step η that reaches 1e-3, and not a fixed one."""
    spec = load_scene(scene(integrator={"adaptive_leapfrog": {}}, accuracy=1e-3))
    found = choose(spec, tmp_path, integrators=("adaptive_leapfrog",), precisions=("f64",), seconds=60.0)
    assert found.control == "step" and f"step = {found.tolerance:.3g}" in found.line()
    settled = found.settle(spec)
    assert settled.integrator.parameters["step"] == found.tolerance
    with mpp.Simulation(settled, precision=found.precision) as simulation:
        simulation.run()
        error = np.linalg.norm((simulation.snapshot().position[1] - closed_form(simulation.time)).astype(float))
    # The size is the root mean square distance from the mean place of sun and planet; twice that of the planet at most.
    assert 1e-3 / 10.0 < error < 1e-3
    again = choose(spec, tmp_path, integrators=("adaptive_leapfrog",), precisions=("f64",), seconds=60.0)
    assert again == found


def test_a_ladder_of_tolerances_has_the_same_looks_on_every_rung():
    ladder = Ladder("ias15", 15, float(LOOKS), 1.0, 1e-14, tolerance=1e-9)
    tried = []
    while rungs := ladder.open_rungs():
        rung = rungs[0]
        tried.append(ladder.asked(rung))
        assert ladder.steps(rung) == LOOKS
        ladder.note(rung, max(ladder.asked(rung) ** (15 / 7) * 1e3, 1e-13))
    # Coarser than 1e-2 would be beyond the loosest; 1e-10 is the first that is no better.
    assert sorted(tried) == pytest.approx([10.0**-k for k in range(10, 1, -1)])
