"""Published numbers and statistics of `verify`: there are many, each has its source, and the quick ones are solved here."""

import importlib
import re

import pytest
from scipy import stats

from mpp_taichi.verify.bounds import chance_beyond, half_digit, student
from mpp_taichi.verify.case import GROUPS, Case
from mpp_taichi.verify.case_result import SOLVED, examine
from mpp_taichi.verify.place import Place

PUBLISHED = [group for group in GROUPS if group.startswith("published")]


def cases_of(*groups):
    modules = (importlib.import_module(f"mpp_taichi.verify.cases.{group}") for group in groups)
    return [each for module in modules for each in vars(module).values() if isinstance(each, Case)]


def test_there_are_forty_published_numbers_each_with_its_source():
    cases = cases_of(*PUBLISHED)
    assert len(cases) >= 40
    assert len({case.name for case in cases}) == len(cases)
    for case in cases:
        assert re.search(r"1[6-9]\d\d|20\d\d|arXiv|COS 126", case.source), f"{case.name}: a source has its year or its paper"


def test_each_case_is_in_the_group_of_its_module():
    for group in PUBLISHED:
        assert {case.group for case in cases_of(group)} == {group}


@pytest.mark.sampled(4)
@pytest.mark.parametrize(
    "case", [case for case in cases_of(*PUBLISHED, "statistics") if case.quick], ids=lambda case: case.name
)
def test_a_quick_case_is_solved_on_the_cpu(case):
    result = examine(case, Place("cpu", "f64"))
    assert result.status == SOLVED, f"{result.reached} > {result.bound}: {result.because} {result.reason}"


@pytest.mark.parametrize(("chance", "freedom"), [(0.05, 4), (1e-3 / 60, 19), (1e-3 / 60, 99)])
def test_the_bound_of_a_mean_of_blocks_is_students(chance, freedom):
    bound = student(chance, freedom)
    assert bound == pytest.approx(stats.t.ppf(1.0 - 0.5 * chance, freedom), rel=1e-6)  # the bisection ends at 1e-9
    assert chance_beyond(-bound, freedom) == pytest.approx(chance, rel=1e-6)


def test_half_a_digit_is_that_of_the_print():
    assert half_digit("7.933359") == pytest.approx(5e-7) and half_digit("-1.1708e+10") == pytest.approx(5e5)
    assert half_digit("4e-4") == pytest.approx(5e-5) and half_digit("4333") == 0.5


def test_finite_gases_have_the_first_order_of_the_ensemble():
    """Z = 1 + 2η to first order in the density: N fixed spheres have N (N − 1) pairs in place of N², exactly."""
    from mpp_taichi.verify.cases._gas import of_finite

    packing, count = 1e-3, 50
    # The next virial coefficient changes the correction by some 10 η of itself.
    expected = 1.0 + 2.0 * packing * (1.0 - 1.0 / count)
    assert of_finite(lambda eta: 1.0 + 2.0 * eta, packing, count) == pytest.approx(expected, abs=20 * packing**2 / count)
