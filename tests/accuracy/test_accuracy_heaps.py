"""Price lists of heaps, in which every step gives another heap, so that means over many starts are compared."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from mpp_taichi.accuracy.budget import Budget
from mpp_taichi.accuracy.collisions import meaning_ends
from mpp_taichi.accuracy.heap_levels import RUNS, HeapLevels, is_lottery
from mpp_taichi.accuracy.machine import Machine
from mpp_taichi.accuracy.measuring import HEAP_SHIFT, shifted_start, with_runs
from mpp_taichi.accuracy.methods import StudyMethod
from mpp_taichi.accuracy.offers import Offer
from mpp_taichi.accuracy.problem import pose
from mpp_taichi.accuracy.sample import Configuration, MeasuredError, Sample
from mpp_taichi.accuracy.store import Store, identity
from mpp_taichi.accuracy.study import Study, StudyWishes
from mpp_taichi.accuracy.trials import Trials, try_offer
from mpp_taichi.accuracy.value_reference import ValueReference
from mpp_taichi.device.backends import import_taichi
from mpp_taichi.scene.load import load_scene


def heap(**more):
    """Twelve disks of different radii that fall into a box and have lost most of their energy after some bounces."""
    disks = {"name": "disks", "count": 12, "lower": [0, 0.4], "upper": [2, 4], "radius": 0.2, "radius_spread": 0.2, "speed": 1}
    return {
        "title": "Heap",
        "dimensions": 2,
        "seed": 1,
        "particles": [{"gas": disks}],
        "forces": [{"uniform_gravity": {"acceleration": [0, -9.81]}}],
        "contacts": {"hard_spheres": {"solver": "pairwise", "restitution": 0.8}},
        "walls": [{"box": {"lower": [0, 0], "upper": [2, 9], "restitution": 0.8}}],
        "integrator": {"leapfrog": {"dt": 0.004}},
        "run": {"duration": 3},
        "expect": {"potential_energy": {"above": 0}},
    } | more


def study_of(scene, folder, of, *, seconds):
    problem = pose(load_scene(scene), of=of)
    store = Store(folder, identity(problem, problem.span, "test"))
    study = Study(problem, store, Budget(seconds), StudyWishes(("pairwise",), (("cpu", "f64"),)))
    study.run()
    return study


@pytest.fixture(scope="module")
def heap_study(tmp_path_factory):
    return study_of(heap(), tmp_path_factory.mktemp("heap"), "potential_energy", seconds=10.0)


@pytest.fixture(scope="module")
def many_runs(heap_study):
    """Mean of many runs of steps that are finer than those of the reference, from other starts; and its standard error."""
    import_taichi()
    machine = Machine(heap_study.problem, "pairwise", backend="cpu", precision="f64")
    configuration = machine.configuration(2 * heap_study.value_reference.steps + 5)
    runs = [machine.measure(configuration, Budget(1e9), number=100 + number).values[0] for number in range(25)]
    machine.close()
    return SimpleNamespace(mean=float(np.mean(runs)), error=float(np.std(runs, ddof=1)) / math.sqrt(len(runs)))


# --- the means --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("first_order", [0.0, 0.5, 2.0])
def test_the_bar_of_a_mean_holds_its_error_in_nineteen_of_twenty_cases(first_order):
    """Values about 10 that scatter by 1, on which the steps leave an error that halves from level to level."""
    drawn, held = np.random.default_rng(5), 0
    for _ in range(400):
        found = HeapLevels()
        for level in range(4):
            found.add(10.0 + first_order / 2**level + drawn.normal(size=(RUNS, 1)))
        held += abs(found.mean[0] - 10.0) <= found.bars[0]
    assert held >= 0.95 * 400


def test_levels_that_differ_by_more_than_their_scatter_do_not_agree():
    drawn = np.random.default_rng(6)
    level = 10.0 + 0.01 * drawn.normal(size=(RUNS, 1))
    same, falling = HeapLevels(), HeapLevels()
    for number in range(4):
        assert not same.agree  # four levels at least
        same.add(level)
        falling.add(level + 1.0 / 2**number)
    assert same.agree and not falling.agree


def test_a_lottery_is_told_from_an_error_of_first_order():
    assert is_lottery([0.01, 0.02, 0.008], 2.0, 1e-9)
    assert not is_lottery([0.01, 0.007, 0.0025], 2.0, 1e-9)  # 4 times smaller after two halvings
    assert not is_lottery([0.01, 0.02], 2.0, 1e-9)
    assert not is_lottery([1e-12, 1e-12, 1e-12], 2.0, 1e-9)


def test_shifted_starts_have_other_velocities_and_the_same_places():
    """Velocities, and not places, since spheres that touch at the start must not overlap."""
    problem = pose(load_scene(heap()), of="potential_energy")
    shifted = with_runs(problem, shift=1e-3)
    starts = [shifted_start(shifted, number, "f64", key) for number, key in ((0, "a"), (1, "a"), (1, "b"))]
    size = float(np.sqrt(np.mean(np.sum((problem.start.position - problem.start.position.mean(axis=0)) ** 2, axis=1))))
    for position, velocity in starts:
        assert np.array_equal(position, problem.start.position)
        apart = np.abs(velocity - problem.start.velocity)
        assert 0.5e-3 < apart.max() * problem.span / size <= 1e-3 and not apart[:, 2].any()
    assert len({start[1].tobytes() for start in starts}) == 3
    assert shifted_start(problem, 0, "f64", "a") is None


# --- a heap -----------------------------------------------------------------------------------------------------------


@pytest.mark.sampled(3)
def test_positions_in_a_heap_mean_nothing():
    import_taichi()
    assert 0.0 < meaning_ends(pose(load_scene(heap())), Budget(60.0)) < 3.0


@pytest.mark.sampled(3)
def test_a_heap_has_a_reference_whose_bar_holds_the_mean_of_many_runs(heap_study, many_runs):
    found = heap_study.value_reference
    assert found.trusted and found.runs == RUNS and found.shift == HEAP_SHIFT
    assert abs(found.values[0] - many_runs.mean) <= found.bars[0] + 2.0 * many_runs.error
    assert found.bar < 0.1


@pytest.mark.sampled(3)
def test_the_errors_of_a_heap_are_true_where_they_are_numbers_and_bounds_else(heap_study, many_runs):
    rows = [row for row in heap_study.rows() if row.sample.status == "ok" and row.sample.values]
    numbers = 0
    for row in rows:
        assert len(row.sample.values) == RUNS
        true = abs(float(np.mean(row.sample.values)) - many_runs.mean)
        scale, error = heap_study.value_reference.scales[0], 2.0 * many_runs.error
        if row.wanted.value is None:
            assert true - error <= row.wanted.at_most * scale
        else:
            numbers += 1
            assert 0.5 * (true - error) < row.wanted.value * scale < 2.0 * (true + error)
    assert 0 < numbers < len(rows)


@pytest.mark.sampled(3)
def test_a_mean_that_is_smaller_than_its_bar_is_no_reference(tmp_path):
    """The velocity of one disk along the floor has the mean 0."""
    velocity = {"end_velocity": {"of": 0, "axis": "x", "below": 9}}
    study = study_of(heap(expect=velocity), tmp_path, "end_velocity", seconds=8.0)
    assert study.quantity is None
    assert "end_velocity is not known: its mean is no larger than the bar of the mean" in study.reason


class LimitBench:
    """A method whose means reach the target from 100 steps on, with a bound that the scatter makes."""

    def __init__(self):
        self.tried = []

    def machine(self, _):
        return self

    def configuration(self, steps, _):
        return Configuration("pairwise", steps, "f64", "cpu")

    def run(self, configuration, _):
        self.tried.append(configuration.steps)
        return Sample(configuration, 1.0 / configuration.steps), None

    def time(self, configuration, _):
        return 1e-5 * configuration.steps

    def error(self, sample, _):
        return MeasuredError(None, 0.06) if sample.configuration.steps >= 100 else MeasuredError(0.2)


@pytest.mark.parametrize("steps", [110, 200, 316])
def test_a_bound_by_scatter_is_tried_with_coarser_steps(steps):
    """The finest rung that a ladder offers is up to √10 times finer than the coarsest step that reaches the target."""
    bench = LimitBench()
    known = ValueReference("pressure", ["pressure"], [1.0], [0.02], [0.05], [1.0], 6, 64, True, "resting", 1000)
    method = StudyMethod("pairwise", 1, True, False, 1.0, 1, "pairwise")
    problem = SimpleNamespace(span=1.0, samples=64)
    study = SimpleNamespace(quantity="pressure", value_reference=known, values=object(), methods={"pairwise": method})
    study.error, study.budget, study.problem = bench.error, Budget(10.0), problem
    found = try_offer(study, bench, Offer("pairwise", "f64", "cpu", float(steps), 1e-3), 0.1)
    assert 100 <= found.configuration.steps <= 150
    assert found.dt == 1.0 / found.configuration.steps


def test_a_target_below_the_bar_of_a_heap_allows_no_run():
    known = ValueReference("pressure", ["pressure"], [1.0], [0.02], [0.05], [1.0], 6, 64, True, "resting", 1000)
    study = SimpleNamespace(quantity="pressure", value_reference=known, allowed=lambda target, _: target)
    assert Trials(0.01).allowed(study) < 0.0 and Trials(0.1).allowed(study) == 0.1
    study.value_reference = replace(known, runs=1)
    assert Trials(0.1).allowed(study) == pytest.approx(0.08)
