"""Embedded pairs with control of the step: SciPy's beside them, samples between steps, motion without a scale, collisions."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from test_integrators import everything_reference, kepler_reference

from mpp_taichi import BackendError, Simulation, StabilityError
from scenes import everything, kepler

PAIRS = {"adaptive_dop853": "DOP853", "adaptive_bogacki_shampine": "RK23"}
SPAN = 31.4  # five turns of the planet


def planet(name, tolerance, *, eccentricity=0.3, dt=SPAN):
    """The scene of `kepler` with a tolerance."""
    return kepler(eccentricity) | {"integrator": {name: {"dt": dt, "tolerance": tolerance}}}


def error_at_the_end(run):
    """Largest of a coordinate."""
    return float(np.abs(run.snapshot().position - kepler_reference(run)).max())


def by_scipy(run, method, tolerance):
    """Its error and evaluations on the same two bodies."""
    m, start = run.start.mass, np.concatenate([run.start.position.ravel(), run.start.velocity.ravel()])

    def slopes(_, y):
        d = y[3:6] - y[:3]
        pull = d / (d @ d) ** 1.5
        return np.concatenate([y[6:], m[1] * pull, -m[0] * pull])

    found = solve_ivp(slopes, (0.0, SPAN), start, method=method, rtol=tolerance, atol=tolerance)
    return float(np.abs(found.y[:6, -1].reshape(2, 3) - kepler_reference(run)).max()), found.nfev


@pytest.mark.parametrize(("name", "order", "tolerances"), [
    ("adaptive_dop853", 8, (1e-6, 1e-8, 1e-10)), ("adaptive_bogacki_shampine", 3, (1e-4, 1e-5, 1e-6)),
])  # fmt: skip
@pytest.mark.sampled(3)
def test_the_error_follows_the_tolerance_at_the_cost_of_scipys(name, order, tolerances):
    errors, work, other_work = [], [], []
    with Simulation(planet(name, 1e-3), backend="cpu", precision="f64") as run:
        for tolerance in tolerances:
            run.integrator.tolerance = tolerance
            run.restart()
            run.run(steps=1)
            errors.append(error_at_the_end(run))
            # The error goes as the power −order of the evaluations, so that this is the same for all tolerances.
            work.append(run.integrator.counts(run.state)[0, run.integrator.EVALUATIONS] * errors[-1] ** (1 / order))
            error, evaluations = by_scipy(run, PAIRS[name], tolerance)
            other_work.append(evaluations * error ** (1 / order))
    # The estimate and the error both go as h^order. Where a step begins after five turns changes the error by a factor of two.
    slope = np.polyfit(np.log(tolerances), np.log(errors), 1)[0]
    assert slope == pytest.approx(1.0, abs=math.log(2) / math.log(tolerances[0] / tolerances[-1]) * 2), errors
    # 2^(1/8) to 2^(1/3) of the work for that factor, and a twentieth of all steps refused more or fewer.
    assert np.mean(work) == pytest.approx(np.mean(other_work), rel=0.2)


@pytest.mark.sampled(2)
@pytest.mark.parametrize(("name", "tolerance", "limit"), [
    ("adaptive_dop853", 1e-10, 1e-10), ("adaptive_bogacki_shampine", 1e-9, 1e-9),
])  # fmt: skip
def test_every_force_and_looks_between_steps(name, tolerance, limit):
    """Springs with friction, drag, charges, a held axis: a hundred steps, of which errors do not all add up."""
    scene = everything() | {"integrator": {name: {"dt": 0.07, "tolerance": tolerance}}}
    with Simulation(scene, backend="cpu", precision="f64") as run:
        for _ in range(5):
            run.run(steps=1)
            assert np.abs(run.snapshot().position - everything_reference(run)).max() < limit
        assert run.snapshot().position[0, 2] == 0.0
        ends = run.integrator.times(run.state)
        assert ends[0] > run.time, "a sample within a step"


@pytest.mark.sampled(3)
def test_looks_change_no_bit_and_a_mark_brings_all_back():
    ends = []
    with Simulation(planet("adaptive_dop853", 1e-8, eccentricity=0.7), backend="cpu", precision="f64") as run:
        for looks in (1, 40):
            run.restart()
            run.dt = SPAN / looks
            run.run(steps=looks // 2)
            mark = run.mark()
            run.run(steps=looks - looks // 2)
            before = run.snapshot()
            run.return_to(mark)
            run.run(steps=looks - looks // 2)
            assert np.array_equal(before.position, run.snapshot().position)
            own = (run.state.start_position, run.state.start_velocity, run.state.slope, run.state.clock)
            # Slopes of samples are there where a sample was taken.
            taken = 13 * run.state.particle_count
            ends.append([each.to_numpy()[:taken].tobytes() for each in own])
    assert ends[0] == ends[1]


@pytest.mark.sampled(3)
def test_replicas_have_steps_of_their_own():
    scene = planet("adaptive_bogacki_shampine", 1e-5)
    with Simulation(scene, backend="cpu", precision="f64") as run:
        start = run.snapshot()
        run.run(steps=1)
        alone = run.snapshot()
    slower = start.moved(position=start.position, velocity=0.7 * start.velocity, time=0.0, step=0)
    with Simulation(scene, backend="cpu", precision="f64", replica_starts=[slower, start]) as run:
        run.run(steps=1)
        assert np.array_equal(run.snapshot(1).position, alone.position)
        counts = run.integrator.counts(run.state)[:, run.integrator.STEPS]
        assert counts[0] > counts[1]


@pytest.mark.sampled(3)
def test_rest_and_free_flight_are_no_work_and_single_precision_has_a_floor():
    still = {"body": {"mass": 1.0, "position": [0, 0, 0]}}
    flying = {"body": {"mass": 1.0, "position": [1, 0, 0], "velocity": [1, 2, 3]}}
    for bodies in ([still], [still, flying]):
        scene = {"particles": bodies, "integrator": {"adaptive_dop853": {"dt": 8.0}}}
        with Simulation(scene, backend="cpu", precision="f64") as run:
            run.run(steps=2)
            expected = [[0, 0, 0], [17, 32, 48]][: len(bodies)]
            np.testing.assert_allclose(run.snapshot().position, expected, rtol=1e-14)
            assert run.integrator.counts(run.state)[0, run.integrator.STEPS] < 32
    with Simulation(planet("adaptive_dop853", 1e-13), backend="cpu", precision="f32") as run:
        run.run(steps=1)
        # 1e-6 is the finest tolerance of f32, of 100 steps that round by 6e-8 each and phases that gather them over five turns.
        assert run.integrator.counts(run.state)[0, run.integrator.STEPS] < 200
        assert error_at_the_end(run) < 100**1.5 * 6e-8 * 10


@pytest.mark.sampled(3)
def test_a_collision_ends_the_run_and_plans_are_refused_by_name():
    fall = [{"body": {"mass": 1.0, "position": [side, 0, 0]}} for side in (-1, 1)]
    scene = {
        "particles": fall,
        "forces": [{"newtonian_gravity": {"strength": 1.0}}],
        "integrator": {"adaptive_dop853": {"dt": 5.0}},
    }
    with Simulation(scene, backend="cpu", precision="f64") as run:
        with pytest.raises(
            StabilityError, match="particle 0 and particle 1 meet, .* apart: give the force a softening"
        ) as info:
            run.run(steps=1)
        # The time is resolved to the tolerance of each step; two bodies meet after π/√2.
        assert info.value.time == pytest.approx(math.pi / math.sqrt(2), abs=1e-6)
    with pytest.raises(BackendError, match="adaptive_bogacki_shampine has no parallel plan; there are serial and replicas"):
        Simulation(planet("adaptive_bogacki_shampine", 1e-5), backend="cpu", plan="parallel")
