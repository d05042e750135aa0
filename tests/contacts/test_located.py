"""Contacts located on the steps of adaptive methods: closed forms, any speed, and refused scenes."""

import math

import numpy as np
import pytest

from mpp_taichi import SceneError, Simulation, StabilityError, component
from mpp_taichi.contacts._report import ContactReport
from mpp_taichi.scene.load import load_scene

EPSILON = 2.0**-52
CHEAP = "adaptive_bogacki_shampine"  # of third order: straight ways and parabolas are its own, and it compiles soonest
CUT_AT_CONTACTS = component.marked("integrators", "begins_anew")


def scene(bodies, *, integrator=CHEAP, dt=1.0, walls=(), forces=(), dimensions=2, contacts=None, **more):
    chosen = integrator if isinstance(integrator, dict) else {integrator: {}}
    name, parameters = next(iter(chosen.items()))
    return {
        "dimensions": dimensions,
        "particles": [{"body": {"mass": 1.0} | body} for body in bodies],
        "contacts": {"hard_spheres": {"solver": "located"} | (contacts or {})},
        "walls": list(walls),
        "forces": list(forces),
        "integrator": {name: {"dt": dt} | parameters},
        "run": {"duration": 1e6},
    } | more


def simulation(*arguments, **more):
    return Simulation(scene(*arguments, **more), backend="cpu", precision="f64")


def start(run, position, velocity):
    """From its start time again, with other places and velocities of two components."""
    run.restart()
    run._accounts.contact_report = ContactReport()
    run.state.write(*(np.pad(np.asarray(rows, float), ((0, 0), (0, 1))) for rows in (position, velocity)))
    run.integrator.adopt(run.state, run.dt)


def floor(height=0.0, **more):
    return {"plane": {"point": [0, height], "normal": [0, 1]} | more}


@pytest.mark.sampled(3)
def test_a_graze_from_far_is_found_where_geometry_says_so():
    """A thousand radii between two samples: by b = R (1 ± 1e-9) spheres meet or not; the approach is v √(1 − b²/R²)."""
    reach, speed = 1.0, 1000.0
    with simulation([{"radius": 0.6, "position": [0, 0]}, {"radius": 0.4, "position": [9, 9]}]) as run:
        for off, meets in ((0.0, True), (0.8, True), (1.0 - 1e-9, True), (1.0 + 1e-9, False), (2.0, False)):
            start(run, [[-700.3, off * reach], [0.0, 0.0]], [[speed, 0.0], [0.0, 0.0]])
            run.run(until=2.0)
            assert run.contact_report.pair_count == meets
            if meets:
                deep = math.sqrt(1.0 - off**2)
                n = np.array([deep, -off])  # from the one that comes to the one at rest, which takes what is along it
                # Rounding over a way of 1000, 16 ε 1000, changes b by as much, and n by that over the depth of the contact.
                tolerance = 16.0 * EPSILON * 1000.0 / deep
                assert run.snapshot().velocity[1, :2] == pytest.approx(speed * deep * n, abs=speed * tolerance)
                assert tolerance < 0.01 * deep


@pytest.mark.sampled(3)
def test_a_bouncing_ball_is_where_the_parabolas_lead_after_a_thousand_bounces():
    with simulation(
        [{"radius": 0.1, "position": [0, 1.1], "velocity": [0.01, 0]}],
        walls=[floor()],
        forces=[{"uniform_gravity": {"acceleration": [0, -2]}}],
        dt=500.0,
    ) as run:
        run.run(until=2001.5)  # contacts at 1, 3, 5, …
        assert run.contact_report.wall_count == 1001 and run.contact_report.unresolved == 0
        # Each contact comes at a time rounded by ε t, and a step 8 long sums terms of h² a = 100: 32 ε 100 of place at worst.
        error = 1001 * 2.0 * (EPSILON * 2000.0 + 32.0 * EPSILON * 100.0)
        after = run.snapshot()
        assert after.position[0, :2] == pytest.approx([20.015, 0.1 + 0.75], abs=error)
        assert after.velocity[0, :2] == pytest.approx([0.01, 1.0], abs=2.0 * error)
        assert run.contact_report.largest_overlap < error / 0.1
        assert run.integrator.counts(run.state)[0, run.integrator.STEPS] >= 1001  # a contact costs a step
        assert run.contact_report.wall_impulse[0] == pytest.approx(1001 * 4.0, rel=error)


