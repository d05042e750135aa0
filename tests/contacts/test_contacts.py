"""Contacts of scenes: the laws of impact for every solver, the keys of a scene, and the reports of a run."""

import math

import numpy as np
import pytest

from mpp_taichi import SceneError, Simulation, component
from mpp_taichi.errors import UnsupportedError
from mpp_taichi.scene.load import load_scene
from mpp_taichi.start.assemble import assemble
from mpp_taichi.start.contact_setup import ContactSetup, contact_setup
from mpp_taichi.start.overlaps import overlapping_pairs
from mpp_taichi.walls._base import Enclosure
from scenes import REQUIRED

SOLVERS = [
    name for name in component.names("contacts") if name != "merging"
]  # after that nothing leaves a contact: test_merging
# pairwise and resting take a contact at the end or the start of a step; resting gains no energy, but may lose some.
EXACT = [name for name in SOLVERS if name not in ("pairwise", "resting")]
ELASTIC = [name for name in SOLVERS if name != "resting"]
UNIT = {"f32": 2.0**-24, "f64": 2.0**-53}


def spheres(bodies, *, solver, dt=0.01, dimensions=3, restitution=1.0, walls=(), forces=(), pairs=(), duration=1.0, **others):
    scene = {
        "dimensions": dimensions,
        "particles": [{"body": body} for body in bodies],
        "contacts": {"hard_spheres": {"solver": solver, "restitution": restitution, "pairs": list(pairs), **others}},
        "walls": list(walls),
        "forces": list(forces),
        "run": {"duration": duration},
    }
    return scene if solver == "event_driven" else scene | {"integrator": {stepped_by(solver): {"dt": dt}}}


def stepped_by(solver):
    """A method that the solver goes with."""
    return "adaptive_bogacki_shampine" if solver == "located" else "leapfrog"


def oblique_pair(seed):
    """Two spheres of unlike masses and radii on their way to meet off centre, and the velocities that Eq. 9 gives them.

    v_n' = v_n ∓ (1 + e) m_other/(m_1 + m_2) ((v_1 − v_2)·n) n at the moment of contact: T. Müller, arXiv:1403.1695.
    """
    random = np.random.default_rng(seed)
    masses, radii = 10.0 ** random.uniform(-3, 3, 2), random.uniform(0.1, 1.0, 2)
    normal = random.normal(size=3)
    normal /= np.linalg.norm(normal)
    first, second = random.normal(size=(2, 3))
    approach = (first - second) @ normal
    if approach < 0.0:
        first, second, approach = second, first, -approach
    e = random.uniform(0.2, 1.0)
    impulse = (1.0 + e) * approach * normal / masses.sum()
    after = first - masses[1] * impulse, second + masses[0] * impulse
    back = 0.3  # the time of the contact
    places = -back * first, radii.sum() * normal - back * second
    bodies = [
        {"mass": float(m), "radius": float(r), "position": x.tolist(), "velocity": v.tolist()}
        for m, r, x, v in zip(masses, radii, places, (first, second))
    ]
    return bodies, e, np.array(after), np.array([0.3 * after[0], radii.sum() * normal + 0.3 * after[1]])


@pytest.mark.sampled(2)
@pytest.mark.parametrize("precision", UNIT)
@pytest.mark.parametrize("solver", [*EXACT, "resting"])  # a lone impact `resting` takes at its exact moment, too
def test_two_spheres_leave_an_oblique_contact_as_the_formula_says(solver, precision):
    for seed in range(3 if precision == "f64" else 1):
        bodies, e, velocity, position = oblique_pair(seed)
        # Every step rounds places of a few units; the error of the time of contact is that over the approach speed, and that of
        # the normal the same over the distance of the centres.
        reach = bodies[0]["radius"] + bodies[1]["radius"]
        approach = np.linalg.norm(velocity[0] - bodies[0]["velocity"])
        steps = 1 if solver == "event_driven" else 60
        tolerance = 8 * (10 + steps) * UNIT[precision] / min(1.0, approach) / min(1.0, reach)
        with Simulation(spheres(bodies, solver=solver, restitution=e, duration=0.6), backend="cpu", precision=precision) as run:
            after = run.run().snapshot()
            assert run.contact_report.pair_count == 1
        scale = max(1.0, np.abs(velocity).max())
        assert np.abs(after.velocity - velocity).max() < tolerance * scale
        assert np.abs(after.position - position).max() < tolerance * scale


