"""How near particles are to their nearest neighbours."""

import math

import numpy as np

from mpp_taichi.component import Particles, component, param
from mpp_taichi.diagnostics._at_end import rows
from mpp_taichi.diagnostics._base import Diagnostic, NoResultError
from mpp_taichi.snapshot import Snapshot


@component
class NearestNeighborDistance(Diagnostic):
    """Distance of a particle to the nearest other one of the group, on average over the group [length].

    Of n particles at random on a flat area A it is ½ √(A / n), with a standard deviation of 0.26 √A / n; in clumps they are
    nearer. Source: Clark & Evans, Ecology 35 (1954) 445.
    """

    of: Particles = param(None, optional=True, help="a group; absent: all particles")
    at: float = param(None, optional=True, minimum=0.0, unit="time", help="the first look from this time on; absent: the end")
    _value: float | None = None
    _positions: np.ndarray | None = None
    _time: float = 0.0

    def observe(self, time: float, snapshot: Snapshot) -> None:
        """Keep where the particles are, until the time is there."""
        self._time = time
        if self.at is None or (time >= self.at and self._positions is None):
            taken = np.zeros(snapshot.particle_count, bool)
            taken[rows(self.of)] = True
            self._positions = snapshot.position[taken & snapshot.present]

    @property
    def interval(self) -> float:
        """Until the time to look at."""
        return self.at - self._time if self.at is not None and self._time < self.at else math.inf

    def result(self) -> float:
        """The mean distance."""
        if self._positions is None:
            raise NoResultError(
                f"the run ended before time {self.at:g}" if self.at is not None else "the run was never looked at"
            )
        if len(self._positions) < 2:
            raise NoResultError("a single particle has no neighbours")
        return float(nearest_distances(self._positions).mean())


def nearest_distances(position: np.ndarray) -> np.ndarray:
    """Distance of each point to the nearest other one, in the order along x; (n, 3) → (n,).

    Points in the order of x are compared with the next, the next but one, and so on, until all lie farther off along x alone.
    """
    ordered = position[np.argsort(position[:, 0], kind="stable")]
    nearest = np.full(len(ordered), np.inf)
    for shift in range(1, len(ordered)):
        apart = ordered[shift:] - ordered[:-shift]
        if np.all(apart[:, 0] > np.maximum(nearest[shift:], nearest[:-shift])):
            break
        distance = np.sqrt(np.sum(apart**2, axis=1))
        nearest[:-shift] = np.minimum(nearest[:-shift], distance)
        nearest[shift:] = np.minimum(nearest[shift:], distance)
    return nearest
