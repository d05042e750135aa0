"""Rigid motions: the motions of each part of a network as a whole that its supports allow."""

import numpy as np

from mpp_taichi.modes.linear_network import LinearNetwork

ROUNDINGS = 64.0  # of a coordinate, summed over the particles of a part: the error of its constraint matrix


def rigid_motions(network: LinearNetwork) -> np.ndarray:
    """Orthonormal basis of the displacements that turn and shift parts of the network, shape (freedom_count, motion_count).

    A part is a set of particles connected by springs; a particle that is held on every axis is a support and connects nothing.
    A motion u = t + ω × x of a part counts where no held axis of its particles, or of its supports, would have to move. Turns
    about the line that all particles of a part are on move nothing and do not count.
    """
    held = np.logical_not(network.free.any(axis=1))
    parts = _parts(network.between, held)
    columns = []
    for part in parts:
        touched = np.isin(network.between, part).any(axis=1)
        members = np.unique(network.between[touched])
        motions = _velocities(network.position[members])
        scale = 1.0 + np.abs(network.position[members]).max() / max(np.ptp(network.position[members], axis=0).max(), 1e-300)
        tolerance = ROUNDINGS * len(members) * np.finfo(float).eps * scale
        allowed = _null_space(motions[~network.free[members]], tolerance)
        full = np.zeros((*network.free.shape, allowed.shape[1]))
        full[members] = motions @ allowed
        columns.append(_range(full.reshape(network.free.size, -1)[network.freedoms], tolerance))
    return np.hstack(columns) if columns else np.zeros((network.freedom_count, 0))


def _parts(between: np.ndarray, held: np.ndarray) -> list[np.ndarray]:
    """Particles that can move, in groups that springs connect: labels spread along the springs until none changes."""
    inner = between[~held[between].any(axis=1)]
    label = np.arange(len(held))
    while True:
        lower = label.copy()
        np.minimum.at(lower, inner[:, 0], label[inner[:, 1]])
        np.minimum.at(lower, inner[:, 1], label[inner[:, 0]])
        lower = lower[lower]
        if np.array_equal(lower, label):
            break
        label = lower
    moving = np.unique(between[~held[between]])
    return [moving[label[moving] == first] for first in np.unique(label[moving])]


def _velocities(position: np.ndarray) -> np.ndarray:
    """Displacement of every particle in each unit shift and turn about the middle, shape (count, d, motions), over the size."""
    count, dimensions = position.shape
    place = position - position.mean(axis=0)
    place = place / max(np.abs(place).max(), 1e-300)
    motions = [np.broadcast_to(axis, (count, dimensions)) for axis in np.eye(dimensions)]
    for first in range(dimensions):
        for second in range(first + 1, dimensions):
            turn = np.zeros((count, dimensions))
            turn[:, first], turn[:, second] = -place[:, second], place[:, first]
            motions.append(turn)
    return np.stack(motions, axis=-1)


def _null_space(matrix: np.ndarray, tolerance: float) -> np.ndarray:
    """Orthonormal columns that the matrix sends to zero."""
    _, values, right = np.linalg.svd(matrix)
    rank = int(np.count_nonzero(values > tolerance))
    return right[rank:].T


def _range(matrix: np.ndarray, tolerance: float) -> np.ndarray:
    """Orthonormal basis of the columns' span."""
    left, values, _ = np.linalg.svd(matrix, full_matrices=False)
    return left[:, values > tolerance]
