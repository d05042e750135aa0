"""Wisdom and Holman's mapping: Kepler's problem in closed form, orders in step and mass, REBOUND's WHFast beside it."""

import math
from pathlib import Path

import numpy as np
import pytest
import taichi as ti

from mpp_taichi import BackendError, SceneError, Simulation, StabilityError
from mpp_taichi.accuracy.methods import methods
from mpp_taichi.accuracy.problem import pose
from mpp_taichi.device import backends
from mpp_taichi.integrators import _correctors, _kepler
from mpp_taichi.scene.load import load_scene
from scenes import cluster, everything, kepler

ULP = 2.0**-52
OUTER = Path(__file__).parents[2] / "scenes" / "outer_solar_system.yaml"


# --- Kepler's problem ---------------------------------------------------------------------------------------------------


def moved(x, v, t):
    """Closed form with μ = 1 in long double: Kepler's equation in the eccentric or hyperbolic anomaly, by bisection."""
    x, v, t = (np.asarray(each, dtype=np.longdouble) for each in (x, v, t))
    r, radial = np.sqrt((x * x).sum(1)), (x * v).sum(1)
    alpha = 2 / r - (v * v).sum(1)
    bound, size = alpha > 0, 1 / np.abs(alpha)
    rate = np.sqrt(np.abs(alpha)) ** 3
    cosine, sine = 1 - r * alpha, radial * np.sqrt(np.abs(alpha))  # e cos E, e sin E; hyperbolic ones there
    e = np.sqrt(np.where(bound, cosine**2 + sine**2, cosine**2 - sine**2))
    first = np.where(bound, np.arctan2(sine, cosine), np.arcsinh(sine / e))

    def mean(anomaly):
        with np.errstate(over="ignore"):
            return np.where(bound, anomaly - e * np.sin(anomaly), e * np.sinh(anomaly) - anomaly)

    wanted = mean(first) + rate * t
    edge = np.where(bound, np.abs(wanted) + e + 1, np.minimum(np.arcsinh((np.abs(wanted) + 50) / np.minimum(e - 1, 1)) + 1, 60))
    low, high = -edge, edge
    for _ in range(120):
        middle = (low + high) / 2
        far = mean(middle) > wanted
        low, high = np.where(far, low, middle), np.where(far, middle, high)
    last = (low + high) / 2
    change = last - first
    sin, cos = np.where(bound, np.sin(change), np.sinh(change)), np.where(bound, np.cos(change), np.cosh(change))
    f = 1 - size / r * np.abs(1 - cos)
    g = t - np.where(bound, change - sin, sin - change) / rate
    place = f[:, None] * x + g[:, None] * v
    end = np.sqrt((place * place).sum(1))
    back, slowed = -sin / (np.sqrt(np.abs(alpha)) * r * end), 1 - size / end * np.abs(1 - cos)
    return place, back[:, None] * x + slowed[:, None] * v


@pytest.fixture
def solver():
    """(x, v, t, μ) → x, v and whether all were solved, by the function under test."""
    backends.start("cpu", "f64")
    count = 4000
    x, v, t = ti.Vector.field(3, float, count), ti.Vector.field(3, float, count), ti.field(float, count)
    solved = ti.field(ti.i32, count)

    @ti.kernel
    def advance(mu: float):
        for i in range(count):
            way, push, found = _kepler.kepler_changes(x[i], v[i], mu, t[i])
            x[i], v[i], solved[i] = x[i] + way, v[i] + push, found

    def run(places, velocities, times, mu=1.0):
        x.from_numpy(np.resize(places, (count, 3)))
        v.from_numpy(np.resize(velocities, (count, 3)))
        t.from_numpy(np.resize(times, count))
        advance(mu)
        assert solved.to_numpy().all()
        return x.to_numpy()[: len(times)], v.to_numpy()[: len(times)]

    return run


def orbits(eccentricity, anomaly):
    """States with μ = |a| = 1 at eccentric (hyperbolic) anomalies."""
    e, w = eccentricity, anomaly
    bound, root = e < 1, np.sqrt(np.abs(1 - e * e))
    cos, sin = np.where(bound, np.cos(w), np.cosh(w)), np.where(bound, np.sin(w), np.sinh(w))
    r, zero = np.abs(1 - e * cos), 0 * e
    x = np.where(bound, cos - e, e - cos)
    place = np.stack([x, root * sin, zero], 1)
    return place, np.stack([-sin / r, root * cos / r, zero], 1)


