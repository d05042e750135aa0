"""Walls that turn, against a second computation: straight flights, contacts by bisection, and reflections in NumPy."""

import numpy as np
import pytest
from scipy.optimize import brentq
from turned_walls import ABOUT, AXIS, FRICTION, RESTITUTION, SHIFT, WALLS, Reference, end_of, scene

from mpp_taichi import Simulation

CASES = [(kind, flat) for flat in (True, False) for kind in WALLS]
NAMES = [f"{kind} in {2 if flat else 3} dimensions" for kind, flat in CASES]


def checked(kind, flat, *, solver="swept", dt=1e-3, shifts=True):
    """Errors of the place and of the velocity at the end, and the number of bounces."""
    x, v = np.array([0.0, 0.1, 0.0]), np.array([0.6, -2.0, 0.0 if flat else 0.3])
    place, velocity, count = Reference(kind, flat=flat, shifts=shifts).fly(x, v, 1.5, FRICTION)
    motion = SHIFT[: 2 if flat else 3] if shifts else None
    given = scene(kind, flat=flat, solver=solver, dt=dt, x=x, v=v, axis=AXIS, motion=motion, friction=FRICTION)
    found, report = end_of(given)
    assert report.wall_count == count > 0
    return np.abs(found.position[0] - place).max(), np.abs(found.velocity[0] - velocity).max(), count


@pytest.mark.sampled(5)
@pytest.mark.parametrize(("kind", "flat"), CASES, ids=NAMES)
def test_a_sphere_meets_a_wall_that_turns_and_is_shaken_as_a_second_computation_says(kind, flat):
    errors = {}
    for dt in (1e-3, 2.5e-4):
        place, velocity, count = checked(kind, flat, dt=dt)
        # Between two tangents a flight is off by up to h²/2 times y″ (_turnings.py), which is below 8 here, and each bounce
        # hands on up to five times the error of the time before, at speeds up to 2.
        assert max(place, velocity) < 5.0**count * 8.0 * dt**2
        errors[dt] = max(place, velocity)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("kind", ["plane", "box", "cylinder", "polygon", "segment"])
def test_overlaps_at_the_ends_of_steps_are_met_as_well(kind):
    flat = kind != "cylinder"
    errors = [max(checked(kind, flat, solver="pairwise", dt=dt)[:2]) for dt in (1e-3, 1.25e-4)]
    # A bounce comes up to a step late: at speeds up to 3, velocities that change by up to 4, and up to three bounces.
    assert errors[0] < 5.0**3 * 4.0 * 1e-3 and errors[1] < errors[0] / 2.0


def test_the_time_of_a_contact_converges_with_the_second_power_of_the_step():
    # A ball flies along a paddle, so that the force of Coriolis bends its flight towards the paddle in the frame of the paddle.
    x, v, radius, rate = np.array([-1.5, 0.6]), np.array([1.5, -1.0]), 0.2, 0.7

    def gap(time):
        place = x + v * time
        return np.cos(rate * time) * place[1] - np.sin(rate * time) * place[0] - radius

    meet = brentq(gap, 0.0, 1.0, xtol=1e-15)
    n, place = np.array([-np.sin(rate * meet), np.cos(rate * meet)]), x + v * meet
    w = rate * np.array([-place[1], place[0]])
    after = v - 2.0 * (n @ (v - w)) * n
    errors = []
    for steps in (11.9, 47.9):  # the contact is at nine tenths of a step, which is one piece
        given = {
            "dimensions": 2,
            "particles": [{"body": {"mass": 1, "position": x.tolist(), "velocity": v.tolist(), "radius": radius}}],
            "walls": [{"segment": {"from": [-3, 0], "to": [3, 0], "turning": {"angle": f"{rate} * t"}}}],
            "contacts": {"hard_spheres": {"solver": "swept"}},
            "integrator": {"velocity_verlet": {"dt": meet / steps}},
        }
        with Simulation(given, backend="cpu", precision="f64") as simulation:
            simulation.run(steps=int(steps) + 1)
            found = simulation.snapshot()
        assert simulation.contact_report.wall_count == 1
        errors.append(np.abs(found.position[0, :2] - (place + after * (found.time - meet))).max())
    # To lowest order the error grows as the square of the step; the next order is a part of some ω h of it.
    assert errors[0] / errors[1] == pytest.approx((47.9 / 11.9) ** 2, rel=0.1)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("solver", ["swept", "pairwise"])
