"""Numpy steps: leapfrog, velocity Verlet, yoshida4, PEFRL and classical Runge–Kutta in float64, for copies side by side.

Written from the papers, independently of `integrators/`, whose steps are judged by these.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mpp_taichi.compare.numpy_reference import DIRECT, NumpyForces, norm, only_turns
from mpp_taichi.scene.spec import SceneSpec

CUBE_ROOT = 2.0 ** (1.0 / 3.0)
_OUTER = 1.0 / (2.0 - CUBE_ROOT)  # Yoshida, Phys. Lett. A 150 (1990) 262, eq. 2.11
_XI, _LAMBDA, _CHI = 0.1786178958448091, -0.2123418310626054, -0.06626458266981849  # Omelyan et al., CPC 146 (2002) 188


@dataclass(frozen=True)
class Table:
    """A splitting: (kick, drift) in turn, as parts of dt; `order` is the order of the method."""

    stages: tuple[tuple[float, float], ...]
    order: int


SPLITTINGS = {
    "symplectic_euler": Table(((1.0, 1.0),), 1),
    "leapfrog": Table(((0.0, 0.5), (1.0, 0.5)), 2),
    "velocity_verlet": Table(((0.5, 1.0), (0.5, 0.0)), 2),
    "yoshida4": Table(
        (
            (0.0, _OUTER / 2),
            (_OUTER, (1.0 - _OUTER) / 2),
            (1.0 - 2.0 * _OUTER, (1.0 - _OUTER) / 2),
            (_OUTER, _OUTER / 2),
        ),
        4,
    ),
    "pefrl": Table(
        (
            (0.0, _XI),
            (0.5 - _LAMBDA, _CHI),
            (_LAMBDA, 1.0 - 2.0 * (_CHI + _XI)),
            (_LAMBDA, _CHI),
            (0.5 - _LAMBDA, _XI),
        ),
        4,
    ),
}
METHODS = (*SPLITTINGS, "rk4")


def refusal(spec: SceneSpec) -> str | None:
    """The reason why the scene's integrator is not among these; None where it is."""
    if spec.contacts is not None or spec.walls:
        return "NumPy steps know no contacts and no walls"
    if any(force.parameters.get("solver", DIRECT) != DIRECT for force in spec.forces):
        return "a tree is cut where a tolerance says, and rounding may decide that"
    name = spec.integrator.name
    return None if name in METHODS else f"the NumPy backend steps by {', '.join(METHODS)}, not by {name}"


class NumpySteps:
    """Copies of a scene that are stepped together; `dt` has one entry for each copy."""

    def __init__(
        self, reference: NumpyForces, method: str, dt: np.ndarray, noise: "Noise | None" = None, *, turns: bool = True
    ) -> None:
        """Bind the forces, the method and the steps.

        With `turns`, kicks solve forces that only turn the velocity in closed form, as devices do that have sines.
        """
        self.reference, self.method, self.noise = reference, method, noise
        self.turns = turns and only_turns(reference.spec, reference.bodies.damping)
        self.dt = np.asarray(dt, float)[:, None, None]
        self.position = self.velocity = np.zeros((0, 0, 3))
        self._force: np.ndarray | None = None

    def start(self, position: np.ndarray, velocity: np.ndarray) -> None:
        """Begin at these positions and velocities, (copies, N, 3) each."""
        self.position, self.velocity = position.copy(), velocity * self.reference.bodies.free
        self._force = None

    def advance(self, steps: int) -> None:
        """Take a number of steps."""
        step: Callable[[], None] = self._runge_kutta if self.method == "rk4" else self._splitting
        for _ in range(steps):
            step()
            if self.noise is not None:
                self.position += self.noise.of_position * np.abs(self.position)
                self.velocity += self.noise.of_velocity * np.abs(self.velocity)
                self._force = None

    def _splitting(self) -> None:
        table = SPLITTINGS[self.method]
        for kick, drift in table.stages:
            if kick:
                self._kick(kick * self.dt, table.order)
            if drift:
                self.position = self.position + (drift * self.dt) * self.velocity
                self._force = None

    def _kick(self, h: np.ndarray, order: int) -> None:
        """v' = A + f(v) at fixed positions over h; with a friction f, by a method of the splitting's order."""
        if self._force is None:
            self._force = self.reference.steady(self.position)
        if not self.reference.depends_on_velocity:
            self.velocity = self.velocity + h * self._force
            return
        first, steady = self.velocity, self._force
        if self.turns:
            self.velocity = first + self._turned(h, steady + self.reference.friction(self.position, first))
            return

        def slope(velocity: np.ndarray) -> np.ndarray:
            return steady + self.reference.friction(self.position, velocity)

        if order == 1:
            self.velocity = first + h * slope(first)
        elif order == 2:
            self.velocity = first + h * slope(first + 0.5 * h * slope(first))
        else:
            k1 = slope(first)
            k2 = slope(first + 0.5 * h * k1)
            k3 = slope(first + 0.5 * h * k2)
            k4 = slope(first + h * k3)
            self.velocity = first + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)

    def _turned(self, h: np.ndarray, start: np.ndarray) -> np.ndarray:
        """The change of the velocity over h by v' = A + v × Ω, which is `start` at first.

        Along the unit vector n of Ω it is h a, and across n it is (sin ωh)/ω a + (1 − cos ωh)/ω a × n, with a = A + v × Ω and
        ω = |Ω|. Ω is read from the forces at the velocities e_x and e_y, on axes that are not held.
        """
        free = self.reference.bodies.free
        rest = self.reference.friction(self.position, np.zeros_like(start))
        along_x, along_y = (
            self.reference.friction(self.position, np.zeros_like(start) + unit * free) - rest for unit in np.eye(3)[:2]
        )
        turn = np.stack([-along_y[..., 2], along_x[..., 2], along_y[..., 0]], axis=-1)
        rate = norm(turn)[..., None]
        turns = rate > 0.0
        safe = np.where(turns, rate, 1.0)
        axis = turn / safe
        along = axis * np.sum(axis * start, axis=-1, keepdims=True)
        across = start - along
        by_sine = np.where(turns, np.sin(rate * h) / safe, h)
        by_cosine = np.where(turns, 2.0 * np.sin(0.5 * rate * h) ** 2 / safe, 0.0)
        return np.asarray(h * along + by_sine * across + by_cosine * np.cross(across, axis))

    def _runge_kutta(self) -> None:
        """Kutta, Z. Math. Phys. 46 (1901) 435."""
        x, v, h, acceleration = self.position, self.velocity, self.dt, self.reference.acceleration
        a1 = acceleration(x, v)
        v2 = v + 0.5 * h * a1
        a2 = acceleration(x + 0.5 * h * v, v2)
        v3 = v + 0.5 * h * a2
        a3 = acceleration(x + 0.5 * h * v2, v3)
        v4 = v + h * a3
        a4 = acceleration(x + h * v3, v4)
        self.position = x + h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4)
        self.velocity = v + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)


@dataclass(frozen=True, eq=False)
class Noise:
    """The relative change of positions and velocities in every step, (copies, N, 3) each: roundings of one sign."""

    of_position: np.ndarray
    of_velocity: np.ndarray


def roundings_per_step(method: str) -> tuple[int, int]:
    """The number of roundings of a position, and of a velocity, in a step."""
    if method == "rk4":
        return 4, 4
    stages = SPLITTINGS[method].stages
    return sum(drift != 0.0 for _, drift in stages), sum(kick != 0.0 for kick, _ in stages)