def test_keplers_problem_is_solved_on_every_conic_and_over_any_time(solver):
    random = np.random.default_rng(3)
    count = 4000
    e = np.where(random.random(count) < 0.6, 1 - 10 ** random.uniform(-6, 0, count), 1 + 10 ** random.uniform(-6, 2, count))
    anomaly = random.uniform(-np.pi, np.pi, count) * 10 ** random.uniform(-3, 0, count)
    times = 2 * np.pi * 10 ** random.uniform(-6, math.log10(30), count) * random.choice([-1, 1], count)
    x, v = orbits(e, anomaly)
    found = solver(x, v, times)
    expected = moved(x, v, times)
    # What changes of a last digit in what is given make of the result, by the closed form: round-off inside does the same, at
    # random in some twenty operations. Where a comet comes in and goes out again past a pericentre of a millionth, the terms of
    # t(X) grow with e^X / 2 and cancel: there, for one in a thousand of these, it is up to some hundred times as much.
    moves = []
    for _ in range(8):
        others = [each * (1 + ULP * random.choice([-1, 1], each.shape)) for each in (x, v, times)]
        moves.append([np.abs(a - b).max(1) for a, b in zip(moved(*others), expected)])
    for k in range(2):
        error = np.abs(found[k] - expected[k]).max(1).astype(float)
        size = np.abs(expected[k]).max(1).astype(float)
        ratio = error / (np.max([move[k] for move in moves], axis=0).astype(float) + ULP * size)
        assert ratio.max() < 256.0 and np.percentile(ratio, 99.5) < math.sqrt(20) and np.median(ratio) < 0.25


def test_a_parabola_is_barkers_and_a_comet_may_fall_straight_in(solver):
    # q = 2, v = 1 at pericentre makes 2/r − v² exactly zero: t √(1/2q³) = D + D³/3, D the tangent of half the anomaly.
    times = np.concatenate([-np.logspace(-6, 6, 50), np.logspace(-6, 6, 50)])
    found, _ = solver(np.tile([2.0, 0, 0], (100, 1)), np.tile([0, 1.0, 0], (100, 1)), times)
    tangent = 2 * np.sinh(np.arcsinh(1.5 * times * math.sqrt(1 / 16)) / 3)
    expected = np.stack([2 * (1 - tangent**2), 4 * tangent, 0 * times], 1)
    assert (np.abs(found - expected).max(1) <= 32 * ULP * np.abs(expected).max(1)).all()
    # Out of nowhere with exactly no energy: r³ = 9 (t + t₀)² / 2 along a line, back to the centre where t is −t₀ and, as of an
    # ellipse that is all but one, out again on the same side.
    start = 2.0
    since = start**1.5 * math.sqrt(2) / 3
    times = since * np.array([3.0, 0.1, -0.5, -0.999, -1.5])
    found, _ = solver(np.tile([start, 0, 0], (5, 1)), np.tile([1.0, 0, 0], (5, 1)), times)
    assert found[:, 0] == pytest.approx((4.5 * (since + times) ** 2) ** (1 / 3), rel=1e-12)


@pytest.mark.sampled(3)
def test_a_solution_that_is_not_found_ends_the_run_with_its_name(monkeypatch):
    monkeypatch.setattr(_kepler, "MOST", 1)
    scene = kepler(0.9, dt=1.0, integrator="wisdom_holman")
    with Simulation(scene, backend="cpu", precision="f64") as run:
        with pytest.raises(StabilityError, match=r"step 1, time 1: Kepler's equation of particle 1 \('planet'\) has no"):
            run.run(steps=5)
        assert run.step_count == 0


# --- correctors ---------------------------------------------------------------------------------------------------------


@pytest.mark.sampled(2)
@pytest.mark.parametrize("order", [3, 5, 7, 11, 17])
def test_correctors_take_away_what_a_step_does_beside_the_flow(order):
    """2 Σ b sinh(a x) − ((x/2) / sinh(x/2) − 1) / x begins with x^order."""

    def rest(x):
        x = np.longdouble(x)
        stages = [(np.longdouble(a), np.longdouble(b)) for a, b in _correctors.stages(order)]
        return 2 * sum(b * np.sinh(a * x) for a, b in stages) - (x / 2 / np.sinh(x / 2) - 1) / x

    # Coefficients of up to one are rounded to 1e-16 times sinh(a x) of up to 30; the next term is x² smaller.
    found = math.log(abs(rest(1.0) / rest(0.7))) / math.log(1 / 0.7) if order < 17 else None
    if found is None:
        assert abs(rest(0.7)) < 1e-14 and abs(rest(0.2)) < 1e-15
    else:
        assert found == pytest.approx(order, abs=0.35)