@pytest.mark.parametrize("kind", ["polygon", "cylinder", "box"])
def test_a_wall_turned_by_a_given_angle_is_the_same_wall_placed_anew(kind, solver):
    angle = np.pi / 2.0 if kind == "box" else 0.7
    cosine, sine = np.cos(angle), np.sin(angle)

    def turned(point):
        x, y = np.subtract(point[:2], ABOUT[:2])
        return [ABOUT[0] + cosine * x - sine * y, ABOUT[1] + sine * x + cosine * y, *([0.0] if len(point) < 3 else point[2:])]

    still = dict(WALLS[kind])
    if kind == "polygon":
        still["points"] = [turned(point) for point in still["points"]]
    elif kind == "cylinder":
        x, y, z = still["axis"]
        still |= {"point": turned(still["point"]), "axis": [cosine * x - sine * y, sine * x + cosine * y, z]}
    else:
        corners = np.array([turned(still[key]) for key in ("lower", "upper")])
        still |= {"lower": corners.min(axis=0).tolist(), "upper": corners.max(axis=0).tolist()}
    one = scene(kind, solver=solver, turning={"angle": angle, "about": ABOUT})
    other = scene(kind, solver=solver, turning=None) | {"walls": [{kind: still | {"restitution": RESTITUTION}}]}
    (first, report), (second, same) = end_of(one), end_of(other)
    assert report.wall_count == same.wall_count > 0
    assert np.abs(first.position - second.position).max() < 1e-9  # rounding, enlarged up to five times by each bounce
    assert np.abs(first.velocity - second.velocity).max() < 1e-9


def test_balls_meet_the_end_of_a_segment_that_turns():
    reference = Reference("segment", flat=True, shifts=False)
    end = reference.from_wall(np.array([0.5, -0.4, 0.0]), 0.5)
    begin = end + [0.35, 0.55, 0.0]
    v = (end + [0.06, 0.0, 0.0] - begin) / 0.5  # a part of a radius beside the end
    place, velocity, count = reference.fly(begin, v, 1.0, FRICTION)
    y = reference.into_wall(begin + v * 0.47, 0.47)
    assert count == 1 and y[0] > 0.5, "the ball is beyond the end when it meets it"
    for solver, bound in (("swept", 5.0 * 8.0 * 1e-6), ("pairwise", 5.0 * 4.0 * 1e-3)):
        found, report = end_of(scene("segment", flat=True, solver=solver, x=begin, v=v, friction=FRICTION), duration=1.0)
        assert report.wall_count == 1
        assert np.abs(found.position[0] - place).max() < bound
        assert np.abs(found.velocity[0] - velocity).max() < bound


@pytest.mark.parametrize(
    ("kind", "moved"),
    [
        ("polygon", {"turning": {"angle": "40*t"}}),
        ("polygon", {"turning": {"angle": "3*sin(13*t)"}}),
        ("polygon", {"turning": None, "motion": ["0.3*sin(40*t)", "0"]}),
        ("box", {"turning": {"angle": "40*t"}}),
    ],
    ids=["turned", "swung", "shaken", "box"],
)
def test_no_ball_comes_through_a_wall_that_turns_fast(kind, moved):
    # A corner of the square moves by up to 28 radii in a step, and a ball that it hits by several times as much.
    given = scene(kind, flat=True, dt=1e-2, steps=100, **({"motion": None} | moved))
    given["particles"] = [
        {"body": {"mass": 1, "position": place, "velocity": speed, "radius": 0.02}}
        for place, speed in (([0.4, 0.1], [6.0, 1.0]), ([-0.4, 0.3], [3.0, -7.0]), ([0.1, -0.5], [-2.0, 5.0]))
    ]
    found, report = end_of(given, duration=1.0)
    assert report.wall_count > 30 and report.unresolved == 0
    assert np.hypot(*found.position[:, :2].T).max() < 2.0
    # Up to a sixteenth of a radius between two tangents, and as much again until the ball is found in the wall.
    assert report.largest_overlap < 2.0 / 16.0


