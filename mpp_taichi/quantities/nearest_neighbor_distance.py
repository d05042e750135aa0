"""The distance of particles from their nearest neighbours."""

import numpy as np

from mpp_taichi.component import Particles, component, param
from mpp_taichi.quantities._base import NoResultError, Quantity, RunSample, Setting, of_which
from mpp_taichi.quantities._particles import rows


@component
class NearestNeighborDistance(Quantity):
    """Distance of a particle to the nearest other particle of the group, on average over the group [length].

    Of n particles at random on a flat area A it is ½ √(A / n), with a standard deviation of 0.26 √A / n; in clumps they are
    nearer. Source: Clark & Evans, Ecology 35 (1954) 445.
    """

    of: Particles = param(None, optional=True, help="a group; absent: all particles")
    dimension = (1, 0, 0)

    def label(self, setting: Setting) -> str:
        """`distance to nearest neighbours of disk`."""
        return of_which("distance to nearest neighbours", setting.name_of(self.of))

    def measure(self, sample: RunSample) -> float:
        """The mean distance."""
        snapshot = sample.snapshot
        chosen = np.zeros(snapshot.particle_count, bool)
        chosen[rows(self.of)] = True
        positions = snapshot.position[chosen & snapshot.present]
        if len(positions) < 2:
            raise NoResultError("a single particle has no neighbours")
        return float(nearest_distances(positions).mean())


def nearest_distances(position: np.ndarray) -> np.ndarray:
    """Distance of each point to the nearest other point, in the order along x; (n, 3) → (n,).

    Points in the order of x are compared with the next, the next but one, and so on, until the difference in x is larger than
    the distance found.
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
