"""Verdicts on a run by `mpp_taichi.run`: numbers of the energy balance, and numbers that only the end of a run has."""

import math

import pytest

import mpp_taichi as mpp

DECAY, SPEED, END = 0.5, 3.0, 2.0
LOST = 0.5 * SPEED**2 * (1.0 - math.exp(-2.0 * DECAY * END))  # of a mass of 1 that drag slows, v = v₀ exp(−γ t)
WAY = SPEED / DECAY * (1.0 - math.exp(-DECAY * END))


def scene(*, lost=LOST, way=WAY):
    """A body that drag alone slows. The steps of RK4 err by (γ dt)⁴, 10⁻⁹; the bounds are 10⁻⁶ wide."""
    return {
        "particles": [{"body": {"mass": 1, "position": [0, 0, 0], "velocity": [SPEED, 0, 0]}}],
        "forces": [{"linear_drag": {"coefficient": DECAY}}],
        "integrator": {"rk4": {"dt": 0.01}},
        "run": {"duration": END},
        "expect": {
            "dissipated_energy": {"near": lost, "within": 1e-6},
            "work": {"below": 1e-9},
            "end_position": {"of": 0, "axis": "x", "near": way, "within": 1e-6},
            "end_velocity": {"of": 0, "axis": "x", "near": SPEED * math.exp(-DECAY * END), "within": 1e-6},
        },
    }


def test_expectations_of_the_balance_and_of_the_end_are_judged_by_their_numbers():
    with mpp.run(scene(), backend="cpu", precision="f64") as result:
        found = {verdict.quantity: verdict for verdict in result.verdicts}
        assert result.summary["status"] == "ok"
        assert found["dissipated_energy"].value == pytest.approx(LOST, rel=1e-6)
        assert found["end_position"].value == pytest.approx(WAY, rel=1e-6)
        assert found["end_velocity"].value == pytest.approx(SPEED * math.exp(-DECAY * END), rel=1e-6)
        assert all(verdict.passed for verdict in found.values())


def test_one_number_off_by_a_hundredth_fails_the_run_and_names_itself():
    with mpp.run(scene(way=1.01 * WAY), backend="cpu", precision="f64") as result:
        assert result.summary["status"] == "failed"
        assert [verdict.quantity for verdict in result.verdicts if not verdict.passed] == ["end_position"]
    with mpp.run(scene(), duration=1.0, backend="cpu", precision="f64") as part:
        assert not part.verdicts and part.summary["status"] == "ok"  # the expectations are those of the whole run
