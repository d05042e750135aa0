"""Methods that step about the centre of mass: the same motion wherever the origin is and however the frame moves."""

import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from reference.two_bodies import largest_error, two_bodies

from mpp_taichi import Simulation, component
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.state.moving_frame import MovingFrame, center, product_in_two
from scenes import cluster

CENTERED = component.marked("integrators", "steps_about_center")
ADAPTIVE = [name for name in CENTERED if component.flag("integrators", name, "controlled_by")]
ULP = 2.0**-52
FAR = (2000.0, -1500.0, 700.0)
FAST = (300.0, -20.0, 5.0)
STILL = (0.0, 0.0, 0.0)
PERICENTRE = 1e-3


def body(mass, position, velocity):
    return {"body": {"mass": mass, "position": [float(c) for c in position], "velocity": [float(c) for c in velocity]}}


def scene_of(bodies, integrator, **more):
    """Bodies (mass, position, velocity) under gravity."""
    return {
        "title": "Bodies",
        "particles": [body(*each) for each in bodies],
        "forces": [{"newtonian_gravity": {"strength": 1.0}}],
        "integrator": integrator,
        **more,
    }


def plunge(integrator, origin=FAR, drift=STILL, pericentre=PERICENTRE):
    """Two bodies of mass 1 from the distance 1, whose pericentre is at 10⁻³, with a centre of mass at `origin`."""
    speed = math.sqrt(2 * 2.0 * pericentre / (1.0 + pericentre))  # relative, at the apocentre
    way, push = np.array([0.48, 0.6, 0.64]), np.array([0.8, -0.64, 0.0]) / math.hypot(0.8, 0.64)
    bodies = [(1.0, np.add(origin, s * 0.5 * way), np.add(drift, s * 0.5 * speed * push)) for s in (-1, 1)]
    return scene_of(bodies, integrator)


def exact(*, origin, drift, dt=2.0**-8, integrator="ias15"):
    """A planetary system whose numbers have so few bits that no shift rounds any of them."""
    bodies = [
        (1.0, (0.5, 0.0, 0.125), (0.0, 0.25, 0.0)),
        (2.0**-5, (-0.75, 0.25, 0.0), (0.125, -0.625, 0.25)),
        (2.0**-6, (0.25, -1.5, -0.5), (0.75, 0.5, -0.5)),
    ]
    moved = [(m, np.add(x, origin), np.add(v, drift)) for m, x, v in bodies]
    return scene_of(moved, {integrator: {"dt": dt, **({"order": 8} if integrator == "taylor" else {})}})


def relative(snapshot):
    """Positions and velocities about the first particle."""
    kept = snapshot.comoving or snapshot
    return kept.position - kept.position[0], kept.velocity - kept.velocity[0]


@pytest.mark.sampled(2)
@pytest.mark.parametrize("name", ["ias15", "taylor", "adaptive_dop853"])
@pytest.mark.parametrize("origin", [STILL, FAR], ids=["near", "far"])
@pytest.mark.parametrize("drift", [STILL, FAST], ids=["at rest", "moving"])
def test_a_plunge_is_right_to_1e_11_wherever_it_happens(name, origin, drift):
    integrator = {name: {"dt": 0.25, **({"tolerance": 1e-15} if name == "adaptive_dop853" else {})}}
    with Simulation(plunge(integrator, origin, drift), backend="cpu", precision="f64") as run:
        start, now = run.start, run.run(until=1.25).snapshot()
        expected = two_bodies(start.mass, start.position, start.velocity, run.time)
    # The place of the centre of mass is rounded three times, in the product, in the sum and in the sum with the position.
    rounding = 2 * ULP * np.abs(now.position).max()
    assert largest_error(now.position, expected) < 1e-11 + rounding


@pytest.mark.sampled(3)
@pytest.mark.parametrize("plan", ["serial", "parallel"])
@pytest.mark.parametrize("name", CENTERED)
def test_the_bits_of_a_motion_depend_on_neither_the_origin_nor_the_frame(name, plan):
    if plan == "parallel" and name in (*ADAPTIVE, "wisdom_holman"):
        pytest.skip("has no parallel plan")
    found = []
    for origin, drift in ((STILL, STILL), ((2048.0, -512.0, 64.0), (256.0, -32.0, 4.0))):
        with Simulation(exact(origin=origin, drift=drift, integrator=name), backend="cpu", precision="f64", plan=plan) as run:
            found.append(relative(run.run(steps=96).snapshot()))
    assert np.array_equal(found[0][0], found[1][0]) and np.array_equal(found[0][1], found[1][1])


