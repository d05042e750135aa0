"""Scenes with rigid rods have a price list like others: errors are those of Lagrange's equations, and targets are reached."""

import numpy as np
import pytest
from test_rods import LENGTHS, double_pendulum, lagrange

from mpp_taichi import Simulation
from mpp_taichi.accuracy.budget import Budget
from mpp_taichi.accuracy.choice import choose
from mpp_taichi.accuracy.problem import pose
from mpp_taichi.accuracy.store import Store, identity
from mpp_taichi.accuracy.study import Study, StudyWishes
from mpp_taichi.scene.load import load_scene

METHODS = ("leapfrog", "pefrl", "kahan_li8")


def scene(**more):
    return load_scene({**double_pendulum({"leapfrog": {"dt": 0.01}}), "run": {"duration": 1.0}, **more})


@pytest.mark.sampled(3)
def test_errors_are_those_of_lagranges_equations(tmp_path):
    spec = scene()
    problem = pose(spec)
    store = Store(tmp_path, identity(problem, problem.span, "test"))
    study = Study(problem, store, Budget(40.0), StudyWishes(METHODS, (("cpu", "f64"),)))
    study.run()
    assert study.reference.trusted and study.reference.integrator == "kahan_li8"
    exact = lagrange(1.0)  # good to 1e-12
    rows = [row for row in study.rows() if row.position.value is not None and row.position.value > 1e-9]
    assert {row.sample.configuration.integrator for row in rows} == set(METHODS)
    for row in rows:
        true = np.linalg.norm(row.sample.end[2] - exact) / study.reference.size
        # The table has the error of the particle that is worst, which may be the upper mass.
        assert true <= 1.01 * row.position.value and row.position.value <= max(LENGTHS) * 10.0 * true


@pytest.mark.sampled(3)
def test_a_target_is_reached_along_rods(tmp_path):
    target = 1e-6
    spec = scene(accuracy=target)
    found = choose(spec, tmp_path, precisions=("f64",), seconds=40.0, integrators=METHODS)
    with Simulation(found.settle(spec), backend="cpu", precision="f64") as simulation:
        end = simulation.run(until=1.0).snapshot().position[2]
    assert np.linalg.norm(end - lagrange(1.0)) <= target * max(1.0, sum(LENGTHS))
    assert 0.05 * target <= found.error <= target
