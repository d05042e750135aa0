"""The network as a linear operator: mass-weighted stiffness or damping of its springs, as a product with a vector."""

from dataclasses import dataclass, replace

import numpy as np

from mpp_taichi.modes.linear_network import LinearNetwork, linearise
from mpp_taichi.snapshot import Snapshot


@dataclass(frozen=True, eq=False)
class Bonds:
    """One symmetric matrix a I + b n nᵀ for each spring, and the weights of its ends: half of a mass-weighted operator.

    first, second   the ends, shape (spring_count,);  direction n, shape (dimensions, spring_count), 0 where the ends coincide
    isotropic a, axial b, shape (spring_count,)
    weight          1/√m of every axis, 0 where it is held, shape (dimensions, particle_count)
    diagonal        added to the operator [1/time or 1/time²], shape (dimensions, particle_count)
    """

    first: np.ndarray
    second: np.ndarray
    direction: np.ndarray
    isotropic: np.ndarray
    axial: np.ndarray
    weight: np.ndarray
    diagonal: np.ndarray | None = None

    @property
    def size(self) -> int:
        """Degrees of freedom; held axes are counted as well, and their entries stay zero."""
        return self.weight.size

    def bond_forces(self, vector: np.ndarray) -> np.ndarray:
        """(a I + b n nᵀ)(w_j − w_i) of every spring with w = M^(−1/2) vector, shape (dimensions, spring_count)."""
        moved = self.weight * vector.reshape(self.weight.shape)
        difference = [axis[self.second] - axis[self.first] for axis in moved]
        along = sum(n * d for n, d in zip(self.direction, difference)) * self.axial
        return np.stack([self.isotropic * d + along * n for n, d in zip(self.direction, difference)])

    def product(self, vector: np.ndarray) -> np.ndarray:
        """M^(−1/2) (Σ_h B_hᵀ (a I + b n nᵀ) B_h) M^(−1/2) vector, summed in a fixed order."""
        count = self.weight.shape[1]
        rows = [
            np.bincount(self.second, force, count) - np.bincount(self.first, force, count) for force in self.bond_forces(vector)
        ]
        result = self.weight * np.stack(rows)
        if self.diagonal is not None:
            result += self.diagonal * vector.reshape(self.weight.shape)
        return result.ravel()

    def shares(self, vector: np.ndarray) -> np.ndarray:
        """The term of each spring in vectorᵀ (operator) vector."""
        moved = self.weight * vector.reshape(self.weight.shape)
        forces = self.bond_forces(vector)
        return sum((axis[self.second] - axis[self.first]) * force for axis, force in zip(moved, forces))


def stiffness_bonds(snapshot: Snapshot, dimensions: int) -> Bonds:
    """The springs where they are: K_h = D n nᵀ + (T/l)(I − n nᵀ), see `LinearNetwork`.

    A compressed spring (T < 0) pushes sideways and lowers frequencies. A spring whose ends coincide has no direction; D I
    is taken for it, an upper bound of its matrix in any direction.
    """
    network, stiffness = linearise(snapshot, dimensions=dimensions), snapshot.springs.stiffness
    lateral = np.where(network.length > 0.0, network.lateral, stiffness)
    return _bonds(network, snapshot, isotropic=lateral, axial=stiffness - lateral)


def damping_bonds(snapshot: Snapshot, dimensions: int, *, mode: str, drag: float) -> Bonds:
    """Damping rates: c n nᵀ of every spring, or c I where `mode` is "full", and the drag c/m of every particle."""
    damping = snapshot.springs.damping
    nothing = np.zeros_like(damping)
    isotropic, axial = (damping, nothing) if mode == "full" else (nothing, damping)
    bonds = _bonds(linearise(snapshot, dimensions=dimensions), snapshot, isotropic=isotropic, axial=axial)
    return replace(bonds, diagonal=drag * bonds.weight**2) if drag else bonds


def row_sum_bound(snapshot: Snapshot, dimensions: int, coefficient: np.ndarray, drag: float = 0.0) -> float:
    """Upper bound of the largest eigenvalue of springs with these coefficients, whatever their directions are.

    Since a I + b n nᵀ ≤ (a + b) I, the operator is at most the operator of springs that act alike along all axes, whose row
    sums are bounds of its eigenvalues (Gershgorin): max_i [Σ_h D/m_i + Σ_h D/√(m_i m_j)], the second sum over ends j that can
    move. M⁻¹K has the same eigenvalues and other row sums; the smaller bound of the two is taken.
    """
    between = snapshot.springs.between
    free = snapshot.free[:, :dimensions].any(axis=1) & (snapshot.mass > 0.0)
    inverse = np.where(free, 1.0 / np.where(free, snapshot.mass, 1.0), 0.0)
    root = np.sqrt(inverse)
    symmetric, plain = drag * inverse, drag * inverse
    for i, j in (between.T, between.T[::-1]):
        own = np.bincount(i, coefficient, len(inverse)) * inverse
        symmetric = symmetric + own + np.bincount(i, coefficient * root[j], len(inverse)) * root
        plain = plain + own + np.bincount(i, coefficient * free[j], len(inverse)) * inverse
    return float(min(symmetric.max(), plain.max()))


def _bonds(network: LinearNetwork, snapshot: Snapshot, *, isotropic: np.ndarray, axial: np.ndarray) -> Bonds:
    """The springs of a network as bonds, axis by axis in memory, for fast products with vectors.

    Unlike the freedoms of the network, axes of particles without a spring count: drag acts on them.
    """
    first, second = network.between.T
    moves = snapshot.free[:, : network.free.shape[1]].T & (snapshot.mass > 0.0)
    weight = np.where(moves, 1.0 / np.sqrt(np.where(snapshot.mass > 0.0, snapshot.mass, 1.0)), 0.0)
    first, second, direction = (np.ascontiguousarray(array) for array in (first, second, network.direction.T))
    return Bonds(first, second, direction, isotropic, axial, weight)