def test_the_floor_may_move():
    """In the frame of a floor that rises by w all is as on one at rest; the wall of a lift hits harder than the ball falls."""
    w = 0.5
    with simulation(
        [{"radius": 0.1, "position": [0, 1.1], "velocity": [0, w]}],
        walls=[floor(velocity=[0, w])],
        forces=[{"uniform_gravity": {"acceleration": [0, -2]}}],
    ) as run:
        run.run(until=20.5)
        assert run.contact_report.wall_count == 10
        assert run.snapshot().position[0, 1] == pytest.approx(w * 20.5 + 0.1 + 0.75, abs=20 * 32.0 * EPSILON * 100.0)
        assert not run.phase.conserves_energy and not run.phase.gains_no_energy


@pytest.mark.sampled(3)
def test_two_spheres_that_fall_onto_each_other_meet_when_kepler_says():
    """Radial fall from rest at d to R: t = √(d³/2GM) (arccos √x + √(x (1 − x))), x = R/d; then back, as often as one likes."""
    d, masses, reach = 2.0, (1.0, 0.5), 0.02
    x = reach / d
    fall = math.sqrt(d**3 / (2.0 * sum(masses))) * (math.acos(math.sqrt(x)) + math.sqrt(x * (1.0 - x)))
    bodies = [{"mass": m, "radius": 0.01, "position": [p, 0]} for m, p in zip(masses, (0.0, d))]
    forces = [{"newtonian_gravity": {"strength": 1}}]
    with simulation(bodies, integrator={"ias15": {"epsilon": 1e-10}}, forces=forces, dt=0.9 * fall) as run:
        run.run(until=fall * (1.0 - 1e-13))
        assert run.contact_report.pair_count == 0
        # The time is a sum of some 100 steps, each rounded by ε/2 of it at most.
        assert run.state.due.to_numpy()[0] == pytest.approx(fall, rel=50.0 * EPSILON)
        first = run.diagnostics()["total_energy"]
        run.run(until=1999.0 * fall)
        assert run.contact_report.pair_count == 1000
        steps = run.integrator.counts(run.state)[0, run.integrator.STEPS]
        # The potential energy at contact, 100 times that at the start, is rounded in each contact and step, like a walk.
        walk = 100.0 * EPSILON * math.sqrt(steps)
        assert abs(run.diagnostics()["total_energy"] / first - 1.0) < 4.0 * walk
        momentum = run.snapshot().velocity[:, 0] @ masses
        assert abs(momentum) < 10.0 * math.sqrt(steps) * EPSILON  # speeds of 12 at contact


@pytest.mark.sampled(3)
@pytest.mark.parametrize("integrator, tolerances", [("adaptive_dop853", (1e-5, 1e-9, 1e-13)), (CHEAP, (1e-4, 1e-5, 1e-6))])
def test_the_error_of_many_contacts_goes_with_the_tolerance(integrator, tolerances):
    """On a spring above a floor: y = A cos φ down to a = A/3, and up again, for ever; φ = ω t, folded at φ* = arccos (a/A)."""
    turn = math.acos(1.0 / 3.0)
    time = 40.0 * turn + 0.7
    phase = (time + turn) % (2.0 * turn) - turn
    errors = []
    with simulation(
        [{"position": [0, 0], "free": False}, {"radius": 0.1, "position": [0, 1.5]}],
        integrator=integrator,
        walls=[floor(0.4)],
        springs=[{"link": {"between": [0, 1], "stiffness": 1.0, "rest_length": 0.0}}],
        dt=time,
    ) as run:
        for tolerance in tolerances:
            run.integrator.tolerance = tolerance
            run.restart()
            run.run(until=time)
            assert run.contact_report.wall_count == 20
            errors.append(abs(run.snapshot().position[1, 1] - 1.5 * math.cos(phase)))
            # A step errs by the tolerance in parts of 1.5, the size of the motion.
            assert errors[-1] < 1.5 * tolerance * run.integrator.counts(run.state)[0, run.integrator.STEPS]
            run._accounts.contact_report = ContactReport()
    # A method of low order takes so many steps that their errors add smoothly, in proportion to the tolerance.
    if integrator == CHEAP:
        assert np.polyfit(np.log(tolerances), np.log(errors), 1)[0] == pytest.approx(1.0, abs=0.05)


