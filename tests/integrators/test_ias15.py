"""IAS15 against closed forms and REBOUND's IAS15, and in cases where adaptive steps are difficult."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from mpp_taichi import BackendError, SceneError, Simulation, StabilityError
from mpp_taichi.device import backends
from mpp_taichi.integrators import _radau
from mpp_taichi.integrators._radau_polynomial import ITERATIONS, RadauPolynomial
from scenes import kepler

ULP = 2.0**-52
TWO_BODY = {"forces": [{"newtonian_gravity": {"strength": 1.0}}], "integrator": {"ias15": {}}, "dimensions": 2}
PYTHAGORAS = ((3.0, (1.0, 3.0)), (4.0, (-2.0, -1.0)), (5.0, (1.0, -1.0)))


def bodies(*entries):
    """Particles from (mass, position) or (mass, position, velocity)."""
    return [
        {"body": {"mass": mass, "position": list(place), "velocity": list(rest[0]) if rest else [0, 0]}}
        for mass, place, *rest in entries
    ]


def planet(eccentricity, looks, orbits):
    """A planet of mass 1e-3 from its greatest distance, semi-major axis 1, looked at so often in each orbit."""
    total = 1.001
    speed = math.sqrt(total * (1 - eccentricity) / (1 + eccentricity))
    period = 2 * math.pi / math.sqrt(total)
    scene = TWO_BODY | {
        "particles": bodies((1.0, (0, 0)), (1e-3, (1 + eccentricity, 0), (0, speed))),
        "move_to_center_of_mass": True,
        "integrator": {"ias15": {"dt": period / looks}},
        "run": {"duration": orbits * period},
    }
    return scene, period


def test_the_nodes_are_those_of_radau_and_the_two_bases_are_inverse():
    nodes = np.array([0.0, *_radau.radau_nodes(7)])
    # Weights that integrate s^0 … s^7 exactly must then integrate up to s^14 as well, and no further: that makes the nodes.
    weights = np.linalg.solve(np.vander(nodes, 8, increasing=True).T, 1 / np.arange(1, 9))
    errors = [weights @ nodes**k - 1 / (k + 1) for k in range(16)]
    assert np.abs(errors[:15]).max() < 64 * ULP < 1e-9 < abs(errors[15])
    size = len(nodes) - 1
    powers, differences = np.zeros((2, size, size))
    for k, (row, other) in enumerate(
        zip(_radau.powers_of_differences(tuple(nodes[1:])), _radau.differences_of_powers(tuple(nodes[1:])))
    ):
        powers[k, : k + 1], differences[k, : k + 1] = row, other
    assert np.abs(powers @ differences - np.eye(size)).max() < 64 * ULP
    s = 0.3
    products = [s * np.prod(s - nodes[1 : j + 1]) for j in range(size)]
    assert powers @ s ** np.arange(1, size + 1) == pytest.approx(products, rel=1e-12)


LAST_NODE = 7
COURSES = {  # what the iterations find at the last node, and how many of them there are
    "nothing changes": (lambda k: 0.0, 1),
    "the second changes nothing": (lambda k: 1.0, 2),
    "the changes do not fall": (lambda k: (-1.0) ** k, 3),
    "the changes fall all the time": (lambda k: 2.0 - 2.0**-k, ITERATIONS),
}


@pytest.mark.parametrize("course", COURSES)
def test_a_step_is_iterated_until_the_changes_are_zero_or_stop_falling_or_the_limit(course):
    """The acceleration is 0 but at the last node, where it is a given number in each iteration."""
    import taichi as ti

    backends.start("cpu", "f64")
    given, expected = COURSES[course]
    path = RadauPolynomial()
    fields = {name: ti.Vector.field(1, float, 1) for name in path.work_fields(1)}
    state = SimpleNamespace(dimensions=1, wide=ti.f64, measure=ti.field(ti.f64, 2), **fields)
    forces, calls, found = SimpleNamespace(particle_count=1), ti.field(ti.i32, ()), ti.field(float, ITERATIONS + 2)
    found.from_numpy(np.array([given(k) for k in range(ITERATIONS + 2)]))

    @ti.data_oriented
    class Law:
        @ti.func
        def place(self, state: ti.template(), forces: ti.template(), first, node, h):
            pass

        @ti.func
        def evaluate(self, state: ti.template(), forces: ti.template(), first, time, shape: ti.template()):
            calls[None] += 1

        @ti.func
        def found(self, state: ti.template(), forces: ti.template(), first, i, time):
            result = ti.Vector.zero(float, 1)
            if calls[None] % LAST_NODE == 0:
                result[0] = found[calls[None] // LAST_NODE]
            return result

    law = Law()

    @ti.kernel
    def solve():
        for _ in range(1):
            path.solve(state, forces, law, 0, 0.0, 1.0, "serial")

    solve()
    assert calls[None] == LAST_NODE * expected


@pytest.mark.sampled(3)
@pytest.mark.parametrize("eccentricity", [0.9, 0.99, 0.999])
def test_a_hundred_orbits_end_where_they_began(eccentricity):
    scene, period = planet(eccentricity, 3, 100)
    with Simulation(scene, backend="cpu", precision="f64") as run:
        energy, start = run.mechanics()["total_energy"], run.snapshot()
        run.run()
        after = run.snapshot()
        assert abs(run.mechanics()["total_energy"] / energy - 1) < 1e-12
        assert np.abs(after.position - start.position).max() < 1e-6


@pytest.mark.sampled(3)
def test_looks_between_steps_are_as_good_as_steps_and_change_nothing():
    """A planet at e = 0.5 at times that no step ends at, against Kepler's equation; the same bits however often."""
    ends = []
    for looks in (40, 7):
        scene, period = planet(0.5, looks, 3)
        with Simulation(scene, backend="cpu", precision="f64") as run:
            for _ in range(3 * looks):
                run.run(steps=1)
                now = run.snapshot()
                mean = math.pi + 2 * math.pi * now.time / period
                anomaly = mean
                for _ in range(50):
                    anomaly -= (anomaly - 0.5 * math.sin(anomaly) - mean) / (1 - 0.5 * math.cos(anomaly))
                # Pericentre lies on the negative side of x.
                place = -np.array([math.cos(anomaly) - 0.5, math.sqrt(0.75) * math.sin(anomaly)])
                found = now.position[1, :2] - now.position[0, :2]
                # Each of some 80 steps an orbit rounds; an error of the period grows with the orbits.
                assert np.abs(found - place).max() < 2e-13
            ends.append(np.concatenate([run.state.start_position.to_numpy(), run.state.start_velocity.to_numpy()]).tobytes())
    assert ends[0] == ends[1]