@pytest.mark.sampled(2)
@pytest.mark.parametrize("precision", UNIT)
@pytest.mark.parametrize("seed", range(3))
def test_pairwise_spheres_leave_a_contact_as_the_formula_says_for_where_it_is_noticed(seed, precision):
    """Eq. 9 along the line of centres at the end of the step, whatever the angle, the masses and the radii."""
    bodies, e, _, _ = oblique_pair(seed)
    mass, radius = (np.array([body[key] for body in bodies]) for key in ("mass", "radius"))
    start, velocity = (np.array([body[key] for body in bodies]) for key in ("position", "velocity"))
    dt = 0.31  # the contact is at 0.3
    d = (start[1] + dt * velocity[1]) - (start[0] + dt * velocity[0])
    n = d / np.linalg.norm(d)
    assert np.linalg.norm(d) < radius.sum() and n @ (velocity[1] - velocity[0]) < 0.0
    impulse = (1.0 + e) * n.dot(velocity[0] - velocity[1]) / (1.0 / mass).sum()
    expected = velocity + np.outer([-1.0, 1.0] * (impulse / mass), n)
    scene = spheres(bodies, solver="pairwise", restitution=e, duration=dt, dt=dt) | {
        "integrator": {"symplectic_euler": {"dt": dt}}
    }
    with Simulation(scene, backend="cpu", precision=precision) as run:
        after = run.run().snapshot()
    # A place of a few units is rounded some times, which turns the line of centres by that over its length.
    tolerance = 16 * UNIT[precision] * np.abs(start).max(initial=1.0) / min(1.0, radius.sum())
    assert np.abs(after.velocity - expected).max() < tolerance * max(1.0, np.abs(expected).max())


@pytest.mark.sampled(3)
@pytest.mark.parametrize("solver", SOLVERS)
def test_restitution_is_that_of_the_pair(solver):
    bodies = [
        {"name": "a", "mass": 1.0, "radius": 0.1, "position": [0, 0, 0], "velocity": [1, 0, 0]},
        {"name": "b", "mass": 1.0, "radius": 0.1, "position": [0.5, 0, 0]},
        {"name": "c", "mass": 1.0, "radius": 0.1, "position": [0, 5, 0], "velocity": [1, 0, 0]},
        {"name": "d", "mass": 1.0, "radius": 0.1, "position": [0.5, 5, 0]},
    ]
    pairs = [{"between": ["b", "a"], "restitution": 0.5}]
    with Simulation(spheres(bodies, solver=solver, restitution=0.9, pairs=pairs), backend="cpu") as run:
        velocity = run.run().snapshot().velocity[:, 0]
        assert velocity == pytest.approx([0.25, 0.75, 0.05, 0.95], abs=1e-14)  # (1 ∓ e)/2
        lost = 0.25 * (1 - 0.5**2) + 0.25 * (1 - 0.9**2)  # ¼ m v² (1 − e²) of each
        assert run.contact_report.dissipated_energy == pytest.approx(lost, rel=1e-13)
        assert not run.phase.conserves_energy and run.phase.gains_no_energy and run.phase.conserves_momentum


@pytest.mark.sampled(3)
@pytest.mark.parametrize("solver", SOLVERS)
def test_a_held_sphere_is_a_wall_and_a_held_axis_does_not_move(solver):
    bodies = [
        {"mass": 1.0, "radius": 0.1, "position": [0, 0, 0], "velocity": [1, 0, 0]},
        {"mass": 1.0, "radius": 0.1, "position": [0.5, 0, 0], "free": False},
        {"mass": 1.0, "radius": 0.1, "position": [0, 5, 0], "velocity": [1, 0, 0]},
        {"mass": 1.0, "radius": 0.1, "position": [0.5, 5.1, 0], "free": [True, False, True]},
    ]
    with Simulation(spheres(bodies, solver=solver), backend="cpu") as run:
        after = run.run().snapshot()
        assert after.velocity[0] == pytest.approx([-1, 0, 0], abs=1e-14) and not after.velocity[1].any()
        assert after.velocity[3, 1] == 0.0 and after.position[3, 1] == 5.1 and after.velocity[3, 0] > 0.1
        energy = 0.5 * (after.velocity**2).sum()
        assert energy == pytest.approx(1.0, abs=1e-14)