@pytest.mark.sampled(3)
def test_a_bent_path_grazes_where_geometry_says_so():
    """Kepler's ellipses with a pericentre of R (1 ± 1e-9)."""
    reach = 0.3
    bodies = [{"radius": 0.25, "position": [0, 0], "free": False}, {"mass": 1e-9, "radius": 0.05, "position": [1, 1]}]
    method, forces = {"adaptive_dop853": {"tolerance": 1e-13}}, [{"newtonian_gravity": {"strength": 1}}]
    with simulation(bodies, integrator=method, forces=forces) as run:
        for pericentre, meets in ((reach * (1.0 + 1e-9), False), (reach * (1.0 - 1e-9), True)):
            far = 2.0 - pericentre
            start(run, [[0, 0], [far, 0.0]], [[0, 0], [0.0, math.sqrt(pericentre / far)]])
            run.run(until=2.0 * math.pi)
            assert run.contact_report.pair_count == meets


@pytest.mark.sampled(3)
def test_inside_and_outside_of_round_walls_at_any_speed():
    """Between two circles: chords that miss the inner one turn by 2 arccos (b/ρ) each; radial ways are folded."""
    outer, inner, r, speed = 5.0, 1.0, 0.5, 2000.0
    walls = [
        {"sphere": {"center": [0, 0], "radius": outer, "inside": True}},
        {"sphere": {"center": [0, 0], "radius": inner, "inside": False}},
    ]
    with simulation([{"radius": r, "position": [3, 0]}], walls=walls) as run:
        rho, b = outer - r, 2.7
        start(run, [[0.0, -b]], [[speed, 0.0]])
        run.run(until=1.0)
        half = math.sqrt(rho**2 - b**2)
        whole, rest = divmod(speed + half, 2.0 * half)
        turned = 2.0 * math.acos(b / rho) * whole  # each bounce turns the chord by that about the centre
        along, across = np.array([math.cos(turned), math.sin(turned)]), np.array([math.sin(turned), -math.cos(turned)])
        # Rounding of the angle of incidence is kept from bounce to bounce, so that the error grows with their square.
        tolerance = 16.0 * EPSILON * whole**2 * rho
        assert run.contact_report.wall_count == whole
        assert run.snapshot().position[0, :2] == pytest.approx((rest - half) * along + b * across, abs=tolerance)
        start(run, [[0.0, 3.0]], [[0.0, speed]])
        run.run(until=1.0)
        room, reached = rho - inner - r, 3.0 - inner - r + speed
        whole, rest = divmod(reached, room)
        tolerance = whole * EPSILON * (speed + 16.0 * rho)  # a bounce rounds its time, up to 1, and places
        height = inner + r + (room - rest if whole % 2 else rest)
        assert run.contact_report.wall_count == whole
        assert run.snapshot().position[0, :2] == pytest.approx([0.0, height], abs=tolerance)