@pytest.mark.sampled(2)
@pytest.mark.parametrize("precision", ["f32", "f32c", "ds", "f64"])
def test_no_precision_loses_digits_far_from_the_origin(precision):
    found = []
    for origin, drift in ((STILL, STILL), ((2048.0, -512.0, 64.0), (256.0, -32.0, 4.0))):
        scene = exact(origin=origin, drift=drift, integrator="rkn8")
        with Simulation(scene, backend="cpu", precision=precision) as run:
            found.append(relative(run.run(steps=96).snapshot()))
    assert np.array_equal(found[0][0], found[1][0]) and np.array_equal(found[0][1], found[1][1])


@pytest.mark.sampled(2)
@pytest.mark.parametrize("seed", range(20))
def test_no_bit_of_a_start_is_lost_in_the_frame_of_the_centre(seed):
    """Values far from zero or near it, of small extent or large: their differences from the centre are exact."""
    random = np.random.default_rng(seed)
    far, extent = 10.0 ** random.uniform(-3, 6), 10.0 ** random.uniform(-9, 3)
    values = far * random.normal(size=3) + extent * random.uniform(-1, 1, (7, 3))
    mass = random.uniform(0.0, 1.0, 7)
    found = center(values, mass)
    apart = values - found
    rounded = np.abs(values) < 0.5 * np.abs(apart)  # these cannot be exact in 53 bits
    exact_apart = np.vectorize(Fraction)(values) - np.vectorize(Fraction)(found)
    assert np.all((np.vectorize(Fraction)(apart) == exact_apart) | rounded) and not rounded.all()
    mean = mass @ values / mass.sum()
    assert np.all(np.abs(found - mean) < 8 * ULP * np.abs(values).max() + 2.0**-30 * np.abs(values - mean).max())


def test_a_system_at_rest_about_the_origin_keeps_its_numbers():
    values = np.array([[1.0, 0.3, -0.2], [-1.0, -0.3, 0.2]])
    assert not center(values, np.ones(2)).any()
    assert not center(values + 1e-16, np.ones(2)).any(), "rounding of the start is no centre"
    assert np.isfinite(center(np.array([[np.nan, 0.0], [1.0, 0.0]]), np.ones(2))).all()
    assert np.array_equal(center(np.full((3, 2), 0.3), np.ones(3)), [0.3, 0.3])


@pytest.mark.sampled(2)
@pytest.mark.parametrize("name", ["rkn8", "dop853", "wisdom_holman", "taylor"])
def test_a_run_divided_by_a_state_file_has_the_bits_of_the_whole(name, tmp_path):
    scene = exact(origin=(0.1, 0.2, 0.3), drift=(1 / 3, 0.1, -0.7), dt=0.01, integrator=name)
    with Simulation(scene, backend="cpu", precision="f64") as run:
        middle = run.run(steps=37).snapshot()
        run.checkpoint(tmp_path / "middle.npz")
        kept = run.snapshot().comoving
        whole = run.run(steps=23).snapshot()
    with Simulation(scene, backend="cpu", precision="f64", start=Snapshot.load(tmp_path / "middle.npz")) as run:
        again = run.snapshot()
        assert np.array_equal(again.position, middle.position) and np.array_equal(again.velocity, middle.velocity)
        assert np.array_equal(again.comoving.position, kept.position) and np.array_equal(again.comoving.elapsed, kept.elapsed)
        if name in ("rkn8", "dop853"):  # the others begin anew with a state
            end = run.run(steps=23).snapshot()
            assert np.array_equal(end.position, whole.position) and np.array_equal(end.velocity, whole.velocity)


def test_a_state_that_was_changed_has_no_frame_of_its_own():
    scene = exact(origin=FAR, drift=FAST, integrator="dop853")
    with Simulation(scene, backend="cpu", precision="f64") as run:
        middle = run.run(steps=5).snapshot()
    nudged = replace(middle, position=middle.position + 1.0)
    with Simulation(scene, backend="cpu", precision="f64", start=nudged) as run:
        assert np.array_equal(run.snapshot().position, nudged.position)


