"""The spring step in OpenCL is the same step: it agrees with the program's own to round-off."""

import sys
from pathlib import Path

import numpy as np
import pytest

from mpp_taichi import Simulation
from mpp_taichi.state import half_springs
from scenes import irregular_network

sys.path.append(str(Path(__file__).parents[1] / "opencl"))
ROUND_OFF = {"f32": 2.0**-24, "f64": 2.0**-53}


@pytest.fixture(scope="module")
def device():
    from spring_step import devices

    found, reason = devices()
    if not found:
        pytest.skip(f"OpenCL does not start here: {reason}")
    return found[0]


@pytest.mark.parametrize(("precision", "damped"), [("f32", True), ("f64", True), ("f64", False)])
def test_opencl_agrees_with_the_program_to_round_off(device, precision, damped):
    from spring_step import SpringStep

    if precision == "f64" and "cl_khr_fp64" not in device.extensions:
        pytest.skip(f"{device.name} has no f64")
    steps, dt = 16, 0.01
    scene = irregular_network(100, 300, dt=dt, damping=0.3 if damped else 0.0)
    with Simulation(scene, backend="cpu", precision=precision, plan="serial") as simulation:
        start = simulation.start
        expected = simulation.run(steps=steps).snapshot()
    rows = half_springs(start)
    kind = {"precision": precision, "damped": damped, "work_group": 16}
    step = SpringStep(device, rows, start.position, start.velocity, start.mass, **kind)
    step.advance(dt, 5)
    step.advance(dt, steps - 5)
    position, velocity = step.read()
    # In each step both round, in some ten operations and as many half-springs of a row, numbers of the size of the speeds and
    # places (≤ 3); a perturbation then grows at most as exp(ω t), with ω² ≤ 2 Σ D/m and t = steps·dt.
    pull = np.add.reduceat(rows["spring_stiffness"], np.minimum(rows["spring_start"][:-1], len(rows["spring_stiffness"]) - 1))
    growth = np.exp(np.sqrt(2 * (pull / start.mass).max()) * steps * dt)
    longest = np.diff(rows["spring_start"]).max()
    limit = steps * (10 + longest) * 3 * ROUND_OFF[precision] * growth
    assert np.abs(position - expected.position).max() < limit
    assert np.abs(velocity - expected.velocity).max() < limit
    assert np.abs(expected.position - start.position).max() > 100 * limit
