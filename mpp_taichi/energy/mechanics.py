"""Mechanics of particles on the host: sums over particles, in float64 and in a fixed order."""

import math
from typing import Any

import numpy as np

from mpp_taichi.snapshot import Snapshot

ALL = slice(None)
FEW_COPIES = 8
"""Copies up to which a sum is taken number by number."""

MOST_TERMS = 512
"""Terms that Python sums one by one, in 14 µs: halves of shorter arrays are not added faster."""


def total(terms: np.ndarray) -> float:
    """The sum of n terms, (n,), to 2⁻⁵³ of itself and (log₂ n)² 2⁻¹⁰⁶ Σ |term|; not finite where a term, or the sum, is not.

    The halves of a long array are added to each other, term by term, until the array is short. The sum of the roundings is
    kept. Source: Ogita, Rump & Oishi, SIAM J. Sci. Comput. 26 (2005) 1955.
    """
    terms, lost = np.asarray(terms, dtype=np.float64), []
    with np.errstate(over="ignore", invalid="ignore"):  # the result then is not finite
        while len(terms) > MOST_TERMS:
            half = len(terms) // 2
            first, second, rest = terms[:half], terms[half : 2 * half], terms[2 * half :]
            added = first + second
            part = added - first
            lost.append(float(np.sum((first - (added - part)) + (second - part))))
            terms = np.concatenate([added, rest])
    try:
        return math.fsum([*terms.tolist(), *lost])
    except (OverflowError, ValueError):  # beyond the largest number; ∞ − ∞
        return math.nan


def kinetic_energies(snapshot: Snapshot, rows: slice = ALL) -> np.ndarray:
    """½ m v² of each particle, (n,)."""
    velocity = snapshot.velocity[rows]
    return 0.5 * (snapshot.mass[rows] * np.einsum("ij,ij->i", velocity, velocity))


def kinetic_of_copies(snapshot: Any, rows: slice = ALL) -> np.ndarray:
    """½ Σ m v² of each of several copies of a system, (copies,): velocities (copies, n, 3), masses (copies, n)."""
    x, y, z = np.moveaxis(snapshot.velocity[:, rows], 2, 0)
    return sums(0.5 * (snapshot.mass[:, rows] * (x * x + y * y + z * z)))


def sums(terms: np.ndarray) -> np.ndarray:
    """The sums over the second axis, (copies, n) → (copies,), added in order and with what rounding takes away (Neumaier).

    The bits of a sum do not depend on the number of copies. Source: Neumaier, Z. Angew. Math. Mech. 54 (1974) 39.
    """
    if len(terms) <= FEW_COPIES:
        return np.array([_sum(row) for row in terms.tolist()])
    result, lost = np.zeros(len(terms)), np.zeros(len(terms))
    for term in terms.T:
        added = result + term
        larger = np.abs(result) >= np.abs(term)
        lost += np.where(larger, (result - added) + term, (term - added) + result)
        result = added
    return result + lost


def _sum(terms: list[float]) -> float:
    """`sums` of one copy, with the same bits: numbers of Python are quicker than short arrays."""
    result = lost = 0.0
    for term in terms:
        added = result + term
        lost += (result - added) + term if abs(result) >= abs(term) else (term - added) + result
        result = added
    return result + lost


def momentum(snapshot: Snapshot, rows: slice = ALL) -> np.ndarray:
    """Σ m v, (3,), without the particles whose axes are all fixed: they belong to the laboratory."""
    return _moving_mass(snapshot, rows) @ snapshot.velocity[rows]


def angular_momentum(snapshot: Snapshot, rows: slice = ALL) -> np.ndarray:
    """Σ m x × v about the origin, (3,), of the same particles as `momentum`."""
    return _moving_mass(snapshot, rows) @ np.cross(snapshot.position[rows], snapshot.velocity[rows])


def _moving_mass(snapshot: Snapshot, rows: slice) -> np.ndarray:
    return np.where(snapshot.free[rows].any(axis=1), snapshot.mass[rows], 0.0)


def mean_by_mass(values: np.ndarray, mass: np.ndarray) -> np.ndarray:
    """Σ m value / Σ m, (3,), for positions the centre of mass; the plain mean where there is no mass."""
    whole = float(mass.sum())
    return (mass @ values) / whole if whole else values.mean(axis=0)
