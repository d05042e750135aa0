"""Taylor's method against Kepler's series in fractions, Newton's law, closed forms and REBOUND's IAS15."""

import math
from fractions import Fraction

import numpy as np
import pytest
from test_ias15 import bodies, planet

from mpp_taichi import BackendError, SceneError, Simulation, StabilityError
from scenes import kepler

ULP = 2.0**-52
ORDER = 20
GRAVITY = {"newtonian_gravity": {"strength": 1.0}}


def taylor(scene, **parameters):
    """The scene with this method; `dt` stays."""
    dt = {key: value for key, value in scene["integrator"].get("ias15", {}).items() if key == "dt"}
    return scene | {"integrator": {"taylor": dt | parameters}}


def series_of(run):
    """Coefficients as [length / time^n], (order + 1, particles, dimensions), in long double."""
    rows = run.state.coefficient.to_numpy().reshape(ORDER + 1, run.state.particle_count, -1).astype(np.longdouble)
    unit = np.longdouble(run.state.clock.to_numpy()[2])
    return rows / unit ** np.arange(ORDER + 1)[:, None, None]


def keplers_series(eccentricity, order):
    """Coefficients of (cos E − e, sin E) in the mean anomaly from pericentre on, exactly.

    dE/dM = 1/(1 − e cos E) = w, with (cos E)′ = −w sin E, (sin E)′ = w cos E: series of w and of both, one order after the
    other. There is no power −3/2 and no distance in it.
    """
    e = Fraction(eccentricity)
    cosine, sine, w = [Fraction(1)], [Fraction(0)], [1 / (1 - e)]
    for n in range(order):
        cosine.append(-sum(w[k] * sine[n - k] for k in range(n + 1)) / (n + 1))
        sine.append(sum(w[k] * cosine[n - k] for k in range(n + 1)) / (n + 1))
        w.append(e * sum(cosine[n + 1 - k] * w[k] for k in range(n + 1)) / (1 - e))
    cosine[0] -= e
    return np.array([[float(c), float(s)] for c, s in zip(cosine, sine)])


@pytest.mark.sampled(3)
def test_the_coefficients_are_those_of_keplers_orbit():
    e = 0.25  # an exact number
    speed = math.sqrt((1 + e) / (1 - e))
    scene = {
        "dimensions": 2,
        "forces": [GRAVITY],
        "particles": bodies((1.0, (0, 0)), (0.0, (1 - e, 0), (0, speed))),
        "integrator": {"taylor": {}},
        "run": {"duration": 0.01},
    }
    with Simulation(scene, backend="cpu", precision="f64") as run:
        run.run()
        assert run.integrator.counts(run.state)[0, run.integrator.STEPS] == 1
        found = series_of(run)[:, 1].astype(float)
    expected = keplers_series(e, ORDER)
    expected[:, 1] *= math.sqrt(1 - e**2)
    assert np.all(found[1::2, 0] == 0.0) and np.all(found[::2, 1] == 0.0)
    # Each recurrence sums n products of what was rounded before.
    size = np.linalg.norm(expected, axis=1)
    assert np.all(np.linalg.norm(found - expected, axis=1) < 4 * ULP * np.arange(1, ORDER + 2) * size)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("count, dimensions", [(4, 2), (11, 3)])
def test_the_series_obeys_newtons_law(count, dimensions):
    """Its second derivative is the acceleration where it leads to: in one block of pairs, and in many.

    Softened, in a uniform field, one body without mass, one held along x.
    """
    random = np.random.default_rng(count)
    mass, softening, strength, field = random.uniform(0.5, 2.0, count), 0.25, 0.7, np.array([0.3, -0.2, 0.5])[:dimensions]
    mass[1] = 0.0
    position, velocity = random.uniform(-1, 1, (2, count, dimensions))
    particles = bodies(*((float(m), x.tolist(), (v.tolist(),)) for m, x, v in zip(mass, position, velocity)))
    for entry, v in zip(particles, velocity):
        entry["body"]["velocity"] = v.tolist()
    particles[2]["body"]["free"] = [False, True, True]
    scene = {
        "dimensions": dimensions,
        "forces": [
            {"newtonian_gravity": {"strength": strength, "softening": softening}},
            {"uniform_gravity": {"acceleration": [*field.tolist(), 0.0][:3]}},
        ],
        "particles": particles,
        "integrator": {"taylor": {"dt": 1e-3}},
        "run": {"duration": 1e-3},
    }
    with Simulation(scene, backend="cpu", precision="f64") as run:
        run.run()
        rows, h = series_of(run), run.state.clock.to_numpy()[1]
    n = np.arange(2, ORDER + 1)[:, None, None]
    for t in (np.longdouble(0), np.longdouble(h) / 4):
        place = (rows * t ** np.arange(ORDER + 1)[:, None, None]).sum(0)
        bent = (n * (n - 1) * rows[2:] * t ** (n - 2)).sum(0)
        apart = place[None] - place[:, None]
        pull = strength * mass[None, :, None] * apart / ((apart**2).sum(-1) + softening**2)[..., None] ** 1.5
        expected = pull.sum(1) + field
        expected[2, 0] = 0.0
        # At a quarter of a step what the series leaves out is 4^-20 of terms that are 1e-18 of a separation; the rest rounds.
        assert np.abs(bent - expected).max() < 64 * ULP * np.abs(pull).sum(1).max()