@pytest.mark.sampled(4)
@pytest.mark.parametrize("solver", EXACT)
@pytest.mark.parametrize("speed", [0.7, 1e3, 123_456.789])
def test_nothing_leaves_a_box_at_any_speed(solver, speed):
    """The path in a box is a straight one, folded at the walls."""
    radius, lower, upper = 0.1, np.array([-1.0, -2.0, 0.0]), np.array([1.5, 1.0, 3.0])
    start, direction = np.array([0.3, -0.2, 1.0]), np.array([0.48, -0.64, 0.6])
    body = {"mass": 1.0, "radius": radius, "position": start.tolist(), "velocity": (speed * direction).tolist()}
    walls = [{"box": {"lower": lower.tolist(), "upper": upper.tolist()}}]
    duration = 8.0 if speed < 1.0 else 2.0 if speed < 1e4 else 0.05
    with Simulation(spheres([body], solver=solver, walls=walls, duration=duration), backend="cpu", precision="f64") as run:
        after = run.run().snapshot()
        room = upper - lower - 2 * radius
        unfolded = start - lower - radius + speed * duration * direction
        phase = np.mod(unfolded, 2 * room)
        expected = lower + radius + np.where(phase < room, phase, 2 * room - phase)
        bounces = int(np.abs(np.floor(unfolded / room)).sum())
        assert run.contact_report.wall_count == bounces
        # Each bounce and each step rounds a place of size ~3 and a time, of the run or of the step; an error of time is one of
        # place at that speed.
        way = speed * (duration if solver == "event_driven" else run.dt)
        assert bounces > 2
        assert np.abs(after.position - expected).max() < 8 * UNIT["f64"] * (bounces + run.step_count) * (3 + way)
        assert np.linalg.norm(after.velocity) == pytest.approx(speed, rel=1e-12)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("solver", ELASTIC)
def test_energy_of_a_gas_is_kept_and_the_summary_tells_of_its_contacts(solver, tmp_path, capsys):
    import json

    import yaml

    from mpp_taichi.cli.main import main

    scene = {
        "dimensions": 2,
        "particles": [
            {
                "lattice": {
                    "shape": [6, 5],
                    "lower": [0.2, 0.2],
                    "upper": [2.8, 2.3],
                    "mass": 1,
                    "radius": 0.1,
                    "velocity": ["cos(40*u + 9*v)", "sin(31*u + 7*v)"],
                }
            }
        ],
        "contacts": {"hard_spheres": {"solver": solver}},
        "walls": [{"box": {"lower": [0, 0], "upper": [3, 2.5]}}],
        "run": {"duration": 2.0},
    } | ({} if solver == "event_driven" else {"integrator": {stepped_by(solver): {"dt": 0.01}}})
    path = tmp_path / "gas.yaml"
    path.write_text(yaml.safe_dump(scene))
    assert main([str(path), "--headless", "--json", "--backend", "cpu", "--precision", "f64"]) == 0
    printed = capsys.readouterr()
    found = json.loads(printed.out)
    contacts = found["contacts"]
    assert contacts["solver"] == solver and contacts["pair_count"] > 20 and contacts["wall_count"] > 10
    assert f"contact {solver}: {contacts['pair_count']:,} collisions of spheres" in printed.err
    assert found["effects"] == ["hard_spheres", "box"] and contacts["unresolved"] == 0
    # Each contact rounds four velocities of about one.
    assert found["relative_energy_error_max"] < 4 * UNIT["f64"] * (contacts["pair_count"] + contacts["wall_count"])
    assert set(contacts["wall_impulse"]) == {f"walls[0].box, {side} {axis}" for side in ("lower", "upper") for axis in "xy"}


