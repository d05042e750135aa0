"""Walls that turn, against a second computation: straight flights, contacts by bisection, and reflections in NumPy."""

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from mpp_taichi import SceneError, Simulation
from mpp_taichi.errors import MppError, PrecisionError
from mpp_taichi.scene.load import load_scene
from mpp_taichi.start.assemble import assemble
from mpp_taichi.sweep.structure import key_of
from mpp_taichi.views.wall_outline import outline_of

RADIUS, RESTITUTION, FRICTION = 0.1, 0.9, 0.2
# A rate that changes, a start that is turned, and an axis that is in no plane of the coordinates.
ANGLE, ABOUT, AXIS = "0.3 + 0.8*t + 0.2*sin(2*t)", [0.2, 0.1, -0.1], [0.3, -0.2, 1.0]
SHIFT = ["0.1*sin(3*t)", "0.05*t^2", "-0.1*t"]


def angle_at(time):
    return 0.3 + 0.8 * time + 0.2 * np.sin(2.0 * time)


def shift_at(time):
    return np.array([0.1 * np.sin(3.0 * time), 0.05 * time**2, -0.1 * time])


SQUARE = [[-0.9, -0.8], [1.0, -0.9], [0.9, 1.0], [-1.0, 0.8]]
WALLS = {
    "plane": {"point": [0.0, -1.0, 0.0], "normal": [0.2, 1.0, 0.1]},
    "box": {"lower": [-1.0, -1.1, -0.9], "upper": [1.0, 1.0, 1.1]},
    "cylinder": {"point": [0.1, 0.0, 0.0], "axis": [0.1, 0.2, 1.0], "radius": 1.0},
    "sphere": {"center": [0.1, 0.0, 0.0], "radius": 1.0},
    "bat": {"center": [-0.1, -0.7, 0.1], "radius": 0.4, "inside": False},
    "segment": {"from": [-0.5, -0.5], "to": [0.5, -0.4]},
    "polygon": {"points": SQUARE},
}


class Reference:
    """The flight of one sphere of mass 1 beside a wall of which a given part is looked at in the frame of the wall."""

    def __init__(self, kind, *, flat, turns=True, shifts=True, axis=AXIS):
        self.flat, self.kind, self.given = flat, kind, WALLS[kind]
        self.axis = (
            np.array([0.0, 0.0, 1.0]) if flat or kind in ("segment", "polygon") else np.array(axis) / np.linalg.norm(axis)
        )
        self.about = np.array([*ABOUT[:2], 0.0]) if flat else np.array(ABOUT)
        self.turns, self.shifts = turns, shifts

    def rotation(self, time):
        return Rotation.from_rotvec(self.axis * (angle_at(time) if self.turns else 0.0)).as_matrix()

    def shift(self, time):
        return shift_at(time) * (1.0, 1.0, 0.0 if self.flat else 1.0) if self.shifts else np.zeros(3)

    def from_wall(self, y, time):
        return self.about + self.shift(time) + self.rotation(time) @ (y - self.about)

    def into_wall(self, x, time):
        return self.about + self.rotation(time).T @ (x - self.about - self.shift(time))

    def nearest(self, y):
        """Gap of a sphere at y, in the frame of the wall, and the normal towards it, of the nearest part."""
        kind, given = self.kind, self.given
        if kind == "plane":
            n = np.array(given["normal"]) * (1.0, 1.0, 0.0 if self.flat else 1.0)
            n /= np.linalg.norm(n)
            return (y - given["point"]) @ n - RADIUS, n
        if kind == "box":
            parts = []
            for k in range(2 if self.flat else 3):
                unit = np.eye(3)[k]
                parts += [(y[k] - given["lower"][k] - RADIUS, unit), (given["upper"][k] - y[k] - RADIUS, -unit)]
            return min(parts, key=lambda part: part[0])
        if kind in ("segment", "polygon"):
            corners = [np.array([*p, 0.0]) for p in given["points"]] if kind == "polygon" else []
            pairs = list(zip(corners, [*corners[1:], *corners[:1]])) or [
                (np.array([*given["from"], 0.0]), np.array([*given["to"], 0.0]))
            ]
            parts = []
            for begin, end in pairs:
                way, q = end - begin, (y - begin) * (1.0, 1.0, 0.0)
                apart = q - way * np.clip(q @ way / (way @ way), 0.0, 1.0)
                parts.append((np.linalg.norm(apart) - RADIUS, apart / np.linalg.norm(apart)))
            return min(parts, key=lambda part: part[0])
        q = y - np.array(given["point"] if kind == "cylinder" else given["center"])
        if kind == "cylinder":
            axis = np.array([0.0, 0.0, 1.0]) if self.flat else np.array(given["axis"]) / np.linalg.norm(given["axis"])
            q = q - axis * (axis @ q)
        q = q * (1.0, 1.0, 0.0 if self.flat else 1.0)
        distance = np.linalg.norm(q)
        if given.get("inside", True):
            return given["radius"] - RADIUS - distance, -q / distance
        return distance - given["radius"] - RADIUS, q / distance

    def gap(self, x, time):
        return self.nearest(self.into_wall(x, time))[0]

    def fly(self, x, v, end, friction):
        """Place and velocity at a time, and the number of bounces."""
        x, v, time, count = np.array(x, float), np.array(v, float), 0.0, 0
        while True:
            grid = np.linspace(time + 1e-7, end, 4000)
            gaps = np.array([self.gap(x + v * (t - time), t) for t in grid])
            hits = np.flatnonzero((gaps[1:] < 0.0) & (gaps[:-1] >= 0.0))
            if not len(hits):
                return x + v * (end - time), v, count
            meet = brentq(lambda t: self.gap(x + v * (t - time), t), grid[hits[0]], grid[hits[0] + 1], xtol=1e-14)
            x, time, count = x + v * (meet - time), meet, count + 1
            y = self.into_wall(x, time)
            n = self.nearest(y)[1]
            point = y - RADIUS * n
            # The velocity of the touched point is a difference quotient of its places: no formula of a turning stands here.
            w = (self.from_wall(point, time + 1e-6) - self.from_wall(point, time - 1e-6)) / 2e-6
            n = self.rotation(time) @ n
            impulse = -(1.0 + RESTITUTION) * n @ (v - w)
            assert impulse > 0.0
            v = v + impulse * n
            slide = v - w - n * (n @ (v - w))
            v = v - slide * min(1.0, friction * impulse / np.linalg.norm(slide))