@pytest.mark.sampled(3)
def test_orbits_end_where_they_began():
    """A hundred orbits at e = 0.6, 0.9 and 0.99, copies of one scene. Energy: round-off, a sum of some 10⁴ steps.

    Near pericentre the kinetic energy, and with it what rounding leaves, is 2/(1 − e) times the sum. An error δ of the
    energy makes one of 3π·100·δ along the orbit, as fast as the body is there, at the greatest distance below the mean.
    """
    starts, scene, period = [], None, None
    for e in (0.6, 0.9, 0.99):
        scene, period = planet(e, 3, 100)
        with Simulation(taylor(scene), backend="cpu", precision="f64") as run:
            starts.append(run.snapshot())
    with Simulation(taylor(scene), backend="cpu", precision="f64", replica_starts=starts) as run:
        run.run()
        for k, (e, start) in enumerate(zip((0.6, 0.9, 0.99), starts)):
            after = run.snapshot(k)
            steps = run.integrator.counts(run.state)[k, run.integrator.STEPS]
            assert steps < 12_000
            bound = 2 * ULP * math.sqrt(steps) / (1 - e)
            assert abs(energy_of(after) / energy_of(start) - 1) < bound
            assert np.abs(after.position - start.position).max() < 3 * math.pi * 100 * bound


def energy_of(now):
    """In long double, so that rounding of this sum does not hide that of the run."""
    x, v = now.position.astype(np.longdouble), now.velocity.astype(np.longdouble)
    i, j = np.triu_indices(len(x), 1)
    distance = np.sqrt(((x[j] - x[i]) ** 2).sum(1))
    return 0.5 * (now.mass[:, None] * v**2).sum() - (now.mass[i] * now.mass[j] / distance).sum()


def test_a_smaller_tolerance_has_a_smaller_error_and_no_kernel_is_compiled_for_it():
    scene, period = planet(0.6, 1, 10)
    with Simulation(taylor(scene), backend="cpu", precision="f64") as run:
        start, mark = run.snapshot(), run.mark()
        run.run()
        kernels = run.launcher._advance._primal.compiled_kernels
        compiled = len(kernels)
        tolerances, errors = 10.0 ** -np.arange(4, 11), []
        for tolerance in tolerances:
            run.integrator.tolerance = float(tolerance)
            run.return_to(mark)
            run.launcher.prepare(0.0, run.dt)
            run.run(until=10 * period)
            errors.append(np.abs(run.snapshot().position - start.position).max())
        assert len(kernels) == compiled == 1
    # Ten orbits make 10 · 11/2 errors of an orbit, and at the apocentre the body is slower than on the mean.
    assert np.all(np.array(errors) < 10 * 55 * tolerances)
    assert errors[-1] < 1e-4 * errors[0]


@pytest.mark.parametrize("order", [8, 9])
@pytest.mark.sampled(3)
def test_errors_of_the_energy_cancel_in_an_encounter_where_the_order_is_odd(order):
    """The velocity lacks h^p times derivative p + 1 of the position; the power v · x^(p+1) of this error has parity p in time.

    About a pericentre the steps are symmetric in time, so that for odd p the powers before and after the pericentre cancel up
    to the next order of the step, a tenth of them; for even p the two halves have the same sign.
    """
    scene, period = planet(0.9, 2, 1)
    with Simulation(taylor(scene, order=order), backend="cpu", precision="f64") as run:
        for tolerance in (1e-3, 1e-5, 1e-7):
            run.integrator.tolerance = tolerance
            run.restart()
            start = energy_of(run.snapshot())
            pericentre, end = (abs(energy_of(run.run(steps=1).snapshot()) - start) for _ in range(2))
            assert end < 0.1 * pericentre if order % 2 else end > pericentre


