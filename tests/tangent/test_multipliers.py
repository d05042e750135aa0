"""The multipliers of periodic orbits: the whole derivative of the motion, from a copy of the system for each direction."""

import cmath
import math

import numpy as np
import pytest

from mpp_taichi import Simulation
from mpp_taichi.errors import CapacityError, UnsupportedError
from mpp_taichi.quantities.stability import Stability
from mpp_taichi.sweep.replicas import Bench, MemberDevice
from mpp_taichi.sweep.runner import run_members
from scenes import kepler

ROUND_OFF = 2.0**-53
MEASURED = {"stability": {"above": 0}, "lyapunov": {"above": -1e9}}


def triangle(masses, steps, method="yoshida8"):
    """Lagrange's triangle of side 1, which turns with ω² = M, for one turn."""
    total = sum(masses)
    corners = np.array([[0.0, 0.0], [1.0, 0.0], [0.5, math.sqrt(0.75)]])
    corners -= np.array(masses) @ corners / total
    speeds = math.sqrt(total) * np.stack([-corners[:, 1], corners[:, 0]], axis=1)
    places = zip(masses, corners.tolist(), speeds.tolist(), strict=True)
    time = 2 * math.pi / math.sqrt(total)
    return {
        "dimensions": 2,
        "particles": [{"body": {"mass": m, "position": x, "velocity": v}} for m, x, v in places],
        "forces": [{"newtonian_gravity": {"strength": 1}}],
        "integrator": {method: {"dt": time / steps}},
        "run": {"steps": steps},
    }


def known_multiplier(masses):
    """exp(2π Re λ/ω) with λ² = ω² (−1 ± √(1 − 27 σ))/2 and σ = Σ m_i m_j/M².

    Source: Routh, Proc. London Math. Soc. 6 (1875) 86.
    """
    a, b, c = masses
    sigma = (a * b + b * c + c * a) / sum(masses) ** 2
    roots = [cmath.sqrt((-1 + sign * cmath.sqrt(1 - 27 * sigma)) / 2) for sign in (1, -1)]
    return math.exp(2 * math.pi * max(abs(root.real) for root in roots))


def measured(scene):
    with Simulation({**scene, "expect": MEASURED}, backend="cpu", precision="f64") as simulation:
        simulation.run(judge="off")
        growth = simulation.phase.tangent.read()
        return float(Stability().of(growth)[0]), growth, np.concatenate(simulation.state.read())


@pytest.mark.sampled(3)
def test_the_multipliers_of_lagranges_triangle_are_rouths():
    known = known_multiplier((1, 1, 1))
    assert known == pytest.approx(math.exp(math.sqrt(2) * math.pi))
    errors = [abs(measured(triangle((1, 1, 1), steps, "yoshida4"))[0] / known - 1) for steps in (100, 200)]
    assert 2**3.5 < errors[0] / errors[1] < 2**4.5  # of fourth order, like the motion
    assert measured(triangle((1, 1, 1), 400))[0] == pytest.approx(known, rel=1e-8)  # 2⁻¹⁶ of the error of yoshida4 at 100


def test_the_multipliers_of_ias15_are_rouths_to_round_off():
    """Some 30 steps of a turn, each of which rounds the deviations some hundred times."""
    found, growth, _ = measured(triangle((1, 1, 1), 1, "ias15"))
    assert found == pytest.approx(known_multiplier((1, 1, 1)), rel=30 * 100 * ROUND_OFF)
    assert np.linalg.det(growth.derivative[0]) == pytest.approx(1.0, abs=30 * 100 * ROUND_OFF * found)


@pytest.mark.sampled(3)
def test_the_derivative_has_all_deviations_and_keeps_volume():
    scene = kepler(integrator="leapfrog")
    _, growth, end = measured({**scene, "run": {"steps": 100}})
    with Simulation({**scene, "expect": {"lyapunov": {"above": -1e9}}}, backend="cpu", precision="f64") as simulation:
        meter = simulation.phase.tangent
        start = np.concatenate([each[meter.free] for each in meter.read_deviation()])
        simulation.run(steps=100, judge="off")
        found = np.concatenate([each[meter.free] for each in meter.read_deviation()])
        alone = meter.read()
        np.testing.assert_array_equal(np.concatenate(simulation.state.read()), end)
    assert (growth.growth[0], growth.megno[0]) == (alone.growth[0], alone.megno[0])
    derivative = growth.derivative[0]
    # Each step rounds every deviation some ten times.
    np.testing.assert_allclose(derivative @ start, found, atol=1000 * ROUND_OFF * np.abs(derivative).max())
    assert np.linalg.det(derivative) == pytest.approx(1.0, abs=1e-9)


