"""Nets of springs: each net gives a scene, and its exact motion or shape in NumPy, which shares no code with the program."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from mpp_taichi.verify.bounds import rounding
from mpp_taichi.verify.case import Found
from mpp_taichi.verify.place import Place, sound

SPLITTING, SPLIT_STAGES = "kahan_li8", 17
RUNGE_KUTTA = "rk4"  # errs by (ω dt)⁵/120 of an oscillation in a step; a position is rounded once in a step
MODES = "normal modes of the linear chain, by eigenvectors in double precision"
EXTRAPOLATED = "extrapolated midpoint rule of order 16 in long double, in NumPy"

COLUMNS = (2, 4, 6, 8, 10, 12, 14, 16)  # parts of a step, whose results are extrapolated
SHIFT = 1e-6  # of a second start, by which the growth of errors is measured


@dataclass(frozen=True)
class Net:
    """Masses and springs.

    position, velocity   (N, 3);  mass (N,);  held: numbers of the masses that do not move
    pairs                the two ends of each spring, (S, 2);  stiffness, rest: D and L of each spring
    gravity              acceleration (3,)
    """

    position: np.ndarray
    mass: np.ndarray
    pairs: np.ndarray
    stiffness: np.ndarray
    rest: np.ndarray
    held: tuple[int, ...] = ()
    velocity: np.ndarray | None = None
    gravity: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def free(self) -> np.ndarray:
        """Whether a mass can move, (N,)."""
        return ~np.isin(np.arange(len(self.mass)), self.held)

    def scene(self, integrator: dict[str, Any], *, free: Any = True, damping: float = 0.0, **more: Any) -> dict[str, Any]:
        """The net as a scene; `free` holds axes of all masses that move, `damping` is that of every spring."""
        bodies = [{"mass": m, "position": x} for m, x in zip(self.mass.tolist(), self.position.tolist())]
        for k, body in enumerate(bodies):
            body["free"] = False if k in self.held else free
            if self.velocity is not None:
                body["velocity"] = self.velocity[k].tolist()
        links = zip(self.pairs.tolist(), self.stiffness.tolist(), self.rest.tolist())
        springs = [{"between": ij, "stiffness": d, "rest_length": length, "damping": damping} for ij, d, length in links]
        forces = [{"uniform_gravity": {"acceleration": list(self.gravity)}}] if any(self.gravity) else []
        return {
            "particles": [{"body": body} for body in bodies],
            "springs": [{"link": spring} for spring in springs],
            "forces": [*forces, *more.pop("forces", [])],
            "integrator": integrator,
            **more,
        }

    def forces(self, x: np.ndarray) -> np.ndarray:
        """Of the springs and the weight, (…, N, 3)."""
        d = x[..., self.pairs[:, 1], :] - x[..., self.pairs[:, 0], :]
        length = np.sqrt((d * d).sum(-1))
        pull = (self.stiffness * (length - self.rest) / length)[..., None] * d
        ends = np.zeros((len(self.mass), len(self.pairs)), x.dtype)  # which mass a spring pulls forwards and which backwards
        number = np.arange(len(self.pairs))
        ends[self.pairs[:, 0], number], ends[self.pairs[:, 1], number] = 1.0, -1.0
        return ends @ pull + self.mass[:, None] * np.array(self.gravity)

    def motion(self, time: float, steps: int) -> tuple[np.ndarray, float]:
        """Positions at the time, and the factor by which a small error of the start has grown by then, at least 1.

        Gragg's modified midpoint rule, extrapolated to a step of zero in long double (order 16, Bulirsch and Stoer).
        """
        start = np.stack([self.position, np.zeros_like(self.position) if self.velocity is None else self.velocity])
        shift = np.random.default_rng(1).uniform(-1.0, 1.0, start.shape) * self.free[:, None] * (start.any(axis=(0, 1)))
        y = np.stack([start, start + SHIFT * shift], axis=1).astype(np.longdouble)  # (x or v, copy, N, 3)
        weight = np.where(self.free, 1.0 / self.mass, 0.0)[:, None]

        def slope(y: np.ndarray) -> np.ndarray:
            return np.stack([y[1] * self.free[:, None], weight * self.forces(y[0])])

        h = np.longdouble(time) / steps
        for _ in range(steps):
            table: list[np.ndarray] = []
            for n in COLUMNS:
                before, now = y, y + h / n * slope(y)
                for _ in range(n - 1):
                    before, now = now, before + 2 * h / n * slope(now)
                row = [0.5 * (before + now + h / n * slope(now))]
                for k, old in enumerate(table, start=1):
                    row.append(row[-1] + (row[-1] - old) / ((n / COLUMNS[len(table) - k]) ** 2 - 1))
                table = row
            y = table[-1]
        growth = float(np.abs(y[0, 1] - y[0, 0]).max()) / (SHIFT * float(np.abs(shift).max()))
        return y[0, 0].astype(float), max(1.0, growth)

    def stiffness_matrix(self, x: np.ndarray) -> np.ndarray:
        """Second derivative of the elastic energy, (3N, 3N): D n nᵀ + D (1 − L/|d|)(1 − n nᵀ) for each spring."""
        matrix = np.zeros((len(x), 3, len(x), 3))
        for (i, j), stiffness, rest in zip(self.pairs, self.stiffness, self.rest):
            d = x[j] - x[i]
            length = float(np.linalg.norm(d))
            along = np.outer(d, d) / length**2
            block = stiffness * (along + (1.0 - rest / length) * (np.eye(3) - along))
            for a, b, sign in ((i, i, 1), (j, j, 1), (i, j, -1), (j, i, -1)):
                matrix[a, :, b] += sign * block
        return matrix.reshape(x.size, x.size)

    def shape_at_rest(self, axes: tuple[bool, bool, bool]) -> tuple[np.ndarray, float]:
        """Newton's method on the forces along some axes: positions, and the largest flexibility of the shape [length / force].

        Raises ValueError where the method does not converge.
        """
        x, moves = self.position.copy(), (self.free[:, None] & np.array(axes)).ravel()
        for _ in range(50):
            force = self.forces(x).ravel()[moves]
            matrix = self.stiffness_matrix(x)[np.ix_(moves, moves)]
            x.ravel()[moves] += np.linalg.solve(matrix, force)
        lowest = float(np.linalg.eigvalsh(matrix)[0])
        if not (np.abs(force).max() < 1e-9 * float(self.stiffness.max()) and lowest > 0.0):
            raise ValueError("no shape at rest was found")
        return x, 1.0 / lowest

    def along_a_line(self, time: float) -> np.ndarray:
        """Places along x at the time of masses that move along x from rest, and keep their order: a sum of normal modes."""
        axes = np.array([True, False, False])
        moves = (self.free[:, None] & axes).ravel()
        placed = self.position.copy()
        root = np.sqrt(np.repeat(self.mass, 3)[moves])
        matrix = self.stiffness_matrix(placed)[np.ix_(moves, moves)] / root / root[:, None]
        square, shape = np.linalg.eigh(matrix)
        # The forces are linear in the places, so that any place gives the place of rest.
        rest = np.linalg.solve(matrix, self.forces(placed).ravel()[moves] / root)
        placed.ravel()[moves] += (rest - shape @ (np.cos(np.sqrt(square) * time) * (shape.T @ rest))) / root
        return placed[:, 0]


def row(
    count: int, *, stiffness: float | np.ndarray = 1.0, mass: float | np.ndarray = 1.0, held: tuple[int, ...] | None = None
) -> Net:
    """Masses in a row along x with a spring of length 1 between neighbours; the ends are held unless `held` is given."""
    position = np.zeros((count, 3))
    position[:, 0] = np.arange(count) - count // 2
    number = np.arange(count - 1)
    return Net(
        position=position,
        mass=np.broadcast_to(np.asarray(mass, float), count).copy(),
        pairs=np.stack([number, number + 1], axis=1),
        stiffness=np.broadcast_to(np.asarray(stiffness, float), count - 1).copy(),
        rest=np.ones(count - 1),
        held=(0, count - 1) if held is None else held,
    )


def sheet(
    shape: tuple[int, int], *, spacing: float, stiffness: float, mass: float, stretch: float, braced: bool = False
) -> Net:
    """Masses in the x–y plane, or x–z where it is braced; `stretch` is the length of a spring over its rest length."""
    i, j = (each.ravel() for each in np.meshgrid(np.arange(shape[0]), np.arange(shape[1])))
    position = spacing * np.stack([i, 0 * i, j] if braced else [i, j, 0 * i], axis=1).astype(float)
    number = np.arange(i.size).reshape(shape[1], shape[0])
    pairs = [(number[:, :-1], number[:, 1:]), (number[:-1], number[1:])]
    if braced:
        pairs += [(number[:-1, :-1], number[1:, 1:]), (number[:-1, 1:], number[1:, :-1])]
    between = np.concatenate([np.stack([a.ravel(), b.ravel()], axis=1) for a, b in pairs])
    length = np.linalg.norm(position[between[:, 1]] - position[between[:, 0]], axis=1)
    rim = (i == 0) if braced else (i == 0) | (j == 0) | (i == shape[0] - 1) | (j == shape[1] - 1)
    return Net(
        position=position,
        mass=np.full(i.size, mass),
        pairs=between,
        stiffness=np.full(len(between), stiffness),
        rest=length / stretch,
        held=tuple(np.flatnonzero(rim).tolist()),
    )


def hanging_row(links: int, *, span: float, stiffness: float, mass: float) -> Net:
    """A row of links of length 1 in all between two hooks, at rest under gravity of 1 along −z: exact in one unknown.

    All springs pull with the same force H along x; V grows along the row by the weight of each mass. The span is the sum of
    (L + T/D) H/T, T = √(H² + V²), which grows with H and is found by bisection.
    """
    length, vertical = 1.0 / links, mass * (np.arange(links) - 0.5 * (links - 1))

    def pulls(horizontal: float) -> tuple[np.ndarray, np.ndarray]:
        tension = np.hypot(horizontal, vertical)
        return length + tension / stiffness, tension

    low, high = 0.0, stiffness
    for _ in range(200):
        middle = 0.5 * (low + high)
        lengths, tension = pulls(middle)
        low, high = (middle, high) if math.fsum(lengths * middle / tension) < span else (low, middle)
    lengths, tension = pulls(low)
    steps = np.stack([lengths * low / tension, 0 * tension, lengths * vertical / tension], axis=1)
    position = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
    chain = row(links + 1, stiffness=stiffness, mass=mass)
    gravity = (0.0, 0.0, -1.0)
    return Net(position, chain.mass, chain.pairs, chain.stiffness, np.full(links, length), chain.held, gravity=gravity)


def ends_of(place: Place, scene: dict[str, Any], steps: int) -> tuple[np.ndarray, np.ndarray]:
    """Positions and velocities after the steps."""
    with place.simulation(scene) as simulation:
        simulation.run(steps=steps)
        sound(simulation)
        end = simulation.snapshot()
    return end.position, end.velocity


def swing(
    place: Place,
    reached: float,
    *,
    steps: int,
    stages: int,
    phase: float,
    size: float,
    amplitude: float | None = None,
    growth: float = 1.0,
) -> Found:
    """The error of oscillations whose frequency does not change with the energy, of places up to `size`."""
    swing = size if amplitude is None else amplitude
    bound, why = rounding(place, steps=steps, stages=stages, phase=phase, leverage=0.0)
    alike = place.force_u * (size + phase * swing)
    factor = f", growing {growth:.3g} times by the equations of motion" if growth > 1.0 else ""
    words = f"{why}, of places up to {size:.3g}; what is rounded alike in all steps shifts the rest by u, the phase by u φ"
    return Found(reached, (bound * size + alike) * growth, words + factor)


def one_spring(position: list[float], *, stiffness: float, rest: float, velocity: list[float] | None = None) -> Net:
    """A mass of 1 at the end of a spring whose other end is held at the origin."""
    speed = None if velocity is None else np.array([[0.0, 0.0, 0.0], velocity])
    places = np.array([[0.0, 0.0, 0.0], position])
    return Net(places, np.ones(2), np.array([[0, 1]]), np.array([stiffness]), np.array([rest]), (0,), speed)


def double_pendulum(stiffness: float) -> Net:
    """A mass of 1 on a stiff spring of length 1 below a hook at y = 1, and a second mass on a spring of 5 below it."""
    places = np.array([[0.0, 1.0, 0.0], [0.564642, 0.174664, 0.0], [1.129285, -0.650671, 0.0]])
    pairs, rest = np.array([[0, 1], [1, 2]]), np.ones(2)
    return Net(places, np.ones(3), pairs, np.array([stiffness, 5.0]), rest, (0,), gravity=(0.0, -1.8, 0.0))