@pytest.mark.parametrize("name", ["dop853", "ias15", "wisdom_holman"])
@pytest.mark.sampled(3)
def test_a_moment_comes_back_bit_for_bit_and_a_launch_may_be_divided(name):
    scene = exact(origin=FAR, drift=FAST, dt=0.01, integrator=name)
    with Simulation(scene, backend="cpu", precision="f64") as run:
        whole = run.run(steps=60).snapshot()
        run.restart()
        for steps in (1, 7, 2):
            run.run(steps=steps)
        mark, middle = run.mark(), run.snapshot()
        ahead = run.snapshot_ahead(0.005)
        end = run.run(steps=50).snapshot()
        run.return_to(mark)
        back = run.snapshot()
        again = run.run(steps=50).snapshot()
    assert np.array_equal(whole.position, end.position) and np.array_equal(whole.velocity, end.velocity)
    assert np.array_equal(back.position, middle.position) and np.array_equal(again.position, end.position)
    # Half a step of the frame's own motion, up to what the accelerations of order 1 add.
    assert np.abs(ahead.position - middle.position - 0.005 * middle.velocity).max() < 0.005**2 * 10


@pytest.mark.sampled(3)
def test_replicas_have_frames_of_their_own():
    scene = exact(origin=STILL, drift=STILL, integrator="dop853")
    with Simulation(scene, backend="cpu", precision="f64") as run:
        start = run.start
        starts = [
            start.moved(position=start.position + k * 1000.3, velocity=start.velocity + k, time=0, step=0) for k in range(3)
        ]
        alone = []
        for each in starts:
            run.restart()
            run.state.write(each.position, each.velocity)
            alone.append(run.run(steps=40).snapshot())
    with Simulation(scene, backend="cpu", precision="f64", replica_starts=starts) as run:
        run.run(steps=40)
        for k, expected in enumerate(alone):
            assert np.array_equal(run.snapshot(k).position, expected.position)
            assert np.array_equal(run.snapshot(k).velocity, expected.velocity)


def test_a_product_in_two_numbers_is_the_exact_product_rounded_once_more():
    """Equal to fractions bit for bit, also where halves of a number or their products leave the range of floats."""
    rng = np.random.default_rng(3)
    cases = [(float(rng.integers(0, 2 ** int(rng.integers(1, 53)))), rng.uniform(-1, 1) * 2.0**k) for k in range(-1060, 960)]
    for a, b in [*cases, (3.0, 5e-324), (2.0**53, 1e-310), (1e300, 0.1), (1.0, 1e-200), (0.0, 0.1)]:
        exact_product = Fraction(a) * Fraction(b)
        high, low = product_in_two(a, b)
        assert (high, low) == (float(exact_product), float(exact_product - Fraction(high))), (a, b)
    assert product_in_two(1e300, 1e300) == (math.inf, 0.0)


@pytest.mark.parametrize("replicas", [1, 3])
def test_the_time_of_a_frame_is_kept_in_two_numbers_over_any_launches(replicas):
    """Each launch rounds the sum by 2⁻¹⁰⁶ of the time at most, a few times."""
    rng, count = np.random.default_rng(4), 300
    frame = MovingFrame(np.zeros((replicas, 3)), np.zeros((replicas, 3)), np.zeros((replicas, 2)), np.zeros(()))
    time = Fraction(0)
    for steps, dt in zip(rng.integers(1, 10**6, count).tolist(), rng.uniform(0.0, 0.1, count).tolist()):
        frame, time = frame.later(steps, dt), time + steps * Fraction(dt)
    assert frame.elapsed.shape == (replicas, 2)
    for high, low in frame.elapsed.tolist():
        assert abs(Fraction(high) + Fraction(low) - time) <= count * 4 * time / 2**106
        assert high == float(time)


@pytest.mark.sampled(3)
def test_a_free_body_goes_on_uniformly_for_ever():
    """One body, and bodies far apart that do not act on each other: the place is rounded once, not in every step."""
    scene = {
        "title": "Free",
        "particles": [body(1.0, (1 / 3, 0, 0), (1 / 3, 0.1, 0)), body(1.0, (1 / 3, 1, 0), (1 / 3, 0.1, 0))],
        "springs": [{"link": {"between": [0, 1], "stiffness": 1.0, "rest_length": 1.0}}],
        "integrator": {"dop853": {"dt": 2.0**-9}},
    }
    with Simulation(scene, backend="cpu", precision="f64") as run:
        start, now = run.start, run.run(steps=100_000).snapshot()
    expected = [[float(x) for x in row] for row in start.position + start.velocity * (100_000 * 2.0**-9)]
    assert np.abs(now.position - expected).max() <= 2 * ULP * np.abs(expected).max()