@pytest.mark.sampled(3)
def test_contacts_and_forces_act_together():
    """A ball on a spring hits another; between the contacts it swings."""
    scene = spheres(
        [
            {"name": "wall", "mass": 1.0, "position": [0, 0, 0], "free": False},
            {"name": "ball", "mass": 1.0, "radius": 0.1, "position": [1, 0, 0], "velocity": [1, 0, 0]},
            {"name": "other", "mass": 1.0, "radius": 0.1, "position": [1.7, 0, 0]},
        ],
        solver="swept",
        dt=1e-3,
        duration=3.0,
    ) | {"springs": [{"link": {"between": ["wall", "ball"], "stiffness": 1.0, "rest_length": 1.0}}]}
    with Simulation(scene, backend="cpu", precision="f64") as run:
        after = run.run().snapshot()
        # x = 1 + sin t reaches the contact at 1.5, t = π/6, with the speed cos π/6, which the other ball takes over; the first
        # starts from 0.5 at rest.
        hit, speed = math.pi / 6, math.cos(math.pi / 6)
        # Leapfrog's error is (ω dt)²/24 of the phase, and the contact falls inside a step of 1e-3: its error is of first order
        # in the kick of half a step, 0.5 · 1e-3 · 0.5.
        assert after.velocity[2, 0] == pytest.approx(speed, abs=5e-4)
        assert after.position[2, 0] == pytest.approx(1.7 + speed * (3.0 - hit), abs=1.5e-3)
        assert after.position[1, 0] == pytest.approx(1.0 + 0.5 * math.cos(3.0 - hit), abs=1.5e-3)


# --- what a scene may say -----------------------------------------------------------------------------------------------

BALL = {"mass": 1.0, "radius": 0.5}
FAULTS = [
    ({"contacts": {"hard_spheres": {"solver": "evnt"}}}, "contacts.hard_spheres.solver: 'evnt' is unknown"),
    ({"contacts": {"hard_spheres": {"solver": "swept", "restitution": 1.5}}}, "restitution: 1.5 is not allowed"),
    ({"contacts": {"hard_spheres": {"solver": "swept", "restituton": 1}}}, "did you mean 'restitution'?"),
    ({"contacts": {"hard_spheres": {"solver": "swept", "overlap": "maybe"}}}, "allowed: refuse, separate"),
    ({"contacts": {"hard_spheres": {"solver": "event_driven"}}}, "event_driven needs no integrator"),
    (
        {"integrator": {"rk4": {"dt": 0.1}}},
        "goes with the integrators langevin, leapfrog, symplectic_euler, velocity_verlet, not rk4",
    ),
    ({"integrator": {"event_driven": {}}}, "not event_driven"),
    (
        {"contacts": {"hard_spheres": {"solver": "resting", "compliance": 1e-3}}, "integrator": {"leapfrog": {"dt": 0.1}}},
        "contacts.hard_spheres.compliance: contacts that yield go with the integrator symplectic_euler",
    ),
    (
        {"contacts": {"hard_spheres": {"solver": "swept", "pairs": [{"between": [0, "nobody"], "restitution": 0.5}]}}},
        "contacts.hard_spheres.pairs[0].between[1]: no particle is called 'nobody'",
    ),
    ({"particles": [{"body": BALL | {"position": [0, 0, 0], "mass": 0.0}}]}, "must have one above 0 where particles touch"),
    ({"walls": [{"box": {"lower": [0, 0, 0], "upper": [1, 0, 1]}}]}, "walls[0].box: goes from 0 to 0 along y"),
    ({"walls": [{"plane": {"point": [0, 0, 0], "normal": [0, 0, 0]}}]}, "walls[0].plane: normal must not be [0, 0, 0]"),
    ({"walls": 2 * [{"periodic_box": {"lower": [-9, -9, -9], "upper": [9, 9, 9]}}]}, "there is a periodic_box already"),
    (
        {"walls": [{"periodic_box": {"lower": [0, 0, 0], "upper": [1.5, 9, 9]}}]},
        "must be at most 0.375, a quarter of the shortest period 1.5",
    ),
    ({"walls": [{"plane": {"point": [0, 0, 0], "normal": [1, 0, 0]}}]}, "particle 0 (body) reaches 0.5 into walls[0].plane"),
]


@pytest.mark.sampled(2)
@pytest.mark.parametrize(("change", "message"), FAULTS)
def test_impossible_contacts_are_refused_in_one_line(change, message):
    scene = spheres([BALL | {"position": [0, 0, 0]}, BALL | {"position": [3, 0, 0]}], solver="swept") | change
    with pytest.raises(SceneError) as caught:
        assemble(load_scene(scene))
    assert message in str(caught.value) and len(caught.value.faults) == 1


