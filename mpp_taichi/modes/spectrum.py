"""Spectrum: every frequency of a linear network, and the kinds of its zero-frequency modes."""

from dataclasses import dataclass

import numpy as np

from mpp_taichi.modes.linear_network import LinearNetwork
from mpp_taichi.modes.rigid_motion import rigid_motions

MOST_FREEDOMS = 2000  # dense eigenvalues of so many take seconds, and the work grows with the third power
SETTLED = float(np.sqrt(np.finfo(float).eps))  # a tension of order 1, compared with the rounding of a zero tension


@dataclass(frozen=True, eq=False)
class Spectrum:
    """The modes of a network.

    angular_frequency   ω of the vibrating modes, rising [radians time⁻¹], shape (vibrating_count,)
    shape               displacement of every freedom in them, shape (freedom_count, vibrating_count), Σ m shape² = 1
    unstable_modes      directions along which the springs push away from the placement: a compressed network buckles
    zero_frequency_modes  motions that no spring resists to first order: the sum of
    rigid_motions         motions of the network as a whole, or of a part by itself, that its supports leave, and
    mechanism_modes       the other motions of zero frequency
    second_order_modes    the mechanisms that a tension in the springs would stiffen: the restoring force at a displacement a is
                          proportional to a³, as across a flat sheet of slack springs
    """

    angular_frequency: np.ndarray
    shape: np.ndarray | None
    unstable_modes: int
    zero_frequency_modes: int
    rigid_motions: int
    mechanism_modes: int
    second_order_modes: int


def spectrum(network: LinearNetwork, *, shapes: bool = False) -> Spectrum:
    """Solve K u = ω² M u, with the shapes only where `shapes` is set, and count the modes that do not vibrate.

    The counts are taken from S K S with S = diag(K)^(−1/2), which has as many zero and negative eigenvalues as K (Sylvester's
    law of inertia) but not its range of stiffnesses, nor the masses'. Eigenvalues within n · eps · ‖S K S‖ of zero, the error
    of a symmetric eigenvalue solver, count as zero. The matrices are dense: the network should have at most `MOST_FREEDOMS`.
    Source of the split: Calladine, Int. J. Solids Struct. 14 (1978) 161; Pellegrino and Calladine, ibid. 22 (1986) 409.
    """
    unstable, null = _still(network)
    rigid, mechanisms = _split(network, null)
    root_mass = np.sqrt(network.freedom_masses)
    weighted = network.stiffness_matrix / np.outer(root_mass, root_mass)
    squares, modes = np.linalg.eigh(weighted) if shapes else (np.linalg.eigvalsh(weighted), None)
    still = unstable + null.shape[1]  # eigenvalues rise: first the negative eigenvalues, then the zeros
    return Spectrum(
        angular_frequency=np.sqrt(np.maximum(squares[still:], 0.0)),
        shape=None if modes is None else modes[:, still:] / root_mass[:, None],
        unstable_modes=unstable,
        zero_frequency_modes=null.shape[1],
        rigid_motions=rigid,
        mechanism_modes=mechanisms.shape[1],
        second_order_modes=_stiffened_by_tension(network, mechanisms),
    )


def _still(network: LinearNetwork) -> tuple[int, np.ndarray]:
    """Number of unstable modes, and an orthonormal basis of the displacements that no spring resists."""
    matrix = network.stiffness_matrix
    diagonal = np.diag(matrix)
    scale = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
    scaled = scale[:, None] * matrix * scale
    values = np.linalg.eigvalsh(scaled)
    tolerance = len(values) * np.finfo(float).eps * np.abs(values).max(initial=0.0)
    unstable, zeros = np.count_nonzero(values < -tolerance), np.count_nonzero(np.abs(values) <= tolerance)
    if not zeros:
        return int(unstable), np.zeros((len(values), 0))
    vectors = np.linalg.eigh(scaled)[1][:, unstable : unstable + zeros]
    return int(unstable), np.linalg.qr(scale[:, None] * vectors)[0]


def _split(network: LinearNetwork, null: np.ndarray) -> tuple[int, np.ndarray]:
    """Number of rigid motions among the zero-frequency modes, and an orthonormal basis of the mechanisms.

    A rigid motion costs no energy only where the forces balance, so each motion is tested: a prestretched spring at a support
    resists a turn.
    """
    if null.shape[1] == 0:
        return 0, null
    rigid = rigid_motions(network)
    inside = null @ (null.T @ rigid)  # the part of the rigid motions that no spring resists
    left, values, _ = np.linalg.svd(inside, full_matrices=False)
    free_of_charge = left[:, values > 1.0 - SETTLED]
    rest = null - free_of_charge @ (free_of_charge.T @ null)
    basis, values, _ = np.linalg.svd(rest, full_matrices=False)
    return free_of_charge.shape[1], basis[:, values > 0.5]


def _stiffened_by_tension(network: LinearNetwork, mechanisms: np.ndarray) -> int:
    """The number of mechanisms that a state of self-stress stiffens.

    Every spring, of stiffness 1, is given the tension 1, and the network finds its equilibrium: the tension that remains,
    1 − C u with C the elongations per displacement, is the self-stress nearest to that tension, zero where none
    exists. It gives a spring the stiffness tension / l across itself.
    """
    if mechanisms.shape[1] == 0:
        return 0
    stands = (network.axial > 0.0) & (network.length > 0.0)
    ones, none = np.where(stands, 1.0, 0.0), np.zeros(len(stands))
    elongation = _elongation(network, stands)
    settled = np.linalg.pinv(network.assemble(network.blocks(ones, none)), hermitian=True, rcond=SETTLED) @ (
        elongation.T @ ones
    )
    tension = ones - elongation @ settled
    unit = network.length[stands].mean() if stands.any() else 1.0
    lateral = tension * unit / np.where(stands, network.length, 1.0)
    stiffness = mechanisms.T @ network.assemble(network.blocks(none, lateral)) @ mechanisms
    return int(np.count_nonzero(np.linalg.eigvalsh(stiffness) > SETTLED))


def _elongation(network: LinearNetwork, stands: np.ndarray) -> np.ndarray:
    """C: the elongation of every spring that stands, per displacement of each freedom, shape (spring_count, freedom_count)."""
    full = np.zeros((len(stands), *network.free.shape))
    rows = np.arange(len(stands))
    direction = np.where(stands[:, None], network.direction, 0.0)
    np.add.at(full, (rows, network.between[:, 1]), direction)
    np.add.at(full, (rows, network.between[:, 0]), -direction)
    return full.reshape(len(stands), -1)[:, network.freedoms]
