"""Segments and polygons with every contact solver: closed forms, energy, billiards, corners, and no tunnelling."""

import math

import numpy as np
import pytest
import segment_billiard

from mpp_taichi import Simulation

UNIT = 2.0**-53
LONG = {"leapfrog": {"dt": 4.0}}  # two steps of the run below: a disk covers 20 radii, and bounces several times, in a drift
METHODS = {
    "event_driven": {"event_driven": {"dt": 1.0}},
    "swept": LONG,
    "simultaneous": LONG,
    "merging": LONG,
    "resting": {"leapfrog": {"dt": 0.05}},  # one impact of a sphere in a drift
    "located": {"adaptive_bogacki_shampine": {"dt": 1.0}},
}


def ball(position, velocity, radius=0.1, **more):
    """A particle of mass 1."""
    return {"body": {"mass": 1.0, "radius": radius, "position": position, "velocity": velocity, **more}}


def scene(solver, bodies, walls, *, duration=1e6, e=1.0, **more):
    """A flat scene."""
    spheres = {"solver": solver} | ({} if solver == "merging" else {"restitution": e})
    return {
        "dimensions": 2,
        "particles": list(bodies),
        "contacts": {"hard_spheres": spheres},
        "walls": list(walls),
        "run": {"duration": duration},
        "integrator": METHODS[solver],
        **more,
    }


def polygon(points, **more):
    """A closed polygon."""
    return {"polygon": {"points": points, **more}}


def state(simulation):
    """Positions and velocities, (n, 2) each."""
    snapshot = simulation.snapshot()
    return snapshot.position[:, :2], snapshot.velocity[:, :2]


ROOM = [[-1.5, -1.2], [1.6, -1.0], [1.4, 1.5], [-1.3, 1.1]]
BLADES = [((-0.9, 0.35), (-0.3, 0.1), 0.9), ((0.1, -0.5), (0.75, -0.2), 1.0)]
WALLS = [polygon(ROOM), *({"segment": {"from": list(a), "to": list(b), "restitution": e}} for a, b, e in BLADES)]
SIDES = [*((a, b, 1.0) for a, b in zip(ROOM, [*ROOM[1:], ROOM[0]])), *BLADES]


@pytest.mark.sampled(6)
@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("solver", METHODS)
def test_a_disk_bounces_off_sides_and_ends_as_the_brute_force_reference_says(solver, precision):
    """In a room of four walls with two blades, one of them inelastic, to what rounding makes of it.

    No disk comes through a wall, in drifts of 20 radii either. The reference tells by how much a change of the start grows. The
    roundings of the steps, at most 320 drifts, have no preferred sign, so that they grow as the root of their number, from one
    unit of a place below 2; eight times that is allowed.
    """
    start, speed, end, steps = (0.13, 0.9), (-0.6316, 0.7753), 8.0, 320
    x, v, bounces = segment_billiard.run(start, speed, 0.1, SIDES, end)
    other, _, _ = segment_billiard.run((start[0], start[1] + 1e-9), speed, 0.1, SIDES, end)
    growth = np.abs(other - x).max() / 1e-9
    assert bounces >= 5 and 10 < growth < 100 and v @ v < 0.9 * np.dot(speed, speed)
    unit = UNIT * (2.0**29 if precision == "f32" else 1.0)
    with Simulation(scene(solver, [ball(start, speed)], WALLS), backend="cpu", precision=precision) as run:
        run.run(until=end)
        found, report = state(run), run.contact_report
    assert report.wall_count == bounces and report.unresolved == 0
    assert max(np.abs(found[0][0] - x).max(), np.abs(found[1][0] - v).max()) < 8 * growth * math.sqrt(steps) * 2 * unit
    # The impulses on all sides of the polygon are one number: with the blades there are three.
    assert len(report.wall_impulse) == 3 and sum(report.wall_impulse) > 0