@pytest.mark.parametrize(
    "more",
    [
        {"forces": [{"newtonian_gravity": {"strength": 1.0}}, {"uniform_gravity": {"acceleration": [0, 0, -1]}}]},
        {"forces": [{"newtonian_gravity": {"strength": 1.0}}, {"linear_drag": {"coefficient": 0.1}}]},
        {"particles": [{"body": {"mass": 1.0, "position": [0, 0, 0], "free": False}}, body(1.0, (5, 0, 0), (0, 1, 0))]},
    ],
    ids=["external force", "drag", "held"],
)
def test_what_ties_the_bodies_to_the_origin_leaves_them_in_the_frame_of_the_scene(more):
    scene = exact(origin=FAR, drift=FAST, integrator="dop853") | more
    with Simulation(scene, backend="cpu", precision="f64") as run:
        assert run.snapshot().comoving is None
        assert np.array_equal(run.state.position.to_numpy(), run.start.position)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("name", sorted(set(component.names("integrators")) - set(CENTERED) - {"event_driven", "langevin"}))
def test_methods_of_low_order_step_in_the_frame_of_the_scene(name):
    assert component.flag("integrators", name, "order", 0) < 6 or name == "janus"
    with Simulation(exact(origin=FAR, drift=FAST, integrator=name), backend="cpu", precision="f64") as run:
        assert run.state.frame is None


def test_every_adaptive_method_and_every_method_of_high_order_steps_about_the_centre():
    for name in component.names("integrators"):
        order, adaptive = (component.flag("integrators", name, key) for key in ("order", "controlled_by"))
        if adaptive or (order or 0) >= 6:
            assert name in CENTERED


@pytest.mark.sampled(3)
def test_energies_and_momenta_are_those_of_the_frame_of_the_scene():
    """König: K = K′ + ½ M V², L = L′ + M X × V, and the errors are those of the motion about the centre, or of rounding."""
    values = []
    for origin, drift in ((STILL, STILL), (FAR, FAST)):
        with Simulation(exact(origin=origin, drift=drift, integrator="ias15"), backend="cpu", precision="f64") as run:
            found = [run.mechanics(), run.run(steps=200).mechanics()]
        values.append(found)
    for near, far in zip(*values):
        mass, drift, place = 1.0 + 2.0**-5 + 2.0**-6, np.array(FAST), np.array(FAR)
        momentum = near["momentum"]
        kinetic = near["kinetic_energy"] + drift @ momentum + 0.5 * mass * drift @ drift
        assert far["kinetic_energy"] == pytest.approx(kinetic, rel=8 * ULP)
        assert far["potential_energy"] == near["potential_energy"]
        assert far["momentum"] == pytest.approx(momentum + mass * drift, rel=8 * ULP)
        middle = near["center_of_mass"]
        turned = near["angular_momentum"] + np.cross(mass * middle, drift) + np.cross(place, momentum + mass * drift)
        # The frame has moved by drift t, along which momentum has a part of its own.
        turned = turned + np.cross(drift * far["time"], momentum)
        assert np.abs(far["angular_momentum"] - turned).max() < 16 * ULP * far["angular_momentum_scale"]
    start, end = values[1]
    assert np.abs(end["angular_momentum"] - start["angular_momentum"]).max() < 16 * ULP * end["angular_momentum_scale"]
    assert abs(end["total_energy"] - start["total_energy"]) < 16 * ULP * end["total_energy"]


@pytest.mark.parametrize("name", ["dop853", "ias15"])
@pytest.mark.sampled(3)
def test_the_energy_balance_of_a_moving_network_is_that_of_the_scene(name):
    scene = {
        "title": "Damped",
        "particles": [body(1.0, (1000, 0, 0), (30, 0, 0)), body(2.0, (1001.5, 0, 0), (30, 0.5, 0))],
        "springs": [{"link": {"between": [0, 1], "stiffness": 4.0, "rest_length": 1.0, "damping": 0.2}}],
        "integrator": {name: {"dt": 2.0**-6}},
    }
    with Simulation(scene, backend="cpu", precision="f64") as run:
        run.keep_energy_balance()
        first = run.diagnostics()
        last = run.run(steps=256).diagnostics()
    assert first["energy_balance_residual"] == pytest.approx(0.0, abs=8 * ULP * first["total_energy"])
    assert last["dissipated_energy"] > 0.1
    # The powers are integrated to fourth order in dt.
    assert abs(last["energy_balance_residual"]) < 1e-6 and last["energy_turnover"] > 1350


