"""The turning of a wall on the host: an angle as a formula of the time, about an axis. NumPy; SymPy where a wall turns."""

from dataclasses import dataclass
from typing import Any

import numpy as np

Vector = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class TurningLaw:
    """A turning about an axis, by an angle θ(t), which need not be 0 when the time is 0.

    angle   the law (PathLaw) of the angle and of its rate [rad, rad / time]
    about   point of the axis when the time is 0, which moves along with the wall [length]
    axis    unit vector; counterclockwise turnings have a growing angle where it points to the reader
    """

    angle: Any
    about: Vector
    axis: Vector

    @property
    def key(self) -> tuple[Any, ...]:
        """What two turnings that are the same have in common; laws of the same formula are one object."""
        return id(self.angle), self.about, self.axis

    def matrix(self, time: float) -> np.ndarray:
        """The rotation by the angle at a time, (3, 3)."""
        angle = float(self.angle.at(time)[0][0])
        cross = np.array([np.cross(self.axis, unit) for unit in np.eye(3)]).T
        return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * (cross @ cross)

    def rate(self, time: float) -> float:
        """θ′ at a time [rad / time]."""
        return float(self.angle.at(time)[1][0])

    def acceleration(self, time: float) -> float:
        """θ″ at a time [rad / time²]."""
        return float(self.angle.acceleration_at(time)[0])

    def distance(self, points: np.ndarray) -> np.ndarray:
        """Distance of points (n, 3) from the axis when the time is 0, (n,) [length]."""
        return np.linalg.norm(np.cross(self.axis, points - np.asarray(self.about)), axis=-1)