@pytest.mark.sampled(2)
@pytest.mark.parametrize("precision", ["f64", "f32"])
@pytest.mark.parametrize("solver", ["swept", "pairwise"])
def test_the_work_of_a_wall_closes_the_balance_of_the_energy(solver, precision):
    given = scene("polygon", flat=True, solver=solver, motion=SHIFT[:2], friction=FRICTION)
    with Simulation(given, backend="cpu", precision=precision) as simulation:
        simulation.keep_energy_balance()
        before = simulation.diagnostics()
        simulation.run(duration=1.5)
        report, after = simulation.contact_report, simulation.diagnostics()
    gained = after["total_energy"] - before["total_energy"]
    assert abs(gained) > 0.1 and report.wall_work != 0.0 and report.dissipated_energy > 0.01
    bound = {"f64": 1e-14, "f32": 1e-6}[precision] * 10.0 * report.wall_count  # rounding of each bounce
    assert abs(gained - report.wall_work + report.dissipated_energy) < bound
    assert after["work"] == pytest.approx(report.wall_work) and abs(after["energy_balance_residual"]) < bound


def test_a_ball_that_lies_on_a_paddle_does_not_sink_through_it():
    # The paddle carries the ball up in a quarter of a turn, and each step's tangent leads a little into the paddle.
    given = {
        "dimensions": 2,
        "particles": [{"body": {"mass": 1.0, "position": [0.8, 0.05], "radius": 0.05}}],
        "walls": [{"segment": {"from": [0, 0], "to": [1, 0], "turning": {"angle": "t^2"}, "restitution": 0}}],
        "contacts": {"hard_spheres": {"solver": "swept"}},
        "integrator": {"velocity_verlet": {"dt": 2e-2}},
    }
    found, report = end_of(given, duration=0.6)
    angle = 0.36
    across = found.position[0, :2] @ [-np.sin(angle), np.cos(angle)]
    assert report.wall_count > 15
    assert across == pytest.approx(0.05, abs=0.05 / 16.0)


def test_a_paddle_that_turns_back_within_a_step_does_not_hit():
    # On its tangent the paddle meets the ball at a quarter of the step; it turns back at a tenth of the step.
    given = scene("segment", flat=True, dt=1e-2, steps=1, x=(0.8, 0.0502, 0.0), v=(0.0, 0.0, 0.0))
    given["particles"][0]["body"]["radius"] = 0.05
    given["walls"] = [{"segment": {"from": [0, 0], "to": [1, 0], "turning": {"angle": "0.1*t - 50*t^2"}}}]
    found, report = end_of(given, duration=1e-2)
    assert report.wall_count == report.unresolved == 0
    assert not found.velocity.any()


def test_paddles_that_turn_against_each_other_bat_balls_to_both_sides():
    given = scene("segment", flat=True, steps=1000)
    given["particles"] = [
        {"body": {"mass": 1, "position": [side * 1.4, 0.4], "velocity": [0.0, -1.0], "radius": 0.1}} for side in (-1.0, 1.0)
    ]
    given["walls"] = [
        {"segment": {"from": [side, 0], "to": [2 * side, 0], "turning": {"angle": f"{side}*0.7*t", "about": [side, 0]}}}
        for side in (-1.0, 1.0)
    ]
    found, report = end_of(given, duration=1.0)
    assert report.wall_count == 2 and found.velocity[1, 1] > 0.5
    assert np.abs(found.position[0] * (-1.0, 1.0, 1.0) - found.position[1]).max() < 1e-12