@pytest.mark.sampled(3)
def test_what_touches_at_the_start_bounces_at_once_or_flies_on():
    """Also where both fall together: what moves both alike does not make the search for their contact any slower."""
    with simulation(
        [{"radius": 0.5, "position": [0, 0]}, {"radius": 0.5, "position": [1, 0]}],
        forces=[{"uniform_gravity": {"acceleration": [0, -9.81]}}],
    ) as run:
        for u, after in ((-1.0, 1.0), (0.0, 0.0), (1.0, 1.0)):
            start(run, [[0, 0], [1, 0]], [[0, 0], [u, 0]])
            run.run(until=2.0)
            moving = int(u < 0.0)
            assert run.contact_report.pair_count == moving
            found = run.snapshot()
            assert found.velocity[1 - moving, 0] == pytest.approx(u, abs=8.0 * EPSILON)
            assert abs(found.position[1, 0] - found.position[0, 0]) == pytest.approx(1.0 + 2.0 * after, abs=64.0 * EPSILON)


@pytest.mark.sampled(3)
def test_a_ball_that_comes_to_rest_wants_a_contact_time_and_never_hangs():
    """With e = 1/2 all bounces are over after (1 + e) / (1 − e) of the first fall."""
    ball = [{"radius": 0.1, "position": [0, 1.1]}]
    options = dict(walls=[floor(restitution=0.5)], forces=[{"uniform_gravity": {"acceleration": [0, -2]}}], dt=0.25)
    with simulation(ball, **options) as run:
        run.run(until=2.75)
        mark = run.mark()
        with pytest.raises(StabilityError, match="100,000 contacts between two samples, .* try a contact_time") as caught:
            run.run(until=4.0)
        assert caught.value.time == 2.75 and run.snapshot().time == 2.75
        run.return_to(mark)
        run.try_steps(2)
        report = run.contacts.collect()
        # Flights of 2^(1−k) are below 64 roundings of a time of 3 after 45, three of them before 2.75; then a thousand more.
        assert report.unresolved == 1 and report.wall_count == pytest.approx(1042, abs=8)
    with simulation(ball, **options, contacts={"event_limit": 10}) as run:
        run.run(until=2.75)
        with pytest.raises(StabilityError, match="more than 10 contacts between two samples"):
            run.run(until=3.0)
    contact_time = 1e-3
    with simulation(ball, **options, contacts={"contact_time": contact_time}) as run:
        run.run(until=10.0)
        report = run.contact_report
        # The k-th flight lasts 2^(1−k): it is shorter than t_c from k = 11 on, and all that follow are as long.
        assert report.elastic_count == pytest.approx((10.0 - 3.0) / 2.0**-10, abs=3)
        assert report.wall_count == report.elastic_count + 11 and report.unresolved == 0
        assert report.dissipated_energy == pytest.approx(2.0, rel=1e-6)  # but for (2^-10 / 2)² of the hops that are left
        assert 0.1 <= run.snapshot().position[0, 1] < 0.1 + contact_time**2


@pytest.mark.sampled(3)
def test_no_contact_is_missed_where_many_things_attract_each_other():
    """Looked at from outside four hundred times: nothing is in anything else, whatever the solver says."""
    random = np.random.default_rng(5)
    places = [[-1.5, -1.0], [0.0, -1.2], [1.4, -0.8], [-0.8, 0.9], [0.7, 1.0], [1.6, 0.9]]
    radius, mass = random.uniform(0.1, 0.4, 6), random.uniform(0.1, 2.0, 6)
    bodies = [{"mass": m, "radius": r, "position": x} for m, r, x in zip(mass.tolist(), radius.tolist(), places)]
    walls = [{"sphere": {"center": [0, 0], "radius": 2.5, "inside": True}}, floor(-1.8)]
    options = dict(walls=walls, forces=[{"newtonian_gravity": {"strength": 1}}], integrator={CHEAP: {"tolerance": 1e-5}})
    with simulation(bodies, **options) as run:
        least = np.inf
        for k in range(400):
            run.run(until=0.05 * (k + 1))
            x = run.snapshot().position
            apart = np.linalg.norm(x[:, None] - x, axis=2) - radius[:, None] - radius + 9.0 * np.eye(6)
            least = min(least, apart.min(), (2.5 - radius - np.linalg.norm(x, axis=1)).min(), (x[:, 1] + 1.8 - radius).min())
        report = run.contact_report
        assert report.pair_count > 100 and report.wall_count > 30
        # Times up to 20 and places of steps that are 10 long at most are rounded, at speeds up to 10.
        assert -least < 100.0 * EPSILON * 20.0
        assert report.largest_overlap * radius.min() < 100.0 * EPSILON * 20.0


