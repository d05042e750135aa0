"""The bars of means over runs in `accuracy` against the scatter of the means over repeated seeds."""

import math

import numpy as np
import pytest
from repeated_seeds import FALSE_ALARM, claims_hold
from scipy import stats

from mpp_taichi.accuracy.heap_levels import POOLED, RUNS, STUDENT_PAIR, STUDENT_POOLED, HeapLevels
from mpp_taichi.accuracy.sample import CLEAR
from mpp_taichi.accuracy.value_reference import STUDENT, ValueReference

SEEDS, VALUE = 4000, 10.0


class Runs:
    """A finished sample of some runs with one value each."""

    status = "ok"

    def __init__(self, values):
        self.values = [[float(value)] for value in values]


def reference(value=VALUE, bar=0.0, scatter=0.0):
    """A reference of one entry whose scale is 1."""
    more = {"runs": RUNS, "samples": 1, "trusted": True, "integrator": "leapfrog", "steps": 1}
    return ValueReference("x", ["x"], [value], [bar], [scatter], [1.0], **more)


def expected_range(chance):
    """The ends between which the number of so improbable seeds lies, but with the chance of a false alarm."""
    return stats.binom.ppf([0.5 * FALSE_ALARM, 1.0 - 0.5 * FALSE_ALARM], SEEDS, chance)


def test_the_bars_are_those_of_student():
    """A mean exceeds its bar in one of twenty cases; the factors have three digits."""
    for factor, freedoms in ((STUDENT, RUNS - 1), (STUDENT_POOLED, POOLED * (RUNS - 1)), (STUDENT_PAIR, 2 * (RUNS - 1))):
        assert abs(stats.t.ppf(0.975, freedoms) - factor) < 0.01


def test_the_bar_of_a_mean_of_six_runs_is_its_scatter_over_seeds():
    """From a reference with the same value, the bound of the error is the bar alone: Student's factor times s/√6."""
    random = np.random.default_rng(27)
    samples = [Runs(random.normal(VALUE, 1.0, RUNS)) for _ in range(SEEDS)]
    means = [float(np.mean(each.values)) for each in samples]
    errors = [reference(mean).error(each).at_most / STUDENT for each, mean in zip(samples, means)]
    assert claims_hold(means, errors, RUNS - 1)


def test_an_error_by_chance_alone_is_stated_as_seldom_as_student_says():
    """An error is stated as a number where the mean is off by more than `CLEAR` bars."""
    random, known = np.random.default_rng(27), reference()
    stated = sum(known.error(Runs(random.normal(VALUE, 1.0, RUNS))).value is not None for _ in range(SEEDS))
    low, high = expected_range(2.0 * stats.t.sf(CLEAR * STUDENT, RUNS - 1))
    assert 0 < low <= stated <= high


def test_the_error_of_a_mean_is_bounded_by_the_bars_of_both():
    """Both bars count like the legs of a right triangle: a reference with a bar of 3 and runs with a bar of 4 give 5."""
    runs = Runs(np.tile([VALUE - 1.0, VALUE + 1.0], RUNS // 2) + 1e-9 * np.arange(RUNS))
    own = 4.0 / STUDENT * math.sqrt(RUNS)  # scatter that gives the reference a bar of 4, more than the runs scatter
    assert reference(bar=3.0, scatter=own).error(runs).at_most == pytest.approx(5.0, rel=1e-8)


def test_the_scatter_of_pooled_levels_is_the_error_of_their_mean():
    """Three levels of six runs about one mean have 15 degrees of freedom; the standard error of their mean is s/√18."""
    random = np.random.default_rng(28)
    means, errors = [], []
    for _ in range(SEEDS // 10):
        levels = HeapLevels()
        for _ in range(POOLED):
            levels.add(random.normal(VALUE, 1.0, (RUNS, 1)))
        apart = np.ptp(levels.means)
        means.append(levels.mean[0])
        errors.append((levels.bars[0] - apart) / STUDENT_POOLED)
    assert claims_hold(means, errors, POOLED * (RUNS - 1))


def test_levels_of_one_mean_seldom_differ_by_more_than_their_scatter_allows():
    """Two differences of neighbours, each beyond Student's bar in one of twenty cases: one of ten at most, and not none."""
    random = np.random.default_rng(29)
    differ = 0
    for _ in range(SEEDS):
        levels = HeapLevels()
        for _ in range(POOLED + 1):
            levels.add(random.normal(VALUE, 1.0, (RUNS, 1)))
        differ += not levels.agree
    assert expected_range(0.02)[0] <= differ <= expected_range(0.1)[1]
