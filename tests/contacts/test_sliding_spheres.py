"""Event-driven spheres that slide along walls in bounces which are hardly higher than the rounding of their places."""

import numpy as np
import pytest
from test_contacts import UNIT

from mpp_taichi import Simulation

G, RADIUS, COUNT, WAY = 9.81, 0.16, 12, 3.0
SLOPE = np.array([4.0, -3.0, 0.0]) / 5.0  # down along the wall
NORMAL = np.array([3.0, 4.0, 0.0]) / 5.0
TOP = np.array([-3.0, 9.0, 0.0])
HEIGHT = 1e-6 * np.arange(1, COUNT + 1)  # in f32, places are rounded by 5e-7
DURATION = np.sqrt(2.0 * WAY / (0.6 * G))


def sliding(wall, start, precision, dimensions=2, *, free=True, **bounces):
    """A simulation of spheres that are at rest above a wall."""
    free = [free, True, True][:dimensions]
    bodies = [{"mass": 1.0, "radius": RADIUS, "position": place[:dimensions].tolist(), "free": free} for place in start]
    scene = {
        "dimensions": dimensions,
        "particles": [{"body": body} for body in bodies],
        "forces": [{"uniform_gravity": {"acceleration": [0.0, -G, 0.0][:dimensions]}}],
        "contacts": {"hard_spheres": {"solver": "event_driven", **bounces}},
        "walls": [wall],
        "run": {"duration": DURATION},
    }
    return Simulation(scene, backend="cpu", precision=precision)


@pytest.mark.parametrize("precision", ["f32", "f64"])
@pytest.mark.parametrize("kind", ["segment", "plane"])
def test_spheres_slide_down_a_slope_as_without_friction(kind, precision):
    """Bounces do not act along the slope, and no bounce may lose all of its speed across the slope to round-off."""
    walls = {
        "segment": {"segment": {"from": (TOP - SLOPE)[:2].tolist(), "to": (TOP + 12.0 * SLOPE)[:2].tolist()}},
        "plane": {"plane": {"point": TOP.tolist(), "normal": NORMAL.tolist()}},
    }
    start = TOP + 0.5 * np.arange(COUNT)[:, None] * SLOPE + (RADIUS + HEIGHT)[:, None] * NORMAL
    bounces = {"restitution": 0.2, "contact_time": 0.01}
    with sliding(walls[kind], start, precision, 2 if kind == "segment" else 3, **bounces) as simulation:
        simulation.run(duration=DURATION)
        end, report = simulation.snapshot().position, simulation.contact_report
    contacts, unit, size = report.wall_count / COUNT, UNIT[precision], np.abs(end).max()
    assert report.pair_count == 0 and contacts > 100
    # Each contact rounds a place of up to `size` and a velocity of up to 6, which counts for the whole time.
    assert np.abs((end - start) @ SLOPE - WAY).max() < unit * 10.0 * contacts * (size + 6.0 * DURATION)
    assert report.largest_overlap * RADIUS < 8.0 * unit * size
    # A bounce is as high as the first fall, or as the roundings make it by and by, for which a walk at random is the measure.
    gap = (end - TOP) @ NORMAL - RADIUS
    assert (gap > -8.0 * unit * size).all()
    assert (gap < HEIGHT + 8.0 * unit * size * np.sqrt(10.0 * contacts)).all()


def test_a_contact_with_an_oblique_wall_leaves_a_held_axis_where_it_is():
    """Spheres that fall along y and cannot move along x, in f32, where most contacts leave an overlap of a rounding."""
    start = TOP + 0.5 * np.arange(COUNT)[:, None] * SLOPE + (RADIUS + 0.1) * NORMAL
    wall = {"plane": {"point": TOP[:2].tolist(), "normal": NORMAL[:2].tolist()}}
    with sliding(wall, start, "f32", free=False) as simulation:
        before = simulation.snapshot().position[:, 0]
        simulation.run(duration=5.0)
        assert simulation.contact_report.wall_count > 50 and simulation.contact_report.largest_overlap > 0.0
        np.testing.assert_array_equal(simulation.snapshot().position[:, 0], before)
