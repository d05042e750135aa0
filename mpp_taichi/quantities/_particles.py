"""Groups of particles in a sample: their rows in the arrays of a snapshot, and their means by mass."""

import numpy as np

from mpp_taichi.component import Particles
from mpp_taichi.energy.mechanics import mean_by_mass
from mpp_taichi.quantities._base import NoResultError
from mpp_taichi.snapshot import Snapshot

AXES = ("x", "y", "z")


def rows(of: Particles | None) -> slice:
    """The rows of a group, given as first index and count, in the arrays of a snapshot; without a group, all rows."""
    return slice(None) if of is None else slice(of[0], of[0] + of[1])


def free_rows(of: Particles | None, snapshot: Snapshot) -> np.ndarray:
    """Indices of the particles of a group, or of all particles, that are free along every axis."""
    chosen = np.arange(snapshot.particle_count)[rows(of)]
    return chosen[snapshot.free[chosen].all(axis=1)]


def require_present(snapshot: Snapshot, of: int) -> None:
    """NoResultError where particle `of` has become part of another particle."""
    if snapshot.merged_into is not None and snapshot.merged_into[of] >= 0:
        raise NoResultError(f"particle {of} merged into particle {snapshot.merged_into[of]} before time {snapshot.time:.6g}")


def center_of(values: np.ndarray, snapshot: Snapshot, of: Particles | None) -> np.ndarray:
    """Mean by mass of (particle_count, 3) vectors over a group, or over all particles; of one particle its own vector.

    Of several copies of a system, (copies, particle_count, 3), the means (copies, 3).

    Raises:
        NoResultError: every particle of the group has merged into another.
    """
    if values.ndim == 3:
        return _centers(values, snapshot, of)
    if of is not None and of[1] == 1:
        require_present(snapshot, of[0])
        return values[of[0]]
    chosen = np.zeros(snapshot.particle_count, dtype=bool)
    chosen[rows(of)] = True
    chosen &= snapshot.present
    if not chosen.any():
        raise NoResultError(f"all particles of the group merged into others before time {snapshot.time:.6g}")
    return mean_by_mass(values[chosen], snapshot.mass[chosen])


def _centers(values: np.ndarray, snapshot: Snapshot, of: Particles | None) -> np.ndarray:
    """Means by mass of several copies of a system, none of which has merged particles: (copies, 3)."""
    if of is not None and of[1] == 1:
        return values[:, of[0]]
    mass, chosen = snapshot.mass[:, rows(of), None], values[:, rows(of)]
    whole = mass.sum(axis=1)
    total = (mass * chosen).sum(axis=1)
    if (whole != 0.0).all():
        return np.asarray(total / whole)
    return np.where(whole != 0.0, total / np.where(whole != 0.0, whole, 1.0), chosen.mean(axis=1))


def component_of(vector: np.ndarray, axis: str | None) -> float:
    """One component of a vector; without an axis, its length."""
    return float(np.linalg.norm(vector)) if axis is None else float(vector[AXES.index(axis)])


def components_of(vectors: np.ndarray, axis: str | None) -> np.ndarray:
    """One component of each vector, (n, 3) → (n,); without an axis, its length."""
    return lengths(vectors) if axis is None else vectors[:, AXES.index(axis)]


def lengths(vectors: np.ndarray) -> np.ndarray:
    """√(x² + y² + z²) of each vector, (n, 3) → (n,), by operations whose bits do not depend on n."""
    x, y, z = vectors.T
    return np.asarray(np.sqrt(x * x + y * y + z * z))
