"""Elastic bounces: by rounding, speeds walk at random and drift to no side, off every kind of wall and between spheres.

A bounce rounds each component of the new velocity v once, to a multiple of a unit u_k ≤ 2⁻⁵² |v_k| in double precision. An
error that has no preferred sign has the variance u_k²/12. So the error Σ_k v_k δ_k / |v|² of the speed has a standard deviation
of at most 2⁻⁵²/√12 after one bounce, and √N times as much after N bounces. The bounds are five standard deviations.
"""

import math

import numpy as np
import pytest
from event_runs import EventRun

from mpp_taichi import Simulation, component
from mpp_taichi.walls._base import unit_vector

SURE = 5.0  # standard deviations
UNIT = {"f32": 2.0**-23, "f64": 2.0**-52}
AXIS, NORMAL = (0.3, -0.5, 0.81), (0.2, 0.7, -0.4)
OBLIQUE = {"point": [0.1, 0.2, 0.3], "axis": list(AXIS), "radius": 1.0}


def random_walk(bounces, precision="f64"):
    """The largest relative error of a speed that rounding without a preferred sign leaves after so many bounces."""
    return SURE * UNIT[precision] / math.sqrt(12.0) * math.sqrt(bounces)


def slab():
    """Two oblique planes at a distance of 1."""
    n = np.array(unit_vector(NORMAL, "normal"))
    return [{"plane": {"point": (-0.5 * n).tolist(), "normal": n.tolist()}}] + [
        {"plane": {"point": (0.5 * n).tolist(), "normal": (-n).tolist()}}
    ]


CIRCLE = 2, [{"cylinder": {"point": [0, 0, 0], "radius": 1.0}}]
ROOMS = {
    "circle": CIRCLE,
    "sphere": (3, [{"sphere": {"center": [0.1, 0.2, 0.3], "radius": 1.0}}]),
    "cylinder": (3, [{"cylinder": OBLIQUE}]),
    "planes": (3, slab()),
    "between spheres": (
        3,
        [
            {"sphere": {"center": [0, 0, 0], "radius": 1.5}},
            {"sphere": {"center": [0, 0, 0], "radius": 0.1, "inside": False}},
        ],
    ),
    "between cylinders": (
        3,
        [{"cylinder": {**OBLIQUE, "radius": 1.5}}, {"cylinder": {**OBLIQUE, "radius": 0.1, "inside": False}}],
    ),
}


def billiard(dimensions, walls, velocity, *, solver="event_driven", mass=1.0):
    """One small sphere between walls."""
    body = {"mass": mass, "radius": 0.02, "position": [0.3, 0.25, 0.4 * (dimensions == 3)], "velocity": velocity}
    stepped_by = "adaptive_bogacki_shampine" if solver == "located" else "leapfrog"
    scene = {
        "dimensions": dimensions,
        "particles": [{"body": body}],
        "walls": walls,
        "contacts": {"hard_spheres": {"solver": solver}},
        "run": {"duration": 1.0},
    }
    return scene if solver == "event_driven" else scene | {"integrator": {stepped_by: {"dt": 0.01}}}


def speed_change(before, after):
    """Relative change of the speed of the only sphere."""
    first, last = (np.linalg.norm(each.velocity[0].astype(np.longdouble)) for each in (before, after))
    return float(last / first - 1.0)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("mass", [1.0, 3.7])
@pytest.mark.parametrize("room", ROOMS)
def test_the_speed_in_a_room_walks_at_random(room, mass):
    dimensions, walls = ROOMS[room]
    velocity = [0.731, -0.353, 0.417 * (dimensions == 3)]
    with Simulation(billiard(dimensions, walls, velocity, mass=mass), backend="cpu", precision="f64") as run:
        before = run.snapshot()
        run.run(duration=100_000.0)
        bounces = run.contact_report.wall_count
        assert bounces > 10_000
        assert abs(speed_change(before, run.snapshot())) < random_walk(bounces)


STEPS = {"pairwise": 0.2, "resting": 0.2}  # these see contacts at the end or the start of a step


@pytest.mark.sampled(3)
@pytest.mark.parametrize("precision", UNIT)
@pytest.mark.parametrize("solver", component.names("contacts"))
def test_the_speed_in_a_circle_walks_at_random_with_every_solver(solver, precision):
    dimensions, walls = CIRCLE
    scene = billiard(dimensions, walls, [0.731, -0.353, 0.0], solver=solver)
    with Simulation(scene, backend="cpu", precision=precision) as run:
        before = run.snapshot()
        run.dt = STEPS.get(solver, 100.0)
        run.run(duration=20_000.0)
        bounces = run.contact_report.wall_count
        assert bounces > 7_000
        assert abs(speed_change(before, run.snapshot())) < random_walk(bounces, precision)


