"""The matrix of rods, G M⁻¹ Gᵀ, as a band: which rods share particles, and in what order the band is narrow. Host side."""

from dataclasses import dataclass

import numpy as np

from mpp_taichi.arithmetic.ordering import bandwidth, narrow_order
from mpp_taichi.snapshot import Snapshot


@dataclass(frozen=True, eq=False)
class RodBand:
    """Rods in the order of the band, and the products of which the entries of its matrix are sums.

    A rod r from i to j has the direction n_r = (x_j − x_i)/L_r and the row (−n_r at i, +n_r at j) of G. The entry (a, b) is the
    sum of ± n_a · M⁻¹ n_b over the particles that a and b share, + where both begin or both end there.

    first, second   the ends of each rod, (rod_count,)
    length          [length], (rod_count,)
    number          of each rod in the scene, (rod_count,)
    width           half-bandwidth: rods farther apart in the order share no particle that can move
    row, column     of each product, row ≥ column, (product_count,)
    particle, sign  which the two rods share, (product_count,)
    """

    first: np.ndarray
    second: np.ndarray
    length: np.ndarray
    number: np.ndarray
    width: int
    row: np.ndarray
    column: np.ndarray
    particle: np.ndarray
    sign: np.ndarray


def rod_band(snapshot: Snapshot) -> RodBand:
    """The band of the rods of a snapshot."""
    between = snapshot.rods.between.astype(np.int64)
    count = len(between)
    moves = [any(axes) for axes in snapshot.free.tolist()]
    ends: dict[int, list[tuple[int, float]]] = {}
    for rod, (first, second) in enumerate(between.tolist()):
        for particle, sign in ((first, -1.0), (second, 1.0)):
            if moves[particle]:
                ends.setdefault(particle, []).append((rod, sign))
    shared = [(a, b, particle, s * t) for particle, here in ends.items() for a, s in here for b, t in here if a <= b]
    pairs = np.array([(a, b) for a, b, _, _ in shared if a != b], dtype=np.int64).reshape(-1, 2)
    place = narrow_order(count, pairs)
    order = np.argsort(place)
    products = sorted((max(place[a], place[b]), min(place[a], place[b]), particle, sign) for a, b, particle, sign in shared)
    row, column, at, signs = (np.array(each) for each in zip(*products)) if products else (np.zeros(0, int),) * 4
    return RodBand(
        first=between[order, 0].astype(np.int32),
        second=between[order, 1].astype(np.int32),
        length=snapshot.rods.length[order],
        number=order.astype(np.int32),
        width=bandwidth(place, pairs),
        row=row.astype(np.int32),
        column=column.astype(np.int32),
        particle=at.astype(np.int32),
        sign=signs.astype(float),
    )


def rod_matrix(snapshot: Snapshot, band: RodBand, dimensions: int) -> np.ndarray:
    """The lower band of G M⁻¹ Gᵀ where the particles of a snapshot are, (rod_count, width + 1), the diagonal last."""
    direction = snapshot.position[band.second] - snapshot.position[band.first]
    direction = (direction / band.length[:, None])[:, :dimensions]
    mass = np.where(snapshot.mass > 0.0, snapshot.mass, np.inf)
    inverse_mass = snapshot.free[:, :dimensions] / mass[:, None]
    values = band.sign * np.einsum("ck,ck,ck->c", direction[band.row], direction[band.column], inverse_mass[band.particle])
    matrix = np.zeros((len(band.first), band.width + 1))
    np.add.at(matrix, (band.row, band.width - (band.row - band.column)), values)
    return matrix


def first_dependent(matrix: np.ndarray, smallest: float) -> int | None:
    """The first row of a symmetric band that depends on the rows before it, by its pivot in LDLᵀ; None where there is none.

    `smallest` is the ratio of pivot and diagonal below which a pivot counts as 0.
    """
    count, width = matrix.shape[0], matrix.shape[1] - 1
    lower, pivot = np.zeros((count, width)), np.zeros(count)
    for a in range(count):
        begin = max(0, a - width)
        for b in range(begin, a):
            low = max(begin, b - width)
            left = lower[a, low - a + width : b - a + width]
            right = lower[b, low - b + width : width]
            lower[a, b - a + width] = (matrix[a, b - a + width] - (left * pivot[low:b]) @ right) / pivot[b]
        row = lower[a, begin - a + width : width]
        pivot[a] = matrix[a, width] - (row * row) @ pivot[begin:a]
        if not pivot[a] > smallest * matrix[a, width]:
            return a
    return None
