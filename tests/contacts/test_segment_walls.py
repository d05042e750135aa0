"""Segments and polygons with every contact solver: closed forms, energy, billiards, corners, and no tunnelling."""

import math

import numpy as np
import pytest
import segment_billiard

from mpp_taichi import Simulation

UNIT = 2.0**-53
STEPPED = {"integrator": {"leapfrog": {"dt": 0.05}}}
METHODS = {
    "event_driven": {"integrator": {"event_driven": {"dt": 1.0}}},
    "swept": STEPPED,
    "simultaneous": STEPPED,
    "resting": STEPPED,
    "merging": STEPPED,
    "located": {"integrator": {"adaptive_bogacki_shampine": {"dt": 1.0}}},
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
        **METHODS[solver],
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


@pytest.mark.sampled(6)
@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("solver", METHODS)
def test_a_disk_bounces_off_sides_and_ends_as_the_brute_force_reference_says(solver, precision):
    """In a room of four walls with two blades, one of them inelastic, to what rounding makes of it.

    The reference tells by how much a change of the start grows. The roundings of the steps have no preferred sign, so that
    they grow as the root of their number, from one unit of a place below 2; eight times that is allowed.
    """
    walls = [polygon(ROOM), *({"segment": {"from": list(a), "to": list(b), "restitution": e}} for a, b, e in BLADES)]
    sides = [*((a, b, 1.0) for a, b in zip(ROOM, [*ROOM[1:], ROOM[0]])), *BLADES]
    start, speed, end, steps = (0.13, 0.9), (-0.6316, 0.7753), 8.0, 160
    x, v, bounces = segment_billiard.run(start, speed, 0.1, sides, end)
    other, _, _ = segment_billiard.run((start[0], start[1] + 1e-9), speed, 0.1, sides, end)
    growth = np.abs(other - x).max() / 1e-9
    assert bounces >= 5 and 10 < growth < 100 and v @ v < 0.9 * np.dot(speed, speed)
    unit = UNIT * (2.0**29 if precision == "f32" else 1.0)
    with Simulation(scene(solver, [ball(start, speed)], walls), backend="cpu", precision=precision) as run:
        run.run(until=end)
        found, report = state(run), run.contact_report
    assert report.wall_count == bounces and report.unresolved == 0
    assert max(np.abs(found[0][0] - x).max(), np.abs(found[1][0] - v).max()) < 8 * growth * math.sqrt(steps) * 2 * unit
    # The impulses on all sides of the polygon are one number: with the blades there are three.
    assert len(report.wall_impulse) == 3 and sum(report.wall_impulse) > 0