@pytest.mark.parametrize("masses", ["equal", "unlike"])
@pytest.mark.sampled(3)
def test_the_energy_of_a_gas_walks_at_random(masses):
    """A contact rounds two velocities, each of which changes its kinetic energy K by an error of at most 2 K 2⁻⁵²/√12.

    In three dimensions the mean of K² is 15/4 T², of the fast spheres that meet often at most twice as much, and the energy of
    P spheres is 3/2 P T.
    """
    count, side = 64, 4.0
    random = np.random.default_rng(5)
    place = np.stack(np.meshgrid(*[np.arange(4.0)] * 3, indexing="ij"), -1).reshape(-1, 3) + 0.5
    mass = np.ones(count) if masses == "equal" else random.uniform(0.5, 2.0, count)
    velocity = random.normal(size=(count, 3)) / np.sqrt(mass)[:, None]
    run = EventRun(place, velocity, 0.3, inverse_mass=1.0 / mass, period=(side, side, side))

    def energy():
        weight = 1.0 / (1.0 / mass).astype(np.longdouble)  # a sphere has the mass of its inverse mass
        return (weight[:, None] * run.velocity.astype(np.longdouble) ** 2).sum() / 2

    before, contacts = energy(), 0
    while contacts < 300_000:
        contacts += run.to(run.time + 50.0).pair_count
    spread = 2.0 * UNIT["f64"] / math.sqrt(12.0) * math.sqrt(2 * contacts * 7.5) / (1.5 * count)
    assert abs(energy() / before - 1.0) < SURE * spread


@pytest.mark.sampled(3)
def test_a_sphere_between_moving_planes_keeps_its_speed_relative_to_them():
    """Between planes that move together the relative velocity walks at random, beside the rounding of larger velocities."""
    drift = np.array([3.0, -1.0, 2.0])
    _, planes = ROOMS["planes"]
    walls = [{"plane": {**each["plane"], "velocity": drift.tolist()}} for each in planes]
    velocity = drift + [0.731, -0.353, 0.417]
    with Simulation(billiard(3, walls, velocity.tolist()), backend="cpu", precision="f64") as run:
        before = run.snapshot().velocity[0] - drift.astype(np.longdouble)
        run.run(duration=60_000.0)
        after = run.snapshot().velocity[0] - drift.astype(np.longdouble)
        bounces = run.contact_report.wall_count
    assert bounces > 10_000
    change = float(np.linalg.norm(after) / np.linalg.norm(before) - 1.0)
    larger = np.linalg.norm(np.abs(drift) + np.linalg.norm(before.astype(float))) / np.linalg.norm(before.astype(float))
    assert abs(change) < random_walk(bounces) * larger


@pytest.mark.parametrize("inside", [True, False])
@pytest.mark.sampled(3)
def test_the_velocity_along_an_oblique_cylinder_is_kept_however_far_a_sphere_flies(inside):
    """A bounce changes the velocity along the axis by J n·a, |J| ≤ 2 |v|, and by the rounding of the new velocity.

    n·a is the rounding of a·q (three products and two sums), of q − a (a·q), and of the quotient by |q|: relative errors of at
    most 2⁻⁵³ each, evenly spread, with variances of 2⁻¹⁰⁶/3. Five of them count for a·q, two for the others. The rounding of
    the velocity adds 2⁻¹⁰⁴/12.
    """
    axis = np.array(AXIS, np.longdouble) / np.linalg.norm(np.array(AXIS, np.longdouble))
    outer = {"cylinder": {**OBLIQUE, "radius": 1.0 if inside else 1.5}}
    inner = {"cylinder": {**OBLIQUE, "radius": 0.1, "inside": False}}
    velocity = 0.5 * np.array([0.731, -0.353, 0.417]) + 3.0 * np.array(unit_vector(AXIS, "axis"))
    walls = [outer] if inside else [outer, inner]
    with Simulation(billiard(3, walls, velocity.tolist()), backend="cpu", precision="f64") as run:
        before = run.snapshot().velocity[0].astype(np.longdouble)
        run.run(duration=100_000.0)
        after = run.snapshot().velocity[0].astype(np.longdouble)
        bounces = run.contact_report.wall_count
    assert bounces > 5_000
    across = np.linalg.norm(before - axis * (axis @ before))
    speed = np.linalg.norm(before)
    each = math.hypot(2.0 * float(across) * math.sqrt(7.0 / 3.0) * 2.0**-53, float(speed) * 2.0**-52 / math.sqrt(12.0))
    # The axis is rounded as well: the sum of all impulses, at most 2 |v|, has a part of some 2⁻⁵² along the true axis.
    assert abs(float((after - before) @ axis)) < SURE * each * math.sqrt(bounces) + 2.0 * float(speed) * 2.0**-52