def in_space(value, dimensions):
    """A number, a vector or a list of vectors with as many components as the scene has dimensions."""
    if not isinstance(value, list):
        return value
    if isinstance(value[0], list):
        return [in_space(each, dimensions) for each in value]
    return [*value, 0.0][:dimensions]


def scene(kind, *, flat=False, solver="swept", dt=1e-3, steps=1500, x=(0.0, 0.1, 0.0), v=(0.6, -2.0, 0.3), axis=None, **more):
    dimensions = 2 if flat else 3
    name = "sphere" if kind == "bat" else kind
    given = {key: in_space(value, dimensions) for key, value in WALLS[kind].items() if not (flat and key == "axis")}
    if kind in ("segment", "polygon"):
        axis = None
    turning = {"angle": ANGLE, "about": ABOUT[:dimensions]} | ({} if flat or axis is None else {"axis": axis})
    wall = given | {"restitution": RESTITUTION, "turning": turning} | more
    return {
        "dimensions": dimensions,
        "particles": [{"body": {"mass": 1, "position": [*x][:dimensions], "velocity": [*v][:dimensions], "radius": RADIUS}}],
        "walls": [{name: {key: value for key, value in wall.items() if value is not None}}],
        "contacts": {"hard_spheres": {"solver": solver}},
        "integrator": {"velocity_verlet": {"dt": dt}},
        "run": {"duration": steps * dt},
    }


def end_of(given, *, duration=1.5, **more):
    with Simulation(given, **({"backend": "cpu", "precision": "f64"} | more)) as simulation:
        simulation.run(duration=duration)
        return simulation.snapshot(), simulation.contact_report


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


@pytest.mark.parametrize("angle", ["40*t", "3*sin(13*t)"])
def test_no_ball_comes_through_a_wall_that_turns_fast(angle):
    # A corner of the square moves by up to 28 radii in a step, and a ball that it hits by several times as much.
    given = scene("polygon", flat=True, dt=1e-2, steps=100, motion=None, turning={"angle": angle})
    given["particles"] = [
        {"body": {"mass": 1, "position": place, "velocity": speed, "radius": 0.02}}
        for place, speed in (([0.4, 0.1], [6.0, 1.0]), ([-0.4, 0.3], [3.0, -7.0]), ([0.1, -0.5], [-2.0, 5.0]))
    ]
    found, report = end_of(given, duration=1.0)
    assert report.wall_count > 50 and report.unresolved == 0
    assert np.hypot(*found.position[:, :2].T).max() < 1.5
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
