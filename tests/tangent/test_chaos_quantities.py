"""The quantities lyapunov, megno and fli beside independent solutions of the variational equations."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from mpp_taichi import Simulation, resume
from mpp_taichi.simulation.run_archive import RunArchive, header_of
from scenes import kepler

MEASURED = {"megno": {"above": -1e9}}
STIFFNESS, LENGTH, GRAVITY = 40.0, 1.0, 10.0
START = (0.6, 0.6)  # of the bob, at rest


def spring_pendulum(dt, integrator="kahan_li8"):
    """A mass on a spring in a plane, high enough to be chaotic."""
    return {
        "dimensions": 2,
        "particles": [
            {"body": {"name": "hook", "mass": 1.0, "position": [0, 0, 0], "free": [False, False, False]}},
            {"body": {"name": "bob", "mass": 1.0, "position": [*START, 0.0]}},
        ],
        "springs": [{"link": {"between": ["hook", "bob"], "stiffness": STIFFNESS, "rest_length": LENGTH}}],
        "forces": [{"uniform_gravity": {"acceleration": [0, -GRAVITY, 0]}}],
        "integrator": {integrator: {"dt": dt}},
        "expect": MEASURED,
    }


def growth_of_pendulum(deviation, times):
    """L(t) of the bob's deviation (δx, δy, δu, δv) by SciPy, with the Jacobian written down."""

    def rate(_, y):
        place, moved = y[:2], y[4:6]
        length = np.hypot(*place)
        pull = -STIFFNESS * (1 - LENGTH / length) * place + [0, -GRAVITY]
        change = -STIFFNESS * ((1 - LENGTH / length) * moved + LENGTH * place * (place @ moved) / length**3)
        return np.concatenate([y[2:4], pull, y[6:8], change])

    start = np.concatenate([START, [0.0, 0.0], deviation])
    found = solve_ivp(rate, (0, times[-1]), start, "DOP853", t_eval=times, rtol=1e-13, atol=1e-14).y[4:]
    return 0.5 * np.log((found**2).sum(axis=0))


def mean_megno(times, growth):
    """(1/t) ∫ Y dt with Y = 2 (L − (1/t) ∫ L dt), by the trapezoidal rule over even times from 0 on."""
    integral = np.concatenate([[0.0], np.cumsum(0.5 * times[1] * (growth[1:] + growth[:-1]))])
    y = np.concatenate([[0.0], 2.0 * (growth[1:] - integral[1:] / times[1:])])
    return np.trapezoid(y, times) / times[-1]


def test_a_chaotic_pendulum_is_as_scipy_has_it():
    dt, steps = 1 / 128, 12 * 128
    with Simulation(spring_pendulum(dt), backend="cpu", precision="f64") as simulation:
        start = [each[1, :2] for each in simulation.phase.tangent.read_deviation()]
        simulation.run(steps=steps, judge="off")
        found = simulation.phase.read_tangent()
    times = dt * np.arange(steps + 1)
    growth = growth_of_pendulum(np.concatenate(start), times)
    # The method's own error is (ω dt)^8 = 5e-11 a period, and grows with the deviations, e^6; SciPy's is less.
    assert found.growth[0] == pytest.approx(growth[-1], abs=1e-7)
    assert found.largest[0] == pytest.approx(growth.max(), abs=1e-7)
    assert found.megno[0] == pytest.approx(mean_megno(times, growth), abs=1e-7)
    assert growth[-1] > 4.0  # nearby motions have parted by a factor of a hundred: the run is chaotic


@pytest.mark.parametrize("dt", [0.05, 0.7, 12.0])
@pytest.mark.sampled(3)
def test_the_growth_in_the_steps_of_ias15_is_as_scipy_has_it_at_any_sample(dt):
    """The samples are inside steps, a step is a tenth of a swing, and no sum depends on how many samples there were."""
    steps = round(12 / dt)
    with Simulation(spring_pendulum(dt, "ias15"), backend="cpu", precision="f64") as simulation:
        start = [each[1, :2] for each in simulation.phase.tangent.read_deviation()]
        simulation.run(steps=steps, judge="off")
        found = simulation.phase.read_tangent()
    results = []
    for fine in (2048, 4096):
        times = np.linspace(0.0, steps * dt, 1 + round(steps * dt * fine))
        growth = growth_of_pendulum(np.concatenate(start), times)
        results.append(mean_megno(times, growth))
    # SciPy's tolerance of 1e-13 in each of its 1,000 steps, and e^6; twice the trapezoidal rule, extrapolated from h and h/2.
    assert found.time[0] == pytest.approx(times[-1], rel=1e-14)
    assert found.growth[0] == pytest.approx(growth[-1], abs=1e-13 * 1000)
    assert found.megno[0] == pytest.approx((4 * results[1] - results[0]) / 3, abs=1e-8)
    assert growth[0] - 1e-12 <= found.largest[0] <= growth.max() + 1e-10
    assert found.largest[0] > growth.max() - 0.05  # eight values in each step, where L swings by several units in a period


