"""Hard cases, forces and reproducible numbers of `verify`: the CPU solves each of them in f64."""

import pytest

from mpp_taichi.missing_package import is_absent
from mpp_taichi.verify.case_result import SOLVED, examine
from mpp_taichi.verify.cases import other_codes, stability_limits
from mpp_taichi.verify.catalogue import cases
from mpp_taichi.verify.place import Place

GROUPS = ("forces", "formulas", "gravity", "springs", "networks", "spheres", "heaps", "numerics", "refusals")


@pytest.mark.sampled(6)
@pytest.mark.parametrize(
    "case", [each for each in cases() if each.group in GROUPS], ids=lambda case: f"{case.group}: {case.name}"
)
def test_the_cpu_solves_the_case_in_double_precision(case):
    result = examine(case, Place("cpu", "f64"))
    assert result.status == SOLVED, f"{result.reason}: {result.reached} beyond {result.bound}, {result.because}"


@pytest.mark.sampled(3)
@pytest.mark.parametrize("case", stability_limits.LIMITS, ids=lambda case: case.name)
def test_a_method_becomes_unstable_where_the_program_says(case):
    result = examine(case, Place("cpu", "f64"))
    assert result.status == SOLVED, f"{result.reason}: {result.reached} beyond {result.bound}, {result.because}"


def test_a_limit_that_is_told_wrong_is_noticed(monkeypatch):
    """By two thousandths, of both the step that is advised and the eigenvalues from which it follows."""
    from mpp_taichi.integrators.leapfrog import Leapfrog

    plain = Leapfrog.amplification
    monkeypatch.setattr(Leapfrog, "amplification", lambda self, frequency, damping=0.0: plain(self, 0.998 * frequency, damping))
    (case,) = (case for case in stability_limits.LIMITS if case.name == "limit_of_leapfrog")
    result = examine(case, Place("cpu", "f64"))
    assert result.status == "failed" and result.reached == pytest.approx(0.002, rel=0.1)


BESIDE = [each for each in cases() if each.group == "other_codes"]


@pytest.mark.parametrize("case", BESIDE, ids=lambda case: case.name)
@pytest.mark.sampled(3)
def test_a_scene_is_as_in_another_code_or_the_row_says_what_is_missing(case):
    result = examine(case, Place("cpu", "f64"))
    if is_absent("heyoka") and case.name == "taylor_is_heyokas":
        assert result.status == "refused" and "pip install heyoka" in result.reason
    else:
        assert result.status == SOLVED, f"{result.reason}: {result.reached} beyond {result.bound}, {result.because}"


@pytest.mark.parametrize("name", ["leapfrog_is_rebounds", "wisdom_holman_is_whfast"])
def test_a_strength_that_is_off_by_a_part_in_a_trillion_is_noticed(name, monkeypatch):
    """The phase is then off by 0.6e-12 and more for each of 126 and 628 radians."""
    plain = other_codes._in_rebound

    def stronger(simulation, integrator):
        other = plain(simulation, integrator)
        other.G *= 1.0 + 2e-12
        return other

    monkeypatch.setattr(other_codes, "_in_rebound", stronger)
    (case,) = (case for case in BESIDE if case.name == name)
    assert examine(case, Place("cpu", "f64")).status == "failed"