def test_the_third_order_corrector_is_wisdoms():
    ((a, b),) = _correctors.stages(3)
    assert a == math.sqrt(7 / 40) and abs(b) == pytest.approx(1 / (48 * a), rel=1e-15)
    for order in (0, 3, 17):
        there, back = _correctors.opening(order), _correctors.closing(order)
        assert math.fsum(drift for _, drift in there) == pytest.approx(0.5, abs=1e-15)
        assert [drift for _, drift in there] == [-drift for _, drift in reversed(back)]


# --- in motion ----------------------------------------------------------------------------------------------------------


def two_planets(ratio, dt, corrector):
    """Of the mass `ratio` each about a star of 1, at 1 and 2.6, in three dimensions."""
    bodies = [(1.0, (0, 0, 0), (0, 0, 0)), (ratio, (1, 0, 0), (0, 1.02, 0.05)), (ratio, (-2.0, 1.6, 0.1), (-0.4, -0.5, 0.02))]
    return {
        "particles": [{"body": {"mass": m, "position": list(x), "velocity": list(v)}} for m, x, v in bodies],
        "forces": [{"newtonian_gravity": {"strength": 1.0}}],
        "integrator": {"wisdom_holman": {"dt": dt, "corrector": corrector}},
    }


def by_rebound(run, until, dt=None, kernel="default"):
    """Positions at a time from the start of `run`, by IAS15, or by WHFast with a step and a kernel."""
    rebound = pytest.importorskip("rebound")
    other = rebound.Simulation()
    other.integrator, other.G = "ias15" if dt is None else "whfast", run.total_force.pair_forces[0].strength
    for m, x, v in zip(run.start.mass, run.start.position, run.start.velocity):
        other.add(m=m, x=x[0], y=x[1], z=x[2], vx=v[0], vy=v[1], vz=v[2])
    if dt is None:
        other.integrate(until)
    else:
        other.dt = dt
        other.integrator.safe_mode, other.integrator.kernel = 0, kernel
        other.steps(round(until / dt))
        other.synchronize()
    return np.array([p.xyz for p in other.particles])


@pytest.mark.sampled(3)
@pytest.mark.parametrize(("corrector", "power", "ratios"), [(0, 1, (1e-4, 1e-5)), (17, 2, (1e-3, 1e-4))])
def test_the_error_is_of_second_order_in_the_step_and_of_the_masses_or_their_square(corrector, power, ratios):
    span, errors = 64.0, {}
    for ratio in ratios:
        with Simulation(two_planets(ratio, 0.25, corrector), backend="cpu", precision="f64") as run:
            expected = by_rebound(run, span)
            for steps in (512, 1024):
                run.dt = span / steps
                run.restart()
                run.run(steps=steps)
                errors[ratio, steps] = np.linalg.norm(run.snapshot().position - expected, axis=1).max()
    assert errors[ratios[1], 1024] > 1e-12
    for ratio in ratios:
        assert math.log2(errors[ratio, 512] / errors[ratio, 1024]) == pytest.approx(2.0, abs=0.1), errors
    # The next order in the masses is a few thousandths of the leading one.
    assert math.log10(errors[ratios[0], 1024] / errors[ratios[1], 1024]) == pytest.approx(power, abs=0.1), errors


def outer(kernel="kick"):
    """The bundled scene without a corrector."""
    overrides = {"integrator.wisdom_holman.corrector": 0, "integrator.wisdom_holman.kernel": kernel}
    return Simulation(OUTER, overrides=overrides, backend="cpu", precision="f64")


@pytest.mark.parametrize("kernel", ["kick", "lazy"])
@pytest.mark.sampled(3)
def test_steps_are_those_of_whfast(kernel):
    with outer(kernel) as run:
        assert run.integrator.evaluations_per_step == (2 if kernel == "lazy" else 1)
        run.dt = 50.0
        run.run(steps=2000)
        expected = by_rebound(run, 2000 * 50.0, 50.0, {"kick": "default"}.get(kernel, kernel))
        # Each step rounds places of 40 by half of 40 ULP; along an orbit the phase gathers that with the power 3/2 of the
        # steps, times the angle of a step, 0.07 for Jupiter and far less for those at 40. The two differ by twice that at most.
        assert np.abs(run.snapshot().position - expected).max() < 40 * ULP * 2000**1.5 * 0.07
        run.restart()
        run.dt = 100.0
        run.run(steps=1000)
        assert np.abs(run.snapshot().position - expected).max() > 1e-6, "WHFast at another step is told apart"