@pytest.mark.sampled(2)
@pytest.mark.parametrize(
    ("solver", "count", "reason"),
    [
        ("event_driven", 1, "event_driven runs on the CPU only, not on vulkan: it takes one event after the other"),
        ("located", 1, "runs on the CPU only, not on vulkan"),
        ("merging", 1, "merging runs on the CPU only, not on vulkan: it takes one meeting after the other"),
        ("simultaneous", 161, "simultaneous takes up to 160 spheres on vulkan, and here are 161"),
    ],
)
def test_what_takes_one_thread_is_refused_by_name_on_a_gpu(solver, count, reason, software_vulkan):
    restitution = {} if solver == "merging" else {"restitution": 1.0}
    scene = spheres([BALL | {"position": [3.0 * k, 0, 0]} for k in range(count)], solver=solver)
    scene["contacts"] = {"hard_spheres": {"solver": solver, **restitution}}
    with pytest.raises(UnsupportedError, match=reason):
        Simulation(scene, backend="vulkan")
    if count == 1:
        with Simulation(scene, backend="auto") as run:
            assert run.device.on_cpu


@pytest.mark.sampled(2)
@pytest.mark.parametrize("force", [None, {"uniform_gravity": {"acceleration": [0.0, 0.0, -1.0]}}], ids=["free", "gravity"])
def test_a_state_is_up_to_date_whenever_it_is_looked_at(force):
    """Steps one at a time, each sampled, with one step undone and repeated, end where a run without samples ends."""
    random = np.random.default_rng(5)
    corners = np.stack(np.meshgrid(*[np.arange(7) * 2.2] * 3, indexing="ij"), -1).reshape(-1, 3)
    bodies = [
        {"mass": 1.0, "radius": 1.0, "position": place.tolist(), "velocity": random.normal(size=3).tolist()}
        for place in corners
    ]
    walls = [{"periodic_box": {"lower": [-1.1] * 3, "upper": [14.3] * 3}}]
    scene = spheres(bodies, solver="swept", walls=walls, forces=[force] if force else (), duration=0.2)
    with Simulation(scene, backend="cpu", precision="f64") as run:
        assert run.contacts.setup.force_free == (force is None)
        at_once = run.run().snapshot()
        contacts = run.contact_report.pair_count
    with Simulation(scene, backend="cpu", precision="f64") as run:
        places = [run.snapshot().position]
        for step in range(20):
            if step == 9:
                mark = run.mark()
                assert run.try_steps(1)
                run.return_to(mark)
                assert (run.snapshot().position == places[-1]).all()
            run.run(steps=1)
            places.append(run.snapshot().position)
        assert all((before != after).any(axis=1).all() for before, after in zip(places, places[1:]))
        assert (run.snapshot().position == at_once.position).all() and (run.snapshot().velocity == at_once.velocity).all()
    assert contacts > 100


def test_event_driven_contacts_know_no_other_force_than_gravity():
    scene = spheres([BALL | {"position": [0, 0, 0]}], solver="event_driven", forces=[{"linear_drag": {"coefficient": 1.0}}])
    with pytest.raises(SceneError, match="knows no force but uniform_gravity"):
        load_scene(scene)


def test_integrators_that_may_drift_are_those_whose_drifts_lead_forward():
    for name in component.names("integrators"):
        if component.declaration("integrators", name).base == "Splitting":
            made = component.build("integrators", name, {"dt": 1.0} | REQUIRED.get(name, {}))
            assert (min(made.drifts) >= 0.0) == bool(component.flag("integrators", name, "moves_forward_alone"))


def test_spheres_that_overlap_are_refused_by_name_or_pushed_apart():
    bodies = [BALL | {"name": name, "position": [x, 0, 0]} for name, x in (("a", 0.0), ("b", 0.7), ("c", 5.0))]
    with pytest.raises(SceneError, match=r"particle 0 \(a\) and particle 1 \(b\) overlap by 0.3"):
        assemble(load_scene(spheres(bodies, solver="swept")))
    apart = assemble(load_scene(spheres(bodies, solver="swept", overlap="separate")))
    assert apart.position[:, 0] == pytest.approx([-0.15, 0.85, 5.0], abs=1e-8)
    bodies[1]["position"] = [1.0 - 0.4e-9, 0, 0]  # less than a billionth of a radius is rounding: they touch
    touching = assemble(load_scene(spheres(bodies, solver="swept")))
    assert touching.position[1, 0] == 1.0 - 0.4e-9


