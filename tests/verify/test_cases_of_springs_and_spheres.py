"""Hard cases of springs and spheres: the CPU solves each of them in f64."""

import pytest

from mpp_taichi.verify.case import Case
from mpp_taichi.verify.case_result import SOLVED, examine
from mpp_taichi.verify.cases import heaps, networks, spheres, springs
from mpp_taichi.verify.place import Place

CASES = [each for module in (springs, networks, spheres, heaps) for each in vars(module).values() if isinstance(each, Case)]


@pytest.mark.sampled(4)
@pytest.mark.parametrize("case", CASES, ids=lambda case: f"{case.group}: {case.name}")
def test_the_cpu_solves_the_case_in_double_precision(case):
    result = examine(case, Place("cpu", "f64"))
    assert result.status == SOLVED, f"{result.reason}: {result.reached} beyond {result.bound}, {result.because}"