@pytest.mark.sampled(3)
def test_looks_change_no_bit_and_lie_on_the_motion():
    ends = []
    with Simulation(OUTER, backend="cpu", precision="f64") as run:
        for looks in (1, 7, 64):
            run.restart()
            if looks == 64:
                run.snapshot_ahead(50.0)  # before anything was taken over
            for _ in range(looks):
                run.run(steps=448 // looks)
                ahead = run.snapshot_ahead(0.4 * run.dt)
                assert ahead.time == run.time + 0.4 * run.dt and run.snapshot().time == run.time
            now = run.snapshot()
            ends.append([*(each.tobytes() for each in run.state.save()[3:]), now.position.tobytes(), now.velocity.tobytes()])
            expected = by_rebound(run, ahead.time)
    assert ends[0] == ends[1] == ends[2]
    # What kicks would have bent since the step: ε a (0.4 dt)² / 2 with Saturn's pull on Jupiter; x + v t is off a thousandfold.
    assert np.abs(ahead.position - expected).max() < 1e-3 * 1.1e-5 * (0.4 * 175) ** 2 / 2 * 4


@pytest.mark.sampled(3)
def test_the_lazy_kernel_leaves_no_error_of_the_square_of_the_masses_in_second_order():
    """With the corrector of order 17: ε² dt² falls by 4 where the step is halved; ε² dt⁴ + ε³ dt² falls by more, ε is 1e-2."""
    span, errors = 64.0, {}
    for kernel in ("kick", "lazy"):
        scene = two_planets(1e-2, 0.25, 17)
        scene["integrator"]["wisdom_holman"]["kernel"] = kernel
        with Simulation(scene, backend="cpu", precision="f64") as run:
            expected = by_rebound(run, span)
            for steps in (512, 1024):
                run.dt = span / steps
                run.restart()
                run.run(steps=steps)
                errors[kernel, steps] = np.linalg.norm(run.snapshot().position - expected, axis=1).max()
    assert errors["lazy", 1024] < 1e-2 * errors["kick", 1024], errors
    assert errors["kick", 512] / errors["kick", 1024] == pytest.approx(4.0, abs=0.2)
    assert errors["lazy", 512] / errors["lazy", 1024] > 5.0


def test_the_energy_stays_for_half_a_million_years():
    """With its error of 1e-6 at steps of 175 days; what drifts by round-off is far below."""
    with outer() as run:
        energy, errors = run.mechanics()["total_energy"], []
        for _ in range(40):
            run.run(steps=25_000)
            errors.append(run.mechanics()["total_energy"] / energy - 1)
    assert max(map(abs, errors)) < 4e-6
    assert abs(np.mean(errors[20:]) - np.mean(errors[:20])) < 3 * np.std(errors) / math.sqrt(10)


@pytest.mark.sampled(3)
def test_two_bodies_are_left_to_round_off():
    """At e = 0.6, 3.7 steps an orbit: 1000 orbits against Kepler's equation."""
    mu = 1.001
    scene = kepler(0.6, integrator="wisdom_holman", dt=2 * math.pi / math.sqrt(mu) / 3.7)
    with Simulation(scene, backend="cpu", precision="f64") as run:
        start, energy = run.start, run.mechanics()["total_energy"]
        run.run(steps=3700)
        now, after = run.snapshot(), run.mechanics()["total_energy"]
    separation = [s.position[1:] - s.position[:1] for s in (start, now)]
    speed = start.velocity[1:] - start.velocity[:1]
    expected, _ = moved(separation[0], speed / math.sqrt(mu), [run.time * math.sqrt(mu)])
    # A step leaves place and velocity wrong by some 4 ULP, which at pericentre, 0.4 away, changes 1/r by 4/0.4² ULP: that is 50
    # of the energy, at random in 3700 steps. The phase gathers 3/2 of it over 2π · 1000, and at random a root of three less.
    walk = 50 * ULP * math.sqrt(3700)
    assert abs(after / energy - 1) < walk
    assert np.abs(separation[1] - expected).max() < 1.5 * 2 * math.pi * 1000 * walk / math.sqrt(3) * 2


def scattered(order):
    """Star, two planets and three massless bodies, listed in any order."""
    bodies = [
        ("star", 1.0, (0, 0), (0, 0)), ("near", 1e-3, (1, 0), (0, 1)), ("far", 5e-4, (0, -2.5), (0.63, 0)),
        ("grain", 0.0, (-1.6, 0), (0, -0.79)), ("dust", 0.0, (0.5, 0.1), (0, 1.4)), ("comet", 0.0, (4, 3), (-0.8, -0.1)),
    ]  # fmt: skip
    return {
        "dimensions": 2,
        "particles": [
            {"body": {"name": n, "mass": m, "position": list(x), "velocity": list(v)}}
            for n, m, x, v in (bodies[k] for k in order)
        ],
        "forces": [{"newtonian_gravity": {"strength": 1.0}}],
        "integrator": {"wisdom_holman": {"dt": 0.05} | ({"central": "star"} if order[0] else {})},
    }


@pytest.mark.sampled(3)
def test_any_order_of_the_bodies_and_massless_ones_give_the_same_motion():
    ends = []
    for order in ((0, 1, 2, 3, 4, 5), (5, 3, 1, 4, 0, 2)):
        with Simulation(scattered(order), backend="cpu", precision="f64") as run:
            run.run(steps=400)
            place = np.empty((6, 3))
            place[list(order)] = run.snapshot().position
            expected = np.empty((6, 3))
            expected[list(order)] = by_rebound(run, run.time)
        ends.append(place)
    assert np.array_equal(ends[0], ends[1])
    # ε dt^12 and ε² dt² of twenty units of time; the dust within the orbit of the near planet is moved most.
    assert np.abs(ends[0] - expected).max() < 1e-5


@pytest.mark.sampled(3)
def test_replicas_marks_and_steps_back():
    scene = two_planets(1e-3, 0.2, 0)
    with Simulation(scene, backend="cpu", precision="f64") as run:
        start = run.snapshot()
        run.run(steps=50)
        mark = run.mark()
        run.run(steps=50)
        end = run.snapshot()
        run.return_to(mark)
        run.run(steps=50)
        assert np.array_equal(run.snapshot().position, end.position) and np.array_equal(run.snapshot().velocity, end.velocity)
        run.dt = -run.dt
        run.run(steps=100)
        assert np.abs(run.snapshot().position - start.position).max() < 200**1.5 * ULP
    slower = start.moved(position=start.position, velocity=0.99 * start.velocity, time=0.0, step=0)
    with Simulation(scene, backend="cpu", precision="f64", replica_starts=[slower, start]) as run:
        run.run(steps=100)
        assert np.array_equal(run.snapshot(1).position, end.position)
        assert not np.array_equal(run.snapshot(0).position, end.position)


def test_what_it_cannot_do_is_refused_by_name():
    def refused(scene, message, error=SceneError, **options):
        with pytest.raises(error, match=message):
            Simulation(scene, backend="cpu", **options)

    orbit = kepler(integrator="wisdom_holman")
    refused(orbit, "wisdom_holman has no parallel plan; there are serial and replicas", BackendError, plan="parallel")
    refused(
        everything(integrator="wisdom_holman"), "knows no forces but newtonian_gravity .* not coulomb, uniform_gravity, springs"
    )
    refused(cluster(5, integrator="wisdom_holman"), "softening is 0.1, must be 0 for wisdom_holman")
    heavy = r"particle 0 \(body\), has the mass 0.19.*, must outweigh all others together, 0.60.*, by a factor of 10"
    refused(cluster(5, integrator="wisdom_holman", softening=0.0), heavy)
    refused(
        orbit | {"integrator": {"wisdom_holman": {"dt": 0.1, "corrector": 4}}}, "4 is no order of a corrector, allowed: 0, 3,"
    )
    refused(orbit | {"integrator": {"wisdom_holman": {"dt": 0.1, "central": "moon"}}}, "no particle is called 'moon'")
    refused(
        orbit | {"forces": [{"newtonian_gravity": {"strength": -1.0}}]}, "strength is -1, must be above 0 for wisdom_holman"
    )
    refused(orbit | {"forces": []}, "needs newtonian_gravity: its drifts are Kepler's orbits")
    held = {"body": {"name": "sun", "mass": 1.0, "position": [0, 0, 0], "free": False}}
    pinned = {**orbit, "particles": [held, orbit["particles"][1]], "move_to_center_of_mass": False}
    refused(pinned, r"particle 0 \(sun\) is held on the axis x, must be free: orbits cannot be held")


def test_sweeps_try_it_where_a_scene_fits():
    planets = set(methods(pose(load_scene(OUTER))))
    others = set(methods(pose(load_scene(everything()), until=1.0)))
    softened = set(methods(pose(load_scene(cluster(5)), until=1.0)))
    assert "wisdom_holman" in planets and not {"wisdom_holman", "adaptive_leapfrog"} & others
    assert "adaptive_leapfrog" in softened and "wisdom_holman" not in softened