@pytest.mark.sampled(3)
def test_the_figure_eight_is_rebounds():
    """At T/6, where one acceleration is zero, and after a period; both err by the rounding of some 60 steps each."""
    rebound = pytest.importorskip("rebound")
    place, speed, period = (0.97000436, -0.24308753), (-0.93240737, -0.86473146), 6.32591398
    half = (-speed[0] / 2, -speed[1] / 2)
    entries = ((1.0, place, half), (1.0, (-place[0], -place[1]), half), (1.0, (0.0, 0.0), speed))
    other = rebound.Simulation()
    other.integrator = "ias15"
    for mass, (x, y), (vx, vy) in entries:
        other.add(m=mass, x=x, y=y, vx=vx, vy=vy)
    scene = {"dimensions": 2, "forces": [GRAVITY], "particles": bodies(*((m, x, v) for m, x, v in entries))}
    scene |= {"integrator": {"taylor": {"dt": period / 6}}, "run": {"duration": period}}
    with Simulation(scene, backend="cpu", precision="f64") as run:
        for time in (period / 6, period):
            run.run(until=time)
            other.integrate(time)
            expected = np.array([[p.x, p.y, p.vx, p.vy] for p in other.particles])
            now = run.snapshot()
            found = np.concatenate([now.position[:, :2], now.velocity[:, :2]], axis=1)
            assert np.abs(found - expected).max() < 5e-14


def test_looks_between_steps_are_as_good_as_steps_and_change_nothing():
    """A planet at e = 0.5 at times that no step ends at, against Kepler's equation; the same bits however often."""
    ends = []
    for looks in (40, 7):
        scene, period = planet(0.5, looks, 3)
        with Simulation(taylor(scene), backend="cpu", precision="f64") as run:
            for _ in range(3 * looks):
                run.run(steps=1)
                now = run.snapshot()
                mean = math.pi + 2 * math.pi * now.time / period
                anomaly = mean
                for _ in range(50):
                    anomaly -= (anomaly - 0.5 * math.sin(anomaly) - mean) / (1 - 0.5 * math.cos(anomaly))
                # Pericentre lies on the negative side of x.
                across = math.sqrt(0.75)
                place = -np.array([math.cos(anomaly) - 0.5, across * math.sin(anomaly)])
                rate = math.sqrt(1.001) / (1 - 0.5 * math.cos(anomaly))
                speed = rate * np.array([math.sin(anomaly), -across * math.cos(anomaly)])
                # Each of some 100 steps rounds; an error of the period grows with the orbits.
                assert np.abs(now.position[1, :2] - now.position[0, :2] - place).max() < 2e-13
                assert np.abs(now.velocity[1, :2] - now.velocity[0, :2] - speed).max() < 2e-13
            ends.append(run.state.coefficient.to_numpy().tobytes() + run.state.velocity_rest.to_numpy().tobytes())
    assert ends[0] == ends[1]


@pytest.mark.sampled(3)
def test_going_back_gives_the_same_bits_again_and_so_do_replicas():
    scene, period = planet(0.6, 5, 4)
    with Simulation(taylor(scene), backend="cpu", precision="f64") as run:
        start = run.snapshot()
        run.run(until=1.5 * period)
        mark = run.mark()
        run.run(until=4 * period)
        alone = run.snapshot()
        run.return_to(mark)
        run.run(until=4 * period)
        again = run.snapshot()
    slower = start.moved(position=start.position, velocity=0.9 * start.velocity, time=0.0, step=0)
    with Simulation(taylor(scene), backend="cpu", precision="f64", replica_starts=[slower, start]) as run:
        run.run(until=4 * period)
        for other in (again, run.snapshot(1)):
            assert np.array_equal(other.position, alone.position) and np.array_equal(other.velocity, alone.velocity)
        assert not np.array_equal(run.snapshot(0).position, alone.position)