@pytest.mark.sampled(6)
@pytest.mark.parametrize("precision, limit", [("f64", 1e-13), ("f32", 1e-5)])
def test_the_figure_eight_does_not_stall_where_an_acceleration_is_zero(precision, limit):
    """At T/6 a body passes the centre between the two others: its acceleration is zero, and no measure of a step may be."""
    place, speed = (0.97000436, -0.24308753), (-0.93240737, -0.86473146)
    half = (-speed[0] / 2, -speed[1] / 2)
    scene = TWO_BODY | {
        "particles": bodies((1.0, place, half), (1.0, (-place[0], -place[1]), half), (1.0, (0, 0), speed)),
        "run": {"duration": 10 * 6.32591398},
    }
    with Simulation(scene, backend="cpu", precision=precision) as run:
        energy = run.mechanics()["total_energy"]
        run.run()
        assert abs(run.mechanics()["total_energy"] / energy - 1) < limit
        assert run.integrator.counts(run.state)[0, run.integrator.STEPS] < 2000


@pytest.mark.sampled(3)
def test_a_body_at_rest_on_a_relaxed_spring_shortens_no_step():
    """Its acceleration begins as a square of the time, so that the time in which it changes is proportional to the step."""
    scene = {
        "particles": [
            {"body": {"name": "rest", "position": [0, 2, 0], "mass": 1}},
            {"body": {"name": "hinge", "position": [0, 0, 0], "velocity": [0, 0, 0.1], "mass": 0.2}},
            {"body": {"name": "end", "position": [0.5, 0, 0], "velocity": [0, 0.3, 0], "mass": 0.2}},
        ],
        "springs": [
            {"link": {"between": ["rest", "hinge"], "stiffness": 3}},
            {"link": {"between": ["hinge", "end"], "stiffness": 7, "prestretch": 1.1}},
        ],
        "integrator": {"ias15": {"dt": 0.05}},
        "run": {"duration": 2.0},
    }
    with Simulation(scene, backend="cpu", precision="f64") as simulation:
        before = simulation.mechanics()["total_energy"]
        simulation.run()
        assert abs(simulation.mechanics()["total_energy"] - before) < 40 * 2.0**-53  # a rounding a step


def test_three_bodies_of_pythagoras_part_as_rebound_says():
    """Burrau's problem: encounters to 1e-3 of the start's size before one body leaves; errors grow by some 1e6 until t = 30."""
    rebound = pytest.importorskip("rebound")
    other = rebound.Simulation()
    other.integrator = "ias15"
    for mass, (x, y) in PYTHAGORAS:
        other.add(m=mass, x=x, y=y)
    other.integrate(30.0)
    scene = TWO_BODY | {"particles": bodies(*PYTHAGORAS), "run": {"duration": 30.0}}
    with Simulation(scene, backend="cpu", precision="f64") as run:
        after = run.run().snapshot()
    expected = np.array([[p.x, p.y] for p in other.particles])
    assert np.abs(after.position[:, :2] - expected).max() < 1e-7