@pytest.mark.sampled(3)
@pytest.mark.parametrize("solver", ["swept", "simultaneous", "resting"])
def test_software_vulkan_bounces_off_segments_as_the_reference_says(solver, software_vulkan):
    """Three bounces of the run above in f32, off a side of the room and a blade, with the same bound."""
    start, speed, end, steps = (0.13, 0.9), (-0.6316, 0.7753), 3.0, 120
    x, v, bounces = segment_billiard.run(start, speed, 0.1, SIDES, end)
    assert bounces == 3
    short = {"integrator": {"leapfrog": {"dt": 0.05}}}
    with Simulation(scene(solver, [ball(start, speed)], WALLS, **short), backend="vulkan", precision="f32") as run:
        run.run(until=end)
        found, report = state(run), run.contact_report
    assert report.wall_count == bounces and report.unresolved == 0
    other, _, _ = segment_billiard.run((start[0], start[1] + 1e-9), speed, 0.1, SIDES, end)
    growth = np.abs(other - x).max() / 1e-9
    assert max(np.abs(found[0][0] - x).max(), np.abs(found[1][0] - v).max()) < 8 * growth * math.sqrt(steps) * 2 * 2.0**-24


@pytest.mark.sampled(3)
def test_a_disk_that_falls_on_a_ramp_leaves_it_as_the_parabola_and_its_restitution_say():
    """Dropped on a ramp of 30°, with e = 0.6; and beside the end of another ramp, off which it bounces as off a fixed point."""
    g, e, r, height, end = 9.0, 0.6, 0.1, 1.5, 0.9
    slope = math.radians(30)
    tangent, n = np.array([math.cos(slope), -math.sin(slope)]), np.array([math.sin(slope), math.cos(slope)])
    far, off = np.array([10.0, 0.0]), 0.06  # the disk is dropped `off` to the left of the end of the second ramp
    ramps = [
        {"segment": {"from": (-3 * tangent).tolist(), "to": (3 * tangent).tolist(), "restitution": e}},
        {"segment": {"from": far.tolist(), "to": (far + 2 * tangent).tolist()}},
    ]
    starts = [[0.0, r / math.cos(slope) + height], [10.0 - off, height + math.sqrt(r * r - off * off)]]
    made = scene(
        "event_driven",
        [ball(start, [0, 0]) for start in starts],
        ramps,
        forces=[{"uniform_gravity": {"acceleration": [0, -g]}}],
    )
    with Simulation(made, backend="cpu", precision="f64") as run:
        run.run(until=end)
        x, v = state(run)
        assert run.contact_report.wall_count == 2
    fall = math.sqrt(2 * height / g)
    for k, (normal, restitution) in enumerate([(n, e), (np.array([-off, math.sqrt(r * r - off * off)]) / r, 1.0)]):
        before = np.array([0.0, -g * fall])
        after = before - (1 + restitution) * (before @ normal) * normal
        rest = end - fall
        place = np.array([starts[k][0], starts[k][1] - height]) + rest * after + np.array([0.0, -g * rest * rest / 2])
        # A hundred roundings of numbers of up to 10; off the point an angle is rounded by these over a length of a tenth.
        assert np.abs(x[k] - place).max() < 100 * 10 * UNIT * (1 if k == 0 else 10)
        assert np.abs(v[k] - (after + np.array([0.0, -g * rest]))).max() < 100 * 10 * UNIT * (1 if k == 0 else 10)


def fold(position, edge):
    """The place in the triangle (0, 0), (edge, 0), (edge, edge) of a straight way that is reflected at its sides."""
    u, v = (edge - abs(each % (2 * edge) - edge) for each in np.asarray(position, np.longdouble))
    return np.array([max(u, v), min(u, v)])


