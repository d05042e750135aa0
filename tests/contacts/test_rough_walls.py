"""Friction on walls: drums, belts and planes that tilt, against closed forms."""

import numpy as np
import pytest
from turned_walls import end_of, scene


@pytest.mark.sampled(2)
@pytest.mark.parametrize("solver", ["swept", "pairwise"])
@pytest.mark.parametrize(("kind", "flat"), [("cylinder", True), ("cylinder", False), ("sphere", False)])
@pytest.mark.parametrize("friction", [0.05, 5.0])
def test_a_wall_that_turns_about_its_own_axis_drags_by_friction(kind, flat, solver, friction):
    # A ball flies from the middle straight at the wall, which turns at the rate 2: friction drags it.
    rate, dimensions = 2.0, 2 if flat else 3
    wall = {
        "radius": 1.0,
        "turning": {"angle": f"{rate}*t", "about": [0.0] * dimensions},
        "friction": friction,
        "restitution": 0.5,
    }
    given = scene("sphere", flat=flat, solver=solver, x=(0.0, 0.0, 0.0), v=(0.8, 0.0, 0.0))
    given["walls"] = [{kind: wall | {"center" if kind == "sphere" else "point": [0.0] * dimensions}}]
    found, report = end_of(given, duration=1.2)
    dragged = min(rate * 1.0, friction * 1.5 * 0.8)  # the mass is 1, and (1 + e) 0.8 is the impulse along the normal
    assert report.wall_count == 1
    # Overlaps are found up to a step late, where the wall beside the ball has turned on.
    bound = 1e-12 if solver == "swept" else 2.0 * rate * 1e-3
    assert found.velocity[0] == pytest.approx([-0.4, dragged, 0.0], abs=bound)
    assert report.dissipated_energy == pytest.approx(
        0.5 * 0.8**2 * (1 - 0.5**2) + dragged * (rate - 0.5 * dragged), abs=10.0 * bound
    )
    assert report.wall_work == pytest.approx(rate * dragged, abs=10.0 * bound)


def test_a_conveyor_belt_speeds_a_parcel_up_until_both_move_alike():
    # A belt that runs at 1 along x below a parcel at rest: the friction mu g makes it as fast after 1/(mu g).
    given = {
        "particles": [{"body": {"mass": 3.0, "position": [0.0, 0.0, 0.1], "radius": 0.1}}],
        "forces": [{"uniform_gravity": {"acceleration": [0.0, 0.0, -10.0]}}],
        "walls": [
            {"plane": {"point": [0, 0, 0], "normal": [0, 0, 1], "velocity": [1, 0, 0], "friction": 0.2, "restitution": 0}}
        ],
        "contacts": {"hard_spheres": {"solver": "swept"}},
        "integrator": {"velocity_verlet": {"dt": 1e-3}},
    }
    half, _ = end_of(given, duration=0.25)
    end, report = end_of(given, duration=1.0)
    # A step's impulse is that of its kick; the first half kick of the run comes half a step late: mu g h / 2.
    assert half.velocity[0] == pytest.approx([0.5, 0.0, half.velocity[0, 2]], abs=2.0 * 1e-3)
    assert end.velocity[0, 0] == pytest.approx(1.0, abs=1e-12)
    assert end.position[0, 0] == pytest.approx(0.25 + 0.5, abs=1e-3)
    # m u²/2 of the sliding in the frame of the belt, and m (g h)²/2 of each kick towards the belt, which the contact takes.
    kicks = 1000 * 0.5 * 3.0 * (10.0 * 1e-3) ** 2
    assert report.dissipated_energy == pytest.approx(0.5 * 3.0 + kicks, abs=3.0 * 2e-3)


def test_a_puck_on_a_plane_that_tilts_slips_at_the_angle_of_friction():
    # Below tan(angle) = mu the puck stays; from there on it slides by g (sin - mu cos) (a slow turning adds little).
    rate, mu, g, dt, radius = 0.1, 0.3, 10.0, 2.5e-4, 1e-3
    given = {
        "dimensions": 2,
        "particles": [{"body": {"mass": 1.0, "position": [0.0, radius], "radius": radius}}],
        "forces": [{"uniform_gravity": {"acceleration": [0.0, -g]}}],
        "walls": [
            {"plane": {"point": [0, 0], "normal": [0, 1], "turning": {"angle": f"-{rate}*t"}, "friction": mu, "restitution": 0}}
        ],
        "contacts": {"hard_spheres": {"solver": "swept"}},
        "integrator": {"velocity_verlet": {"dt": dt}},
    }
    slips = np.arctan(mu) / rate
    before, _ = end_of(given, duration=0.9 * slips)
    angle = rate * 0.9 * slips
    at_rest = radius * np.array([np.sin(angle), np.cos(angle)])
    # Until it slips the puck goes with the plane; as it does not spin, it rolls by up to radius times the angle.
    assert np.abs(before.position[0, :2] - at_rest).max() < radius * angle
    after, report = end_of(given, duration=slips + 1.0)
    times = np.linspace(0.0, 1.0, 2001)
    push = g * (np.sin(np.arctan(mu) + rate * times) - mu * np.cos(np.arctan(mu) + rate * times))
    way = np.sum((1.0 - times) * push) * (times[1] - times[0])
    angle = np.arctan(mu) + rate
    along = after.position[0, :2] @ [np.cos(angle), -np.sin(angle)]
    assert along == pytest.approx(way, rel=0.02)  # the force of Coriolis over g: 2 rate v / g = 1 %
    assert report.largest_overlap < 2.0 / 16.0, "the puck does not sink into the plane, which turns towards it"