@pytest.mark.sampled(6)
@pytest.mark.parametrize("integrator", CUT_AT_CONTACTS)
def test_looks_change_no_bit_and_lie_on_the_path_that_is_searched(integrator):
    """A contact that comes after a sample is left for later, and what is remembered of it comes back with a marked state."""
    bodies = [
        {"radius": 0.2, "position": [-1, 0.5], "velocity": [0.3, -0.1]},
        {"radius": 0.3, "position": [1, 0.6], "mass": 2.0},
    ]
    options = dict(
        integrator=integrator,
        walls=[floor(restitution=0.9)],
        forces=[{"newtonian_gravity": {"strength": 1}}, {"uniform_gravity": {"acceleration": [0, -1]}}],
        contacts={"restitution": 0.9, "contact_time": 1e-3},
    )
    ends = []
    with simulation(bodies, **options, dt=0.01) as run:
        for until, looks in ((4.0, 1), (4.0, 40)):
            run.restart()
            for k in range(looks):
                run.dt = until / looks
                run.run(until=until * (k + 1) / looks)
            assert run.contact_report.pair_count >= 2 and run.contact_report.wall_count >= 2
            ends.append(run.snapshot())
        run.dt = 2e-3 if integrator == CHEAP else 0.02  # of third order takes the shortest steps
        while not np.isfinite(run.state.due.to_numpy()[0]):  # until the step that it is in has a contact ahead
            run.run(steps=1)
        mark, end = run.mark(), run.time + 1.0
        remembered = [getattr(run.state, name).to_numpy() for name in ("due", "last_contact", "way", "start_blur")]
        run.run(until=end)
        after = run.state.save()[2:]  # beside what is shown
        run.return_to(mark)
        found = [getattr(run.state, name).to_numpy() for name in ("due", "last_contact", "way", "start_blur")]
        assert all(np.array_equal(one, other) for one, other in zip(remembered, found))
        run.run(until=end)
        assert all(np.array_equal(one, other) for one, other in zip(after, run.state.save()[2:]))
        # The path of the last step, at the last sample; coefficients of a step, no larger than 10, are rounded.
        clock, paths = run.state.clock.to_numpy(), run.contacts.paths
        share = (run.time - clock[0]) / clock[1]
        rows = paths.coefficient.to_numpy().reshape(-1, 2, 2)
        assert 0.0 < share < 1.0
        assert np.polynomial.polynomial.polyval(share, rows) == pytest.approx(run.snapshot().position[:, :2], abs=1e-12)
    assert np.array_equal(ends[0].position, ends[1].position) and np.array_equal(ends[0].velocity, ends[1].velocity)


REFUSED = [
    ({"integrator": {"leapfrog": {"dt": 0.1}}}, f"goes with the integrators {', '.join(CUT_AT_CONTACTS)}, not leapfrog"),
    (
        {"contacts": {"hard_spheres": {"solver": "swept"}}, "integrator": {"ias15": {"dt": 1}}},
        "not ias15, which goes with solver",
    ),
    ({"walls": [{"periodic_box": {"lower": [0, 0], "upper": [9, 9]}}]}, "walls[0].periodic_box: cannot be where contacts are"),
]


@pytest.mark.parametrize("change, message", REFUSED)
def test_scenes_that_the_located_solver_does_not_support_are_refused_in_one_line(change, message):
    with pytest.raises(SceneError) as caught:
        load_scene(scene([{"radius": 0.1, "position": [1, 1]}]) | change)
    assert message in str(caught.value) and len(caught.value.faults) == 1