@pytest.mark.parametrize("method, bound", [("kahan_li8", 1e-8), ("ias15", 1e-12)])
def test_deviations_of_three_bodies_are_rebounds(method, bound):
    """Steps of 1/64 leave an error of 1e-9 in an orbit of period 6 (test_integrators), and ias15 an error of round-off."""
    rebound = pytest.importorskip("rebound")
    scene = {
        "particles": [
            {"body": {"mass": 1.0, "position": [0, 0, 0], "velocity": [0, 0, 0]}},
            {"body": {"mass": 0.2, "position": [1, 0, 0.1], "velocity": [0, 1.05, 0]}},
            {"body": {"mass": 0.1, "position": [-1.9, 0, 0], "velocity": [0, -0.7, 0.1]}},
        ],
        "forces": [{"newtonian_gravity": {"strength": 1.0}}],
        "integrator": {method: {"dt": 1 / 64}},
        "expect": MEASURED,
    }
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        began = np.hstack(simulation.phase.tangent.read_deviation())
        simulation.run(steps=64 * 20, judge="off")
        ended = np.hstack(simulation.phase.tangent.read_deviation())
        start = simulation.start
    other = rebound.Simulation()
    other.integrator = "ias15"
    for mass, x, v in zip(start.mass, start.position, start.velocity):
        other.add(m=mass, x=x[0], y=x[1], z=x[2], vx=v[0], vy=v[1], vz=v[2])
    variation = other.add_variation()
    for particle, values in zip(variation.particles, began):
        for name, value in zip(("x", "y", "z", "vx", "vy", "vz"), values):
            setattr(particle, name, float(value))
    other.integrate(20.0)
    theirs = [[getattr(p, name) for name in ("x", "y", "z", "vx", "vy", "vz")] for p in variation.particles]
    assert np.abs(ended - theirs).max() < bound * np.abs(ended).max()


def test_deviations_of_a_kepler_orbit_are_the_closed_form():
    """x = a X(M) and v = n a X'(M) with M = n t and n² a³ = μ, from pericentre; the deviation is a change of a."""
    turn, turns = 512, 400
    scene = {**kepler(integrator="kahan_li8"), "expect": MEASURED}
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        start = simulation.start
        mass, mu = start.mass, start.mass.sum()
        d, w = (each[1] - each[0] for each in (start.position, start.velocity))
        a = 1.0 / (2.0 / np.linalg.norm(d) - w @ w / mu)
        e, n = 1.0 - np.linalg.norm(d) / a, np.sqrt(mu / a**3)
        place, rate = np.array([1 - e, 0, 0]), np.array([0, np.sqrt((1 + e) / (1 - e)), 0])
        turning = -place / (1 - e) ** 3
        shares = np.array([-mass[1], mass[0]])[:, None] / mu
        simulation.phase.tangent.write(shares * place, shares * (-0.5 * n * rate))
        simulation.dt = 2 * np.pi / n / turn
        simulation.run(steps=turn * turns, judge="off")
        found, time = simulation.phase.read_tangent(), simulation.time
    late = 1.5 * n * time  # whole turns: the particles are again where they began
    expected = (((place - late * rate) ** 2).sum() + ((n * (0.5 * rate + late * turning)) ** 2).sum()) ** 0.5
    begun = ((place**2).sum() + ((0.5 * n * rate) ** 2).sum()) ** 0.5
    # The rounding of 200,000 steps of 17 drifts and kicks, as a random walk, in a phase that grows with the time.
    assert found.growth[0] == pytest.approx(
        np.log(expected / begun), abs=np.sqrt(turn * turns * 17) * 2.0**-53 * turns * 2 * np.pi
    )
    # L = ln t + a constant + a term that has the orbit's period: the mean of Y is 2, but for (ln t)²/t.
    assert found.megno[0] == pytest.approx(2.0, abs=2 * np.log(time) ** 2 * 2 * np.pi / time)
    assert found.largest[0] >= found.growth[0]


@pytest.mark.parametrize("method", ["leapfrog", "rk4", "ias15"])
@pytest.mark.sampled(3)
def test_a_saved_run_goes_on_with_the_same_bits(method, tmp_path):
    scene = spring_pendulum(0.01, method)
    with Simulation(scene, backend="cpu", precision="f64") as whole, Simulation(scene, backend="cpu") as parts:
        whole.run(steps=600, judge="off")
        parts.run(steps=250, judge="off")
        saved = parts.bookmark()
        parts.run(steps=100, judge="off")
        parts.go_back(saved)
        parts.run(steps=350, judge="off")
        found, expected = parts.phase.read_tangent(), whole.phase.read_tangent()
    for name in ("growth", "largest", "megno", "time"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))


@pytest.mark.parametrize("cut, method", [(1, "velocity_verlet"), (17, "velocity_verlet"), (17, "ias15")])
@pytest.mark.sampled(3)
def test_the_growth_goes_on_from_an_archive(tmp_path, cut, method):
    path, ends = tmp_path / "a.run", []
    with Simulation(spring_pendulum(0.01, method), backend="cpu", precision="f64") as simulation:
        archive = RunArchive(path, header_of(simulation), {})
        simulation.run(steps=cut)
        archive.record(simulation)
        archive.close()
        simulation.run(steps=300)
        ends.append(simulation.phase.read_tangent())
    with resume(path) as simulation:
        simulation.run(steps=300)
        ends.append(simulation.phase.read_tangent())
    for name in ("growth", "largest", "megno", "time"):
        np.testing.assert_array_equal(*(getattr(end, name) for end in ends))


def test_software_vulkan_has_the_same_chaos(software_vulkan):
    found = []
    for backend in ("cpu", "vulkan"):
        with Simulation(spring_pendulum(0.01), backend=backend, precision="f32") as simulation:
            simulation.run(steps=300, judge="off")
            found.append(simulation.phase.read_tangent())
    # Rounding to 2^-24 in each of 300 steps of 17 stages, and deviations that have grown by 10 at most.
    assert found[1].growth[0] == pytest.approx(found[0].growth[0], abs=300 * 17 * 2**-24 * 10)
    assert found[1].megno[0] == pytest.approx(found[0].megno[0], abs=300 * 17 * 2**-24 * 10)