@pytest.mark.sampled(3)
def test_a_disk_in_a_triangle_follows_the_unfolded_straight_line_and_keeps_its_energy():
    """Mirror images of the triangle of the centre tile the plane, so that the way of a thousand bounces is a straight line."""
    edge, r, end = 2.0, 0.25, 750.0
    corner = r * (1 + math.sqrt(2))
    triangle = polygon([[-corner, -r], [edge + r, -r], [edge + r, edge + corner]])
    start, speed = np.array([1.3, 0.4]), np.array([0.83, 1.31])
    with Simulation(
        scene("event_driven", [ball(start.tolist(), speed.tolist(), radius=r)], [triangle]), backend="cpu", precision="f64"
    ) as run:
        run.run(until=end)
        x, v = state(run)
        bounces = run.contact_report.wall_count
    assert bounces > 1000
    # A bounce rounds place, velocity and walls by some units, and an error of the velocity grows with the time left.
    tolerance = 8 * UNIT * math.sqrt(bounces) * (2 * edge + end)
    assert np.abs(x[0] - fold(start + end * speed.astype(np.longdouble), edge)).max() < tolerance
    assert v[0] @ v[0] == pytest.approx(speed @ speed, rel=8 * UNIT * math.sqrt(bounces))


@pytest.mark.sampled(2)
@pytest.mark.parametrize("solver", ["event_driven", "swept"])
def test_a_gas_in_a_polygon_moves_as_in_the_box_of_the_same_corners_bit_for_bit(solver):
    """Sides along the axes have the same numbers in both."""
    gas = [{"gas": {"count": 14, "lower": [-1, -0.5], "upper": [2, 1.5], "radius": 0.2, "speed": 1.0}}]
    found = []
    for wall in ({"box": {"lower": [-1, -0.5], "upper": [2, 1.5]}}, polygon([[-1, -0.5], [2, -0.5], [2, 1.5], [-1, 1.5]])):
        with Simulation(
            scene(
                solver, gas, [wall], integrator={solver: {"dt": 0.1}} if solver == "event_driven" else {"leapfrog": {"dt": 0.1}}
            ),
            backend="cpu",
            precision="f64",
        ) as run:
            run.run(until=8.0)
            found.append((*state(run), run.contact_report.wall_count, sum(run.contact_report.wall_impulse)))
    box, sides = found
    assert box[2] == sides[2] > 30
    assert np.array_equal(box[0], sides[0]) and np.array_equal(box[1], sides[1])
    assert box[3] == pytest.approx(sides[3], rel=1e-13)


@pytest.mark.sampled(3)
def test_a_disk_glides_over_flat_joints_and_rests_in_a_corner():
    """Without friction a disk that glides on five segments in a line keeps its speed; a disk that falls into a V rests."""
    line = {"polygon": {"points": [[-3, 0], [-1, 0], [0, 0], [0.3, 0], [2, 0], [8, 0]], "closed": False, "restitution": 0.0}}
    corner = [
        {"segment": {"from": [10, 2], "to": [11, 0], "restitution": 0.3}},
        {"segment": {"from": [12, 2], "to": [11, 0], "restitution": 0.3}},
    ]
    g, dt, end, speed = 9.81, 0.01, 1.5, 3.0
    made = scene(
        "resting",
        [ball([-2, 0.1], [speed, 0]), ball([10.8, 1.6], [0, 0])],
        [line, *corner],
        forces=[{"uniform_gravity": {"acceleration": [0, -g]}}],
        integrator={"symplectic_euler": {"dt": dt}},
    )
    with Simulation(made, backend="cpu", precision="f64") as run:
        run.run(until=end)
        x, v = state(run)
        run.run(until=8.0)
        y, w = state(run)
        assert run.contact_report.unresolved == 0 and run.contact_report.largest_overlap < 1e-9
    # The tolerance of the solver is 1e-12 of a radius for each drift, as a distance and, over dt, as a speed.
    steps = end / dt
    assert x[0] == pytest.approx([-2 + speed * end, 0.1], abs=steps * 1e-13) and v[0] == pytest.approx(
        [speed, 0], abs=1e-13 / dt
    )
    # The centre is a radius off both sides: r / sin(half of the angle) above the corner.
    assert y[1] == pytest.approx([11, 0.1 * math.sqrt(5)], abs=1e-12) and np.abs(w[1]).max() < 1e-13 / dt