@pytest.mark.sampled(3)
def test_a_phase_goes_on_in_the_same_frame_and_with_other_masses_about_the_new_centre():
    """No phase loses digits below the distant origin; a field ties the bodies to the frame of the scene for a while."""

    def scene(*timeline):
        return {
            "title": "Phases",
            "particles": [body(1.0, (1000.1, 0, 0), (30.3, 0, 0)), body(2.0, (1001.6, 0, 0), (30.3, 0.5, 0))],
            "springs": [{"link": {"between": [0, 1], "stiffness": 4.0, "rest_length": 1.0}}],
            "integrator": {"rkn8": {"dt": 2.0**-6}},
            "timeline": list(timeline),
            "run": {"duration": 2.0},
        }

    stiffer = {"at": 0.5, "set": {"springs[0].link.stiffness": 9.0}}
    heavier = {"at": 0.75, "set": {"particles[0].body.mass": 3.0}}
    falling = {"at": 1.0, "set": {"forces": [{"uniform_gravity": {"acceleration": [0, 0, -1]}}]}}
    free = {"at": 1.5, "set": {"forces": []}}
    with Simulation(scene(stiffer), backend="cpu", precision="f64") as run:
        before = run.run(steps=30).snapshot()
        inside = run.run(until=0.5).snapshot()
        assert np.array_equal(inside.comoving.origin, before.comoving.origin)
        expected = run.run(until=0.75).snapshot()
    with Simulation(scene(stiffer, heavier, falling, free), backend="cpu", precision="f64") as run:
        found = run.run(until=0.75).snapshot()
        assert not np.array_equal(found.comoving.drift, expected.comoving.drift)
        for one, other in zip(relative(found), relative(expected)):  # rounded about the new centre, and not far from it
            assert np.abs(one - other).max() <= 2 * ULP * np.abs(other).max()
        assert np.abs(found.mass @ found.comoving.velocity).max() < 2.0**-29 * np.abs(found.comoving.velocity).max() * 5.0
        assert np.abs(found.position - expected.position).max() <= 4 * ULP * np.abs(expected.position).max()
        assert run.run(until=1.0).snapshot().comoving is None
        assert run.run(until=1.5).snapshot().comoving is not None
        end, energy = run.run(until=2.0).snapshot(), run.mechanics()["total_energy"]
        run.restart()
        assert np.array_equal(run.run(until=2.0).snapshot().position, end.position)
        assert run.mechanics()["total_energy"] == energy


@pytest.mark.sampled(3)
def test_spheres_that_collide_in_a_moving_frame_collide_as_at_rest():
    def scene(origin, drift):
        made = scene_of(
            [
                (1.0, np.add(origin, (-1.0, 0.0, 0.0)), drift),
                (2.0, np.add(origin, (1.0, 0.125, 0.0)), np.add(drift, (-1.0, 0.0, 0.0))),
            ],
            {"ias15": {"dt": 0.125}},
            contacts={"hard_spheres": {"solver": "located"}},
        )
        for entry in made["particles"]:
            entry["body"]["radius"] = 0.25
        return made

    found = []
    for origin, drift in ((STILL, STILL), ((2048.0, -512.0, 64.0), (256.0, -32.0, 4.0))):
        with Simulation(scene(origin, drift), backend="cpu", precision="f64") as run:
            found.append(relative(run.run(steps=24).snapshot()))
            assert run.contact_report.pair_count > 0
    assert np.array_equal(found[0][0], found[1][0]) and np.array_equal(found[0][1], found[1][1])


@pytest.mark.parametrize("name", ["rkn8", pytest.param("ias15", marks=pytest.mark.sampled(3)), "dop853"])
def test_a_cluster_far_from_the_origin_moves_as_at_the_origin(name):
    """From the same numbers, rounded to 40 bits so that they are numbers far from the origin as well."""
    scene = cluster(8, softening=0.2, dt=0.02, integrator=name)
    with Simulation(scene, backend="cpu", precision="f64") as run:
        start = run.start
    unit = 2.0**-40
    near = start.moved(position=np.rint(start.position / unit) * unit, velocity=start.velocity, time=0.0, step=0)
    far = near.moved(position=near.position + np.array((4096.0, -1024.0, 512.0)), velocity=near.velocity, time=0.0, step=0)
    found = []
    for each in (near, far):
        with Simulation(scene, backend="cpu", precision="f64", start=each) as run:
            found.append(relative(run.run(steps=100).snapshot())[0])
    assert np.array_equal(*found)


def test_kinetic_energies_of_unknown_frames_stay_in_double_precision():
    """The frame's own part of the energy in f32, where masses are rounded."""
    scene = exact(origin=FAR, drift=FAST, integrator="dop853")
    with Simulation(scene, backend="cpu", precision="f32") as run:
        run.keep_energy_balance()
        found = run.diagnostics()
        assert found["energy_balance_residual"] == pytest.approx(0.0, abs=2.0**-22 * found["total_energy"])