@pytest.mark.sampled(3)
def test_the_energy_error_grows_like_round_off():
    """Brouwer's law: the rms over an ensemble grows with the root of the number of steps; a bias would make it grow with it."""
    scene, period = planet(0.3, 1, 4000)
    with Simulation(taylor(scene), backend="cpu", precision="f64") as run:
        start = run.snapshot()
    random = np.random.default_rng(5)
    starts = [
        start.moved(position=start.position, velocity=start.velocity * random.uniform(0.9, 1.1), time=0.0, step=0)
        for _ in range(64)
    ]
    with Simulation(taylor(scene), backend="cpu", precision="f64", replica_starts=starts) as run:

        def energies():
            return np.array([energy_of(run.snapshot(k)) for k in range(len(starts))])

        first = energies()
        orbits, errors = np.array([10, 40, 160, 640]), []
        for count in orbits:
            run.run(until=count * period)
            errors.append(float(np.sqrt(np.mean((energies() / first - 1) ** 2))))
        steps = run.integrator.counts(run.state)[:, run.integrator.STEPS].mean()
    # A step changes velocities by a quarter, so compensated sums round by a quarter of what others do: 0.24 ULP a step was
    # seen, and 0.76 without compensation.
    assert errors[-1] < 0.4 * ULP * math.sqrt(steps)
    # Each rms of 64 has a standard error of 1/√128 = 9 %; over ln 64 = 4.2 that leaves 0.03 of the slope.
    assert np.polyfit(np.log(orbits), np.log(errors), 1)[0] == pytest.approx(0.5, abs=0.15)


def test_a_collision_is_said_and_not_stepped_over():
    """Two bodies fall into each other from a distance of 2: t = π/2 · √(2³/(2·2)) = π/√2."""
    scene = {"dimensions": 2, "forces": [GRAVITY], "particles": bodies((1.0, (-1, 0)), (1.0, (1, 0)))}
    scene |= {"integrator": {"taylor": {}}, "run": {"duration": 5.0}}
    with Simulation(scene, backend="cpu", precision="f64") as run:
        with pytest.raises(
            StabilityError, match="particle 0 and particle 1 meet, .* apart: give the force a softening"
        ) as info:
            run.run()
        assert info.value.time == pytest.approx(math.pi / math.sqrt(2), abs=1e-9)
        assert np.isfinite(run.snapshot().position).all()


def test_a_body_alone_falls_along_a_parabola():
    scene = {
        "dimensions": 2,
        "forces": [{"uniform_gravity": {"acceleration": [0, -2]}}],
        "particles": bodies((1.0, (0, 0), (3, 1))),
        "integrator": {"taylor": {"dt": 0.7}},
        "run": {"duration": 4.0},
    }
    with Simulation(scene, backend="cpu", precision="f64") as run:
        after = run.run().snapshot()
    assert after.position[0, :2] == pytest.approx([12, 4 - 16], rel=4 * ULP)
    assert after.velocity[0, :2] == pytest.approx([3, 1 - 8], rel=4 * ULP)


def test_single_precision_is_as_good_as_it_is():
    """Ten orbits at e = 0.6: some 150 steps, each rounding by 6e-8; of the energy 2/(1 − e) = 5 times that."""
    scene, period = planet(0.6, 3, 10)
    with Simulation(taylor(scene), backend="cpu", precision="f32") as run:
        start = run.snapshot()
        run.run()
        assert abs(energy_of(run.snapshot()) / energy_of(start) - 1) < 2.0**-24 * math.sqrt(150) * 5


def test_what_it_cannot_do_is_refused_in_one_line():
    scene = kepler(integrator="taylor")
    with pytest.raises(BackendError, match="taylor has no parallel plan; there are serial and replicas"):
        Simulation(scene, backend="cpu", plan="parallel")
    drag = {"linear_drag": {"coefficient": 0.1}}
    for forces, said in (
        ([GRAVITY, drag], "taylor: knows no forces but newtonian_gravity, uniform_gravity .*, not linear_drag"),
        ([{"coulomb": {}}], "taylor: knows no forces but newtonian_gravity, uniform_gravity .*, not coulomb"),
        ([GRAVITY, GRAVITY], "taylor: knows one newtonian_gravity, not several"),
        ([], "taylor: needs newtonian_gravity, uniform_gravity"),
    ):
        with pytest.raises(SceneError, match=said):
            Simulation(scene | {"forces": forces}, backend="cpu")
    springs = {"springs": [{"link": {"between": [0, 1], "stiffness": 1.0}}]}
    with pytest.raises(SceneError, match="not springs"):
        Simulation(scene | springs, backend="cpu")
