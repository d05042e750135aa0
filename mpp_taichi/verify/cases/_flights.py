"""Hard spheres: their scenes for every contact solver, and their motion event by event in NumPy, in long double."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mpp_taichi import component
from mpp_taichi.contacts._report import ContactReport
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.verify.bounds import rounded
from mpp_taichi.verify.case import Found
from mpp_taichi.verify.place import Place, sound

REAL = ("f64", "f32")
BY_EVENT = "event by event in long double, in NumPy"
TOGETHER = "simultaneous"  # resolves spheres that touch as a group
STEPPING_PAIRS = "pairwise"
MERGING = "merging"
FALLING = ("event_driven", "located")  # follow a fall under gravity to its contact

EXACT = ("event_driven", "located", "simultaneous", "swept")
"""Solvers that find each contact at its exact time."""
SHIFT = 1e-9  # of a second start, by which the growth of errors is measured


@dataclass(frozen=True)
class Balls:
    """Spheres in free flight, in a space of as many dimensions as `position` has columns.

    position, velocity   (N, d);  radius, mass (N,)
    planes               walls across an axis: (axis, side of the spheres ±1, place)
    restitution          of all contacts
    """

    position: np.ndarray
    velocity: np.ndarray
    radius: np.ndarray
    mass: np.ndarray
    planes: tuple[tuple[int, int, float], ...] = ()
    restitution: float = 1.0

    def scene(self, solver: str, *, dt: float, contacts: dict[str, Any] | None = None, **more: Any) -> dict[str, Any]:
        """The scene for a solver, with a method that goes with it; `contacts` are further keys of the contacts."""
        count, dimensions = self.position.shape
        rows = np.zeros((2, count, 3))
        rows[:, :, :dimensions] = self.position, self.velocity
        bodies = [
            {"mass": m, "radius": r, "position": x, "velocity": v}
            for m, r, x, v in zip(self.mass.tolist(), self.radius.tolist(), *rows.tolist())
        ]
        walls = []
        for axis, side, at in self.planes:
            unit = np.eye(3)[axis]
            plane = {"point": (at * unit).tolist(), "normal": (side * unit).tolist(), "restitution": self.restitution}
            walls.append({"plane": plane})
        merges, flies = (component.flag("contacts", solver, key) for key in ("merges", "flies"))
        bounces = {} if merges else {"restitution": self.restitution}
        leads = component.flag("contacts", solver, "leads")
        method = {"event_driven": {"dt": dt}} if flies else {"adaptive_bogacki_shampine" if leads else "leapfrog": {"dt": dt}}
        return {
            "dimensions": dimensions,
            "particles": [{"body": body} for body in bodies],
            "contacts": {"hard_spheres": {"solver": solver, **bounces, **(contacts or {})}},
            "walls": [*walls, *more.pop("walls", [])],
            "integrator": method,
            **more,
        }

    def fly(self, time: float) -> tuple[np.ndarray, np.ndarray, int]:
        """Positions, velocities and the number of contacts: the earliest contact is found among all, and again after it."""
        x, v = self.position.astype(np.longdouble), self.velocity.astype(np.longdouble)
        radius, mass = self.radius.astype(np.longdouble), self.mass.astype(np.longdouble)
        i, j = np.triu_indices(len(x), 1)
        left, count = np.longdouble(time), 0
        while True:
            q, u = x[j] - x[i], v[j] - v[i]
            a, b, c = (u * u).sum(1), (q * u).sum(1), (q * q).sum(1) - (radius[i] + radius[j]) ** 2
            meets = (b < 0.0) & (b * b > a * c)
            after = np.full(len(i), np.inf, np.longdouble)
            after[meets] = np.maximum(c[meets], 0.0) / (np.sqrt(b[meets] ** 2 - a[meets] * c[meets]) - b[meets])
            best, pair = (after.min(), int(after.argmin())) if len(i) else (np.inf, 0)
            wall: tuple[int, int, int] | None = None
            for axis, side, at in self.planes:
                gap, speed = side * (x[:, axis] - at) - radius, side * v[:, axis]
                for k in np.flatnonzero(speed < 0.0):
                    if max(gap[k], 0.0) / -speed[k] < best:
                        best, wall = max(gap[k], 0.0) / -speed[k], (int(k), axis, side)
            if best > left:
                return (x + left * v).astype(float), v.astype(float), count
            x, left, count = x + best * v, left - best, count + 1
            if wall is not None:
                who, axis, side = wall
                v[who, axis] = side * self.restitution * abs(v[who, axis])
                continue
            one, other = i[pair], j[pair]
            n = x[other] - x[one]
            n /= np.sqrt((n * n).sum())
            impulse = (1.0 + self.restitution) * ((v[one] - v[other]) * n).sum() / (1.0 / mass[one] + 1.0 / mass[other])
            v[one] -= impulse / mass[one] * n
            v[other] += impulse / mass[other] * n

    def growth(self, time: float) -> float:
        """The factor by which a small error of the start has grown by the time, at least 1."""
        shift = np.random.default_rng(1).uniform(-1.0, 1.0, self.position.shape)
        near = replace(self, position=self.position + SHIFT * shift).fly(time)
        return max(1.0, float(np.abs(near[0] - self.fly(time)[0]).max()) / (SHIFT * float(np.abs(shift).max())))


def balls(position: Any, velocity: Any, *, radius: Any = 0.5, mass: Any = 1.0, **more: Any) -> Balls:
    """Spheres of one radius and mass, or of their own."""
    x = np.array(position, float)
    count = len(x)
    sizes, masses = (np.broadcast_to(np.asarray(each, float), count).copy() for each in (radius, mass))
    return Balls(x, np.array(velocity, float), sizes, masses, **more)


def solvers(place: Place, names: Sequence[str]) -> list[str]:
    """The solvers of these that a backend has; all of them, which refuse, where it has none."""
    here = [name for name in names if place.backend == "cpu" or not component.flag("contacts", name, "in_turn")]
    return here or list(names)


def rack(rows: int, *, gap: float = 0.0) -> np.ndarray:
    """Places of spheres of radius ½ in a triangle whose tip is at the origin, (N, 2)."""
    spacing = 1.0 + gap
    return np.array([[np.sqrt(0.75) * spacing * k, spacing * (j - 0.5 * k)] for k in range(rows) for j in range(k + 1)])


def three_in_a_row() -> Balls:
    """Balls that never part again: the outer two move in, and e = 1/16 is below 7 − 4√3."""
    return balls([[-2.0, 0.0], [0.0, 0.0], [2.0, 0.0]], [[1.0, 0.0], [0.0, 0.0], [-0.75, 0.0]], restitution=0.0625)


def weight(g: float) -> list[dict[str, Any]]:
    """Gravity along −y, as the forces of a scene."""
    return [{"uniform_gravity": {"acceleration": [0.0, -g, 0.0]}}]


def after(place: Place, scene: dict[str, Any], time: float) -> tuple[Snapshot, ContactReport]:
    """The state at the time, and the counts of the contacts."""
    with place.simulation(scene) as simulation:
        simulation.run(duration=time)
        sound(simulation)
        return simulation.snapshot(), simulation.contact_report


def flight(place: Place, spheres: Balls, *, time: float, dt: float, size: float, least: int = 2, names: Any = EXACT) -> Found:
    """The largest distance from the flight event by event at the time, of the solvers that a place has."""
    x, _, contacts = spheres.fly(time)
    worst, growth = 0.0, spheres.growth(time)
    for solver in solvers(place, names):
        end, report = after(place, spheres.scene(solver, dt=dt), time)
        if report.pair_count + report.wall_count != contacts or contacts < least:
            return Found(math.inf, 0.0, f"{solver} found {report.pair_count + report.wall_count} contacts of {contacts}")
        worst = max(worst, float(np.abs(end.position[:, : x.shape[1]] - x).max()))
    steps = time / dt + contacts
    why = f"{steps:.0f} roundings of places up to {size:.3g}, growing {growth:.3g} times by the {contacts} contacts"
    return Found(worst, growth * rounded(steps) * place.u * size, why)