def test_a_collision_is_said_and_not_stepped_over():
    """Two bodies fall into each other from a distance of 2: t = π/2 · √(2³/(2·2)) / √… = π / √2."""
    scene = TWO_BODY | {"particles": bodies((1.0, (-1, 0)), (1.0, (1, 0))), "run": {"duration": 5.0}}
    with Simulation(scene, backend="cpu", precision="f64") as run:
        with pytest.raises(
            StabilityError, match="particle 0 and particle 1 meet, .* apart: give the force a softening"
        ) as info:
            run.run()
        assert info.value.time == pytest.approx(math.pi / math.sqrt(2), abs=1e-9)
        assert np.isfinite(run.snapshot().position).all()


@pytest.mark.sampled(3)
def test_drag_and_a_force_in_time_against_closed_forms():
    scene = TWO_BODY | {
        "forces": [{"linear_drag": {"coefficient": 0.7}}, {"uniform_gravity": {"acceleration": [0, -2]}}],
        "particles": bodies((1.0, (0, 0), (3, 1))),
        "run": {"duration": 4.0},
    }
    with Simulation(scene, backend="cpu", precision="f64") as run:
        after = run.run().snapshot()
    decay, final = math.exp(-0.7 * 4), -2 / 0.7
    assert after.velocity[0, :2] == pytest.approx([3 * decay, final + (1 - final) * decay], abs=1e-14)
    assert after.position[0, :2] == pytest.approx(
        [3 * (1 - decay) / 0.7, 4 * final + (1 - final) * (1 - decay) / 0.7], abs=1e-13
    )


@pytest.mark.sampled(3)
def test_replicas_go_on_alone_and_give_the_bits_of_one():
    scene, period = planet(0.6, 5, 4)
    with Simulation(scene, backend="cpu", precision="f64") as run:
        start = run.snapshot()
        run.run()
        alone = run.snapshot()
    slower = start.moved(position=start.position, velocity=0.9 * start.velocity, time=0.0, step=0)
    with Simulation(scene, backend="cpu", precision="f64", replica_starts=[slower, start]) as run:
        run.run()
        assert np.array_equal(run.snapshot(1).position, alone.position) and np.array_equal(
            run.snapshot(1).velocity, alone.velocity
        )
        assert not np.array_equal(run.snapshot(0).position, alone.position)


@pytest.mark.sampled(3)
def test_going_back_gives_the_same_bits_again():
    scene, period = planet(0.6, 5, 4)
    with Simulation(scene, backend="cpu", precision="f64") as run:
        run.run(until=1.5 * period)
        mark = run.mark()
        run.run()
        first = run.snapshot()
        run.return_to(mark)
        run.run()
        assert np.array_equal(run.snapshot().position, first.position) and np.array_equal(
            run.snapshot().velocity, first.velocity
        )


@pytest.mark.sampled(3)
def test_the_energy_error_grows_like_round_off():
    """Brouwer's law: the rms over an ensemble grows with the root of the number of steps; a bias would make it grow with it."""
    scene, period = planet(0.3, 1, 4000)
    with Simulation(scene, backend="cpu", precision="f64") as run:
        start = run.snapshot()
    random = np.random.default_rng(5)
    starts = [
        start.moved(position=start.position, velocity=start.velocity * random.uniform(0.9, 1.1), time=0.0, step=0)
        for _ in range(64)
    ]

    def energies(run):
        found = []
        for k in range(len(starts)):
            now = run.snapshot(k)
            # Round-off of this sum must not hide that of the run.
            x, v = now.position.astype(np.longdouble), now.velocity.astype(np.longdouble)
            distance = np.sqrt(((x[1] - x[0]) ** 2).sum())
            found.append(0.5 * (now.mass[:, None] * v**2).sum() - now.mass.prod() / distance)
        return np.array(found)

    with Simulation(scene, backend="cpu", precision="f64", replica_starts=starts) as run:
        first = energies(run)
        orbits, errors = np.array([10, 40, 160, 640]), []
        for count in orbits:
            run.run(until=count * period)
            errors.append(float(np.sqrt(np.mean((energies(run) / first - 1) ** 2))))
        steps = run.integrator.counts(run.state)[:, run.integrator.STEPS].mean()
    assert errors[-1] < 1e-15 * math.sqrt(steps)
    # Each rms of 64 has a standard error of 1/√128 = 9 %; over ln 64 = 4.2 that leaves 0.03 of the slope.
    assert np.polyfit(np.log(orbits), np.log(errors), 1)[0] == pytest.approx(0.5, abs=0.15)


def test_what_it_cannot_do_is_refused_in_one_line():
    with pytest.raises(BackendError, match="ias15 has no parallel plan; there are serial and replicas"):
        Simulation(kepler(integrator="ias15"), backend="cpu", plan="parallel")
    contacts = {"contacts": {"hard_spheres": {"solver": "swept"}}, "run": {"duration": 1.0}}
    with pytest.raises(SceneError, match="ias15"):
        Simulation(TWO_BODY | contacts | {"particles": bodies((1.0, (0, 0)))}, backend="cpu")