def test_a_heap_at_one_place_opens_and_a_full_box_is_refused():
    walls = [{"box": {"lower": [-3, -3, -3], "upper": [3, 3, 3]}}]
    heap = [BALL | {"position": [0, 0, 0]} for _ in range(20)]
    apart = assemble(load_scene(spheres(heap, solver="swept", walls=walls, overlap="separate")))
    setup = contact_setup(load_scene(spheres(heap, solver="swept", walls=walls)), apart)
    _, depth = overlapping_pairs(setup, apart.position)
    assert (depth <= 1e-9 * 0.5).all() and np.abs(apart.position).max() <= 2.5 * (1 + 1e-9)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("period", [(0.0, 0.0, 0.0), (1.0, 1.0, 1.0), (0.0, 1.0, 0.0)])
@pytest.mark.parametrize("dimensions", [2, 3])
def test_overlapping_pairs_are_those_of_a_look_at_all_pairs(period, dimensions):
    random = np.random.default_rng(dimensions)
    count = 300
    radius = np.where(random.random(count) < 0.02, 0.2, random.uniform(0.003, 0.02, count))
    position = random.random((count, 3)) * (np.arange(3) < dimensions)
    period = tuple(length * (axis < dimensions) for axis, length in enumerate(period))
    setup = ContactSetup(
        dimensions,
        radius,
        np.ones((count, 3)),
        np.zeros(count, np.int32),
        np.ones((1, 1)),
        enclosure=Enclosure((), period, (0.0, 0.0, 0.0)),
    )
    separation = position[:, None] - position[None]
    for axis in range(3):
        if period[axis]:
            separation[..., axis] -= period[axis] * np.round(separation[..., axis] / period[axis])
    overlap = radius[:, None] + radius[None] > np.linalg.norm(separation, axis=-1)
    expected = np.argwhere(np.triu(overlap, 1))
    found, _ = overlapping_pairs(setup, position)
    assert len(expected) > 20 and np.array_equal(found, expected)


def test_a_periodic_box_keeps_momentum_but_is_not_asked_to_keep_angular_momentum(tmp_path, capsys):
    """A contact across a face: both spheres are pushed along the line between images, which is not the line between them."""
    import json

    import yaml

    from mpp_taichi.cli.main import main

    scene = spheres(
        [
            {"mass": 1.0, "radius": 0.1, "position": [0.9, 0.05, 0], "velocity": [1, 0, 0]},
            {"mass": 1.0, "radius": 0.1, "position": [-0.9, 0.0, 0], "velocity": [-1, 0, 0]},
        ],
        solver="swept",
        walls=[{"periodic_box": {"lower": [-1, -1, -1], "upper": [1, 1, 1]}}],
        duration=0.5,
    )
    path = tmp_path / "across.yaml"
    path.write_text(yaml.safe_dump(scene))
    assert main([str(path), "--headless", "--json", "--backend", "cpu", "--precision", "f64"]) == 0
    printed = capsys.readouterr()
    found = json.loads(printed.out)
    assert found["contacts"]["pair_count"] == 1 and found["conserves_momentum"] and not found["conserves_angular_momentum"]
    assert found["momentum_error_max"] < 4 * UNIT["f64"] < 0.01 < found["angular_momentum_error_max"]
    assert "angular momentum is not conserved in a periodic box" in printed.err


def test_a_wall_within_many_spheres_is_one_fault():
    """A hundred lines for one number that was mistyped would hide what is wrong."""
    block = {"shape": [12, 12, 1], "lower": [0, 0, 0], "upper": [11, 11, 0], "mass": 1.0, "radius": 0.4, "name": "block"}
    walls = [{"plane": {"point": [3.0, 0, 0], "normal": [1, 0, 0]}}]
    scene = spheres([BALL | {"position": [50, 0, 0]}], solver="swept", walls=walls)
    scene["particles"].append({"lattice": block})
    with pytest.raises(SceneError) as caught:
        assemble(load_scene(scene))
    (fault,) = caught.value.faults
    assert "reaches 3.4 into walls[0].plane" in fault and "47 more spheres reach into it, no deeper" in fault


def test_entries_whose_spheres_overlap_many_times_are_one_fault():
    block = {"shape": [6, 6, 1], "mass": 1.0, "radius": 0.4}
    scene = spheres([BALL | {"position": [50, 0, 0]}], solver="swept")
    for x in (0.0, 0.1):
        scene["particles"].append({"lattice": {**block, "lower": [x, 0, 0], "upper": [x + 5, 5, 0], "name": f"block{x}"}})
    with pytest.raises(SceneError) as caught:
        assemble(load_scene(scene))
    (fault,) = caught.value.faults
    assert "overlap by 0.7" in fault and "35 more pairs overlap" in fault
