"""The tangent of a step with formulas: every function of a formula has its derivative, in dual numbers and in lanes of them."""

import numpy as np
import pytest
from shifted_starts import ends_from

from mpp_taichi import Simulation

STEPS = 20
SHIFT = 2.0**-20  # of the start, along the deviation
ROUND_OFF = 2.0**-53
BODIES = [
    {"body": {"position": [1, 0, 0.1], "velocity": [0, 0.6, 0], "mass": 1, "charge": 1}},
    {"body": {"position": [-0.8, 0.1, 0], "velocity": [0, -0.5, 0.2], "mass": 2, "charge": -1}},
    {"body": {"position": [0.2, 1.3, -0.4], "velocity": [0.3, 0, 0], "mass": 0.5, "charge": 2}},
]
PAIRS = ["exp(-r)*log(r)", "sin(r)*cos(2*r)", "tan(r/4)", "asin(r/5)*acos(r/6)", "atan(r)*tanh(r)", "r^1.3 + sqrt(1 + r)"]
PAIRS += ["abs(r - 1.9)^3", "q1*q2/r^2"]
FIELD = {"external": {"acceleration": ["-x + sin(y)*v", "-y^3 + 0.1*vx*exp(z)", "-z*cos(t)"]}}


def scene_of(forces, **more):
    return {
        "particles": BODIES,
        "forces": forces,
        "integrator": {"rk4": {"dt": 0.01}},
        "expect": {"megno": {"above": -1e9}},
        **more,
    }


@pytest.mark.parametrize("forces", [*([{"pair": {"potential": text}}] for text in PAIRS), [FIELD]], ids=[*PAIRS, "field"])
@pytest.mark.sampled(3)
def test_deviations_are_the_derivative_of_the_run(forces):
    scene = scene_of(forces)
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        start = np.concatenate(simulation.state.read())
        deviation = np.concatenate(simulation.phase.tangent.read_deviation())
        simulation.run(steps=STEPS, judge="off")
        found = np.concatenate(simulation.phase.tangent.read_deviation())
    # Differences over h and 2 h, extrapolated: the error is of fourth order in h, beside rounding over h.
    plain = {key: value for key, value in scene.items() if key != "expect"}
    sides = ends_from(plain, [start + k * SHIFT * deviation for k in (-2, -1, 1, 2)], STEPS)
    near, far = (sides[2] - sides[1]) / (2 * SHIFT), (sides[3] - sides[0]) / (4 * SHIFT)
    size = np.abs(np.concatenate(sides)).max()
    rounding = 20 * STEPS * ROUND_OFF * size * max(1.0, np.abs(found).max()) / SHIFT
    assert rounding < 1e-6
    assert np.abs(found - (4 * near - far) / 3).max() < rounding + np.abs(near - far).max() ** 2
    still = np.abs(start + deviation - np.concatenate(sides[:1])).max()
    assert still > 1e-3  # the forces have moved the bodies
