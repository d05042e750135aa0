"""Every integrator of the package: order, reversibility, energy, damping; a new file is tested automatically."""

import math

import numpy as np
import pytest
from reference import accelerations
from scipy.integrate import solve_ivp

from mpp_taichi import Simulation, component
from mpp_taichi.integrators._runge_kutta import nystroem_rows
from scenes import INTEGRATORS, KINDS_OF_STEP, everything, kepler, takes_friction

TABLES = [name for name in INTEGRATORS if component.declaration("integrators", name).base in ("Splitting", "RungeKutta")]
# One method of each family, and all that are a family by themselves.
ONE_OF_EACH_FAMILY = list({component.declaration("integrators", name).base: name for name in reversed(KINDS_OF_STEP)}.values())
ALONE = [name for name in KINDS_OF_STEP if component.declaration("integrators", name).base == "Integrator"]
SLOPE_TOLERANCE = 0.1
ROUND_OFF = 2.0**-53


def declared(name, attribute):
    return getattr(component.build("integrators", name, {"dt": 1.0}), attribute)


def plainest(name):
    """Parameters of the plainest form: corrected more than once, Hermite's schemes are nearly reversible (test_hermite)."""
    return {"corrections": 1} if component.declaration("integrators", name).base == "Hermite" else {}


def slope(steps, errors):
    """Least-squares slope of log error against log dt."""
    return np.polyfit(np.log(steps), np.log(errors), 1)[0]


