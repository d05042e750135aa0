"""Published numbers and statistics of `verify`: there are many, each has its source, and the quick ones are solved here."""

import importlib
import re

import pytest

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
@pytest.mark.parametrize("case", [case for case in cases_of(*PUBLISHED) if case.quick], ids=lambda case: case.name)
def test_a_quick_case_is_solved_on_the_cpu(case):
    result = examine(case, Place("cpu", "f64"))
    assert result.status == SOLVED, f"{result.reached} > {result.bound}: {result.because} {result.reason}"
