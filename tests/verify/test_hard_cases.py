"""Hard cases, forces and reproducible numbers of `verify`: the CPU solves each of them in f64."""

import pytest

from mpp_taichi.verify.case_result import SOLVED, examine
from mpp_taichi.verify.catalogue import cases
from mpp_taichi.verify.place import Place

GROUPS = ("forces", "gravity", "springs", "networks", "spheres", "heaps", "numerics")


@pytest.mark.sampled(6)
@pytest.mark.parametrize(
    "case", [each for each in cases() if each.group in GROUPS], ids=lambda case: f"{case.group}: {case.name}"
)
def test_the_cpu_solves_the_case_in_double_precision(case):
    result = examine(case, Place("cpu", "f64"))
    assert result.status == SOLVED, f"{result.reason}: {result.reached} beyond {result.bound}, {result.because}"