@pytest.mark.sampled(3)
@pytest.mark.parametrize("method", ["leapfrog", "ias15"])
def test_held_axes_have_no_deviation(method):
    step, stiffness, steps = 0.3, 2.0, 37
    scene = {
        "dimensions": 2,
        "particles": [
            {"body": {"name": "wall", "mass": 1, "position": [0, 0], "free": False}},
            {"body": {"name": "ball", "mass": 1, "position": [1.2, 0], "free": [True, False, False]}},
        ],
        "springs": [{"link": {"between": ["wall", "ball"], "stiffness": stiffness, "rest_length": 1}}],
        "integrator": {method: {"dt": step}},
        "run": {"steps": steps},
    }
    _, growth, _ = measured(scene)
    assert growth.derivative.shape == (1, 2, 2)
    # The phase of a step of leapfrog, or of the motion in this time.
    turn = math.acos(1 - stiffness * step**2 / 2) if method == "leapfrog" else math.sqrt(stiffness) * step
    assert np.trace(growth.derivative[0]) == pytest.approx(2 * math.cos(steps * turn), abs=1e3 * steps * ROUND_OFF)


@pytest.mark.sampled(3)
def test_members_of_a_sweep_have_the_multipliers_of_single_runs():
    shares = [0.01, 0.03, 0.05, 0.1, 0.2]  # of the second mass; from 0.0385 on the triangle is not stable
    scene = {**triangle((1, 0, 0), 400), "constants": {"share": 0.1}}
    resolved = {**scene, "sweep": {"vary": {"constants.share": shares}, "measure": ["stability", "lyapunov"]}}
    for k, entry in enumerate(resolved["particles"]):
        entry["body"]["mass"] = ("1 - share - 1e-9", "share", 1e-9)[k]
    # The corners are measured from the centre of mass.
    for entry, (x, y) in zip(resolved["particles"], ((0, 0), (1, 0), (0.5, math.sqrt(0.75))), strict=True):
        center = ("(share + 0.5e-9)", f"{math.sqrt(0.75)} * 1e-9")
        entry["body"]["position"] = [f"{x} - {center[0]}", f"{y} - {center[1]}"]
        entry["body"]["velocity"] = [f"-({y} - {center[1]})", f"{x} - {center[0]}"]
    bench = Bench(MemberDevice("cpu", "f64", 2))
    values = [{"constants.share": share} for share in shares]
    rows = run_members(list(range(len(shares))), values, resolved, "triangle", bench)
    for row, share in zip(rows, shares, strict=True):
        known = known_multiplier((1 - share - 1e-9, share, 1e-9))
        assert row.status == "ok"
        assert row.values[0] == pytest.approx(known, rel=0.02 if share < 0.0385 else 1e-6)
    # The starts are rounded in two ways, and errors of the start grow like the derivative, to some 10⁴.
    alone = measured(triangle((1 - shares[-1], shares[-1], 1e-9), 400))
    assert rows[-1].values == pytest.approx([alone[0], alone[1].growth[0] / alone[1].time[0]], rel=1e-7)


@pytest.mark.sampled(3)
def test_members_with_steps_of_their_own_have_the_bits_of_single_runs():
    shares = [0.05, 0.1, 0.3]
    measure = ["stability", "lyapunov", "megno", "fli"]
    resolved = {**triangle((1, 0.1, 1), 1, "ias15"), "sweep": {"vary": {"particles[1].body.mass": shares}, "measure": measure}}
    bench = Bench(MemberDevice("cpu", "f64", 2))
    rows = run_members([0, 1, 2], [{"particles[1].body.mass": share} for share in shares], resolved, "triangle", bench)
    for row, share in zip(rows, shares, strict=True):
        scene = {**triangle((1, 0.1, 1), 1, "ias15"), "expect": {name: {"above": -1e9} for name in measure}}
        scene["particles"][1]["body"]["mass"] = share
        with Simulation(scene, backend="cpu", precision="f64") as simulation:
            simulation.run(judge="off")
            growth = simulation.phase.tangent.read()
        alone = [Stability().of(growth)[0], growth.growth[0] / growth.time[0], growth.megno[0], growth.largest[0]]
        assert (row.status, list(row.values)) == ("ok", alone)


@pytest.mark.parametrize(
    "change, refusal, message",
    [
        ({"integrator": {"taylor": {"dt": 0.1}}}, UnsupportedError, "the method taylor does not have"),
        (
            {"contacts": {"hard_spheres": {"solver": "event_driven"}}, "forces": [], "integrator": {"event_driven": {"dt": 1}}},
            UnsupportedError,
            "stability needs the derivative along all directions, which collisions do not have",
        ),
        (
            {"particles": [{"plummer": {"count": 101}}]},
            CapacityError,
            "here are 606, allowed: 600",
        ),
    ],
)
def test_what_has_no_multipliers_is_refused(change, refusal, message):
    with pytest.raises(refusal, match=message):
        Simulation({**kepler(), **change, "expect": {"stability": {"below": 2}}}, backend="cpu")
