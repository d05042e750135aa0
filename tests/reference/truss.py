"""Static shape of a network of linear-elastic bars that may turn far: Newton's method on the total potential energy.

Π(x) = Σ ½ D (|x_j − x_i| − L)² − Σ f · x over the free coordinates. Gradient and second derivative of each bar are those of
the textbooks on geometrically nonlinear trusses: with n = d/|d|, the matrix is D n nᵀ + D (1 − L/|d|)(1 − n nᵀ).
"""

import numpy as np


def static_shape(start, between, stiffness, rest_length, load, free, *, tolerance=1e-10):
    """Positions, (N, 3), at which no free coordinate feels a force beyond `tolerance` of the load."""
    x, free = start.astype(float).copy(), free.ravel()
    scale = np.abs(load).max()

    def energy(x):
        length = np.linalg.norm(x[between[:, 1]] - x[between[:, 0]], axis=1)
        return 0.5 * stiffness @ (length - rest_length) ** 2 - np.sum(load * x)

    for _ in range(500):
        gradient, matrix = derivatives(x, between, stiffness, rest_length)
        residual = (gradient - load).ravel()[free]
        if np.abs(residual).max() <= tolerance * scale:
            return x
        step = np.zeros(x.size)
        step[free] = -np.linalg.solve(positive(matrix[np.ix_(free, free)]), residual)
        step, length = step.reshape(x.shape), 1.0
        slope = np.sum((gradient - load) * step)
        # Close to the end the energy's own rounding hides the descent: there the full step is taken.
        while energy(x + length * step) > energy(x) + 1e-4 * length * slope + 1e-13 * np.abs(load * x).sum() and length > 1e-6:
            length *= 0.5
        x = x + length * step
    raise RuntimeError(f"no equilibrium found: residual {np.abs(residual).max():.3g}")


def derivatives(x, between, stiffness, rest_length):
    """Gradient (N, 3) and second derivative (3N, 3N) of the elastic energy."""
    i, j = between.T
    d = x[j] - x[i]
    length = np.linalg.norm(d, axis=1)
    n = d / length[:, None]
    pull = (stiffness * (length - rest_length))[:, None] * n
    gradient = np.zeros_like(x)
    np.add.at(gradient, j, pull)
    np.add.at(gradient, i, -pull)
    along = n[:, :, None] * n[:, None, :]
    tension = stiffness * (1.0 - rest_length / length)
    blocks = stiffness[:, None, None] * along + tension[:, None, None] * (np.eye(3) - along)
    matrix = np.zeros((len(x), 3, len(x), 3))
    for a, b, block in zip(i, j, blocks, strict=True):
        matrix[a, :, a] += block
        matrix[b, :, b] += block
        matrix[a, :, b] -= block
        matrix[b, :, a] -= block
    return gradient, matrix.reshape(x.size, x.size)


def positive(matrix):
    """The matrix, with as much added to its diagonal as makes every Newton step go downhill."""
    lowest, highest = np.linalg.eigvalsh(matrix)[[0, -1]]
    shift = max(0.0, 1e-10 * highest - lowest * 1.5) if lowest < 1e-10 * highest else 0.0
    return matrix + shift * np.eye(len(matrix))
