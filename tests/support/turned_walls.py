"""A sphere beside a wall that turns: its scene, and a second computation in NumPy with bisection for the contacts."""

from functools import partial

import numpy as np
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from mpp_taichi import Simulation

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

    def gap_on(self, x, v, begin, time):
        """The gap at a time of a flight that begins at x."""
        return self.nearest(self.into_wall(x + v * (time - begin), time))[0]

    def fly(self, x, v, end, friction):
        """Place and velocity at a time, and the number of bounces."""
        x, v, time, count = np.array(x, float), np.array(v, float), 0.0, 0
        while True:
            grid = np.linspace(time + 1e-7, end, 4000)
            gaps = np.array([self.gap_on(x, v, time, t) for t in grid])
            hits = np.flatnonzero((gaps[1:] < 0.0) & (gaps[:-1] >= 0.0))
            if not len(hits):
                return x + v * (end - time), v, count
            meet = brentq(partial(self.gap_on, x, v, time), grid[hits[0]], grid[hits[0] + 1], xtol=1e-14)
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