def errors_at(scene, finest, duration, reference):
    """Position error at the end for four steps, each half the one before, down to 1/finest; compiled once."""
    errors, dts = [], []
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        for count in (finest // 8, finest // 4, finest // 2, finest):
            simulation.dt = 1.0 / count
            simulation.restart()
            simulation.run(steps=round(duration * count))
            errors.append(np.abs(simulation.snapshot().position - reference(simulation)).max())
            dts.append(simulation.dt)
    return dts, errors


def kepler_reference(simulation):
    """Two bodies of masses 1 and 1e-3 by Kepler's equation, about their centre of mass."""
    start = simulation.start
    separation, velocity = start.position[1] - start.position[0], start.velocity[1] - start.velocity[0]
    mu = start.mass.sum()
    distance = np.linalg.norm(separation)
    a = 1.0 / (2.0 / distance - velocity @ velocity / mu)
    e = 1.0 - distance / a
    mean = math.sqrt(mu / a**3) * simulation.time
    anomaly = mean
    for _ in range(60):
        anomaly -= (anomaly - e * math.sin(anomaly) - mean) / (1.0 - e * math.cos(anomaly))
    x = np.array([a * (math.cos(anomaly) - e), a * math.sqrt(1 - e * e) * math.sin(anomaly), 0.0])
    return np.array([-start.mass[1] / mu * x, start.mass[0] / mu * x])


def everything_reference(simulation):
    """The scene with every effect by SciPy's DOP853 at its tightest, from the textbook formulas."""
    start = simulation.start
    s, m, free = start.springs, start.mass, start.free

    def slopes(_, y):
        x, v = y.reshape(2, -1, 3)
        a = accelerations.gravity(x, m, 0.7, 0.2)
        a += accelerations.coulomb(x, m, start.charge, 0.5, 0.3)
        a += accelerations.springs(x, v, m, s.between, s.stiffness, s.damping, s.rest_length)
        a += np.array([0.1, -0.2, -0.3]) - 0.2 * v / m[:, None]
        return np.concatenate([v.ravel(), (a * free).ravel()])

    y = np.concatenate([start.position.ravel(), (start.velocity * free).ravel()])
    end = solve_ivp(slopes, (0.0, simulation.time), y, method="DOP853", rtol=1e-13, atol=1e-14).y[:, -1]
    return end[: y.size // 2].reshape(-1, 3)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("name", KINDS_OF_STEP)
def test_order_of_convergence_on_an_eccentric_orbit(name):
    finest = {1: 4096, 2: 512, 4: 320, 6: 40}[declared(name, "order")]
    dts, errors = errors_at(kepler(0.3, integrator=name), finest, 5.0, kepler_reference)
    assert errors[-1] > 1e-11, "the ladder reaches round-off and shows nothing"
    assert slope(dts, errors) == pytest.approx(declared(name, "order"), abs=SLOPE_TOLERANCE)


@pytest.mark.sampled(5)
@pytest.mark.parametrize("name", [name for name in KINDS_OF_STEP if takes_friction(name)])
def test_order_is_kept_by_forces_that_depend_on_velocity(name):
    finest = {1: 4096, 2: 512, 4: 160}[declared(name, "order")]
    dts, errors = errors_at(everything(integrator=name), finest, 0.5, everything_reference)
    assert slope(dts, errors) == pytest.approx(declared(name, "order"), abs=SLOPE_TOLERANCE)


@pytest.mark.sampled(3)
@pytest.mark.parametrize("name", KINDS_OF_STEP)
def test_time_reversible_integrators_return_to_round_off_and_others_do_not(name):
    steps = 1000
    dt = 0.02 if declared(name, "order") > 1 else 0.002  # else implicit Euler falls into the sun on the way
    with Simulation(kepler(0.5, dt=dt, integrator=name, **plainest(name)), backend="cpu", precision="f64") as simulation:
        before = simulation.snapshot()
        simulation.run(steps=steps)
        simulation.dt = -simulation.dt
        simulation.run(steps=steps)
        back = np.abs(simulation.snapshot().position - before.position).max()
    # Each of the 2·1000 steps rounds numbers of size ≤ 2; along an orbit a rounding grows at most with the square of the
    # number of steps taken after it (phase drift), which over n steps sums to n^{3/2}·few ulp when the roundings are random.
    limit = 30 * (2 * steps) ** 1.5 * ROUND_OFF
    if declared(name, "time_reversible"):
        assert back <= limit
    else:
        assert back > 100 * limit


def test_palindromic_tables_are_exactly_those_called_reversible():
    reversible = {name for name in INTEGRATORS if declared(name, "time_reversible")}
    splittings = {"leapfrog", "velocity_verlet", "yoshida4", "pefrl", "srkn6b", "srkn11b", "srkn14a", "rkn8"}
    assert reversible & set(TABLES) == splittings | {"yoshida6", "yoshida8", "kahan_li6", "kahan_li8"}


@pytest.mark.sampled(3)
@pytest.mark.parametrize("name", KINDS_OF_STEP)
def test_energy_is_bounded_for_symplectic_integrators_and_drifts_for_others(name):
    """Over 200 orbits: the largest error of the last fifty stays that of the first ten, or it leaves the first behind."""
    errors = []
    dt = 0.05 if declared(name, "order") > 1 else 0.005  # else implicit Euler falls into the sun in the first orbit
    symplectic = declared(name, "symplectic")
    with Simulation(kepler(0.3, dt=dt, integrator=name, **plainest(name)), backend="cpu", precision="f64") as simulation:
        energy = simulation.diagnostics()["total_energy"]
        for _ in range(800):
            simulation.run(steps=round(1.55 / dt))  # about a quarter of a turn, at ever new phases
            errors.append(abs(simulation.diagnostics()["total_energy"] / energy - 1.0))
            if not symplectic and errors[-1] > 2.0 * max(errors[:4]):
                break
    if symplectic:
        assert max(errors[600:]) < 1.5 * max(errors[:40])
    else:
        assert errors[-1] > 2.0 * max(errors[:4])


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    "name", dict.fromkeys(ONE_OF_EACH_FAMILY + ALONE)
)  # forces are what keeps momentum; a method only has to add them up
def test_momentum_is_kept_to_round_off(name):
    scene = everything(integrator=name, drag=0.0)
    scene["forces"] = scene["forces"][:2]
    scene["particles"][0]["body"]["free"] = [True, True, True]
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        before = simulation.diagnostics()
        simulation.run(steps=1000)
        after = simulation.diagnostics()
    error = np.abs(after["momentum"] - before["momentum"]).max()
    # Implicit methods solve their equations to 1e-12 of the way of a step, which is speed times dt.
    solver = 1e-12 if declared(name, "launchers").parallel == "parallel_implicit" else 0.0
    assert error <= 1000 * (ROUND_OFF + solver) * before["momentum_scale"]


@pytest.mark.sampled(2)
@pytest.mark.parametrize("name", TABLES)
def test_tables_are_consistent(name):
    """Weights sum to one: the first condition of any order."""
    method = component.build("integrators", name, {"dt": 1.0})
    if method.symplectic:
        assert math.fsum(method.drifts) == pytest.approx(1.0, abs=4 * ROUND_OFF)
        assert math.fsum(method.kicks) == pytest.approx(1.0, abs=4 * ROUND_OFF)
    else:
        assert math.fsum(method.b) == pytest.approx(1.0, abs=4 * ROUND_OFF)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("name", dict.fromkeys(ONE_OF_EACH_FAMILY + ALONE))  # the sums of tables are looked at above
def test_a_free_particle_flies_straight(name):
    scene = {
        "particles": [{"body": {"mass": 1.0, "position": [0, 0, 0], "velocity": [1, 2, 3]}}],
        "integrator": {name: {"dt": 0.5}},
    }
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        simulation.run(duration=16.0)
        np.testing.assert_allclose(simulation.snapshot().position, [[16, 32, 48]], rtol=1e-15)


# An axis is held where a family adds to a place; that a method holds it at all is part of its order beside every force, above.
@pytest.mark.sampled(3)
@pytest.mark.parametrize("name", dict.fromkeys(ONE_OF_EACH_FAMILY + ALONE))
def test_fixed_axes_do_not_move_a_bit(name):
    scene = everything(integrator=name)
    scene["particles"][0]["body"] |= {"position": [0.1, 0.2, 0.3], "velocity": [0.4, 0.5, 0.6], "free": [True, False, False]}
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        simulation.run(steps=500)
        end = simulation.snapshot()
    assert end.position[0, 1] == 0.2 and end.position[0, 2] == 0.3
    assert abs(end.position[0, 0] - 0.1) > 1e-3
    assert end.velocity[0, 1] == end.velocity[0, 2] == 0.0


def oscillator_step(method, terms):
    """Matrix of one step h for x' = v, v' = −x as a power series in h: entries of shape (2, 2, terms)."""
    one = np.zeros((2, 2, terms))
    one[:, :, 0] = np.eye(2)

    def times_h(series, factor):
        """The series times factor·h; terms beyond the last are of no interest."""
        return factor * np.concatenate([np.zeros((2, 1)), series[:, :-1]], axis=1)

    x, v = one[0].copy(), one[1].copy()  # rows: what x and v are made of, as series, column by column
    if method.symplectic:
        for _node, kick, drift in method.entries:
            v -= times_h(x, kick)
            x += times_h(v, drift)
        return np.stack([x, v])
    slopes = []
    for node, weights, bars in nystroem_rows(method.a, method.b):
        x, v = one[0] + times_h(one[1], node), one[1].copy()
        for slope, weight, bar in zip(slopes, weights, bars):
            x += times_h(times_h(slope, bar), 1.0)
            v += times_h(slope, weight)
        slopes.append(-x)
    return np.stack([x, v])


@pytest.mark.sampled(2)
@pytest.mark.parametrize("name", TABLES)
def test_every_digit_of_a_table_counts(name):
    """On the oscillator a step must be the Taylor series of exp(hJ) up to the order, to the rounding of its coefficients."""
    method = component.build("integrators", name, {"dt": 1.0})
    terms = method.order + 1
    series = oscillator_step(method, terms)
    power = np.eye(2)
    for k in range(terms):
        # Up to some twenty sums of products of coefficients of size ≤ 2, each rounded once.
        np.testing.assert_allclose(series[:, :, k], power / math.factorial(k), rtol=0, atol=40 * ROUND_OFF)
        power = power @ np.array([[0.0, 1.0], [-1.0, 0.0]])


def largest_stable_step(method):
    """Where the spectral radius first leaves 1 on the undamped oscillator, to 1e-6."""
    frequency = 1.0
    while np.abs(np.linalg.eigvals(method.amplification(frequency))).max() <= 1.0 + 1e-9:
        frequency += 1e-3
    return frequency


@pytest.mark.parametrize(("name", "limit"), [("leapfrog", 2.0), ("velocity_verlet", 2.0), ("rk4", math.sqrt(8.0))])
def test_stability_limits_are_those_of_the_textbooks(name, limit):
    assert largest_stable_step(component.build("integrators", name, {"dt": 1.0})) == pytest.approx(limit, abs=2e-3)


@pytest.mark.sampled(5)
@pytest.mark.parametrize("name", KINDS_OF_STEP)
def test_the_amplification_matrix_is_what_a_step_does(name):
    """Masses on springs of length 0 along x: D = ω², c = γ, one without damping; a method of two steps has two states."""
    dt, frequency = 0.3, 2.0
    dampings = (0.0, 0.7) if takes_friction(name) else (0.0,)
    scene = {"particles": [], "springs": [], "integrator": {name: {"dt": dt}}}
    for k, damping in enumerate(dampings):
        scene["particles"] += [
            {"body": {"mass": 1.0, "position": [0, k, 0], "free": [False] * 3}},
            {"body": {"mass": 1.0, "position": [0.8, k, 0], "velocity": [-0.5, 0, 0]}},
        ]
        link = {"between": [2 * k, 2 * k + 1], "stiffness": frequency**2, "damping": damping, "rest_length": 0.0}
        scene["springs"].append({"link": link})
    method = component.build("integrators", name, {"dt": dt})
    found = []
    with Simulation(scene, backend="cpu", precision="f64", force=True) as simulation:
        for _ in range(5):
            now = simulation.snapshot()
            kept = [getattr(simulation.state, each).to_numpy() for each in (method.memory if method.derivatives else ())]
            found.append([now.position, now.velocity * dt, *(a * dt ** (k + 2) for k, a in enumerate(kept))])
            simulation.run(steps=1)
    for k, damping in enumerate(dampings):
        step = method.amplification(frequency * dt, damping * dt)
        states = [[each[2 * k + 1, 0] for each in arrays] for arrays in found]
        begin = 1 if len(step) > 2 else 0  # from where on there is all that a step looks at: an earlier state, or derivatives
        before = states[begin] if method.derivatives else np.concatenate(states[begin::-1])
        expected = np.linalg.matrix_power(step, 4 - begin) @ before
        # Implicit methods solve their equations to 1e-12 of the way of a step.
        solved = method.evaluations_per_step is None
        np.testing.assert_allclose(states[4][:2], expected[:2], rtol=1e-13, atol=4e-12 if solved else 1e-14)
