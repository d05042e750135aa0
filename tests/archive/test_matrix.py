"""Runs of every method, plan, precision, contact solver and recorder, cut off at a random step, go on with the same bits.

Each day draws other cells of the matrix of `support/cut_runs.py`; `--seed N` draws those of another day again.
"""

from itertools import islice

import pytest
from cut_runs import STEPS, Case, drawn, matrix, same_after_a_cut

from mpp_taichi import component
from mpp_taichi.errors import BackendError, OutputError, SceneError

CELLS, THOROUGH = 4, 200


def pytest_generate_tests(metafunc):
    """So many cells of the matrix, drawn by the seed."""
    if "cell" in metafunc.fixturenames:
        count = THOROUGH if metafunc.config.getoption("--thorough") else CELLS
        cells = list(islice(drawn(metafunc.config.getoption("--seed")), count))
        metafunc.parametrize(("cell", "cut"), cells, ids=[f"{cell}-cut at {cut}" for cell, cut in cells])


@pytest.mark.sampled(3)
def test_a_run_that_is_cut_off_goes_on_with_the_same_bits_and_samples(cell, cut):
    try:
        assert cell.goes_on(cut)
    except (BackendError, OutputError, SceneError) as refused:  # such as an adaptive method under the parallel plan
        pytest.skip(str(refused).splitlines()[0])


def test_the_matrix_has_every_method_solver_plan_precision_and_recorder():
    cells = matrix()
    assert {each.integrator for each in cells} == set(component.names("integrators"))
    assert {each.solver for each in cells} == {"", *component.names("contacts")}
    assert {each.plan for each in cells} == {"serial", "parallel"}
    for precision in ("f32", "f32c", "ds", "df64", "f64"):
        assert any(each.precision == precision for each in cells)
    first = [cell for cell, _ in islice(drawn(1), 400)]
    assert {each.recorder for each in first} == {each.recorder for each in cells}, "every recorder is drawn"
    assert first == [cell for cell, _ in islice(drawn(1), 400)] != [cell for cell, _ in islice(drawn(2), 400)]


@pytest.mark.sampled(3)
def test_a_run_that_goes_on_without_its_memory_is_noticed(monkeypatch):
    """The matrix would be worth nothing if no difference were seen."""
    case = Case("leapfrog", "serial", "f64", recorder="table")
    assert same_after_a_cut(case.scene, STEPS // 2, "table", precision="f64", plan="serial")
    monkeypatch.setattr("cut_runs.object_state.restore", lambda *_: None)
    assert not same_after_a_cut(case.scene, STEPS // 2, "table", precision="f64", plan="serial")
