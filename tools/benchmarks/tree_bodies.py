"""Distributions of bodies on which gravity by a tree is measured, and the accelerations that it should find.

In the last six distributions, the pulls on many bodies cancel, or lengths or masses differ by many powers of ten.
"""

import numpy as np

KINDS = ("sphere", "plummer", "disc", "spirals", "shell", "lattice", "grid", "plane", "row", "clusters", "heavy")
CLUSTER_DISTANCE = 1e8  # between two clusters of radius 1
LIGHT_MASS = 1e-12  # in a sphere around a body of mass 1


def bodies(kind, count, dtype=np.float32):
    """Positions and masses of a distribution as numbers of a precision; by default, they are the same in f32 and f64."""
    random = np.random.default_rng(count)
    direction = random.normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    number = np.arange(count)
    flat = np.zeros(count)
    mass = None
    if kind in ("sphere", "clusters", "heavy"):
        position = direction * random.random(count)[:, None] ** (1 / 3)
    elif kind == "plummer":
        position = direction / np.sqrt(random.random(count) ** (-2 / 3) - 1.0)[:, None]
    elif kind == "disc":
        angle, radius = 2.0 * np.pi * random.random(count), np.sqrt(random.random(count))
        position = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0.01 * random.normal(size=count)], 1)
    elif kind == "spirals":  # two arms of a disc whose density falls off exponentially
        radius = 0.01 - 0.3 * np.log(1.0 - 0.98 * random.random(count))
        angle = np.pi * random.integers(0, 2, count) + 3.0 * np.log(radius) + 0.3 * random.normal(size=count)
        position = np.stack([radius * np.cos(angle), radius * np.sin(angle), 0.02 * random.normal(size=count)], 1)
    elif kind == "shell":  # half of the bodies are without mass, inside
        inside = np.where(number % 2 == 0, 1.0, random.random(count) ** (1 / 3))
        position, mass = direction * inside[:, None], (number % 2 == 0) * (0.5 + random.random(count))
    elif kind == "lattice":
        side = int(np.ceil(count ** (1 / 3)))
        position = np.stack([number % side, number // side % side, number // side**2], 1) / side
    elif kind == "grid":
        side = int(np.ceil(np.sqrt(count)))
        position = np.stack([number % side, number // side, flat], 1) / side
    elif kind == "plane":
        position = np.stack([random.random(count), random.random(count), flat], 1)
    else:
        position = np.stack([number, flat, flat], 1)
    if kind in ("lattice", "grid", "row"):
        mass = np.ones(count)
    elif mass is None:
        mass = 0.5 + random.random(count)
    if kind == "clusters":
        position[count // 2 :, 0] += CLUSTER_DISTANCE
    elif kind == "heavy":
        mass *= LIGHT_MASS
        mass[count // 3] = 1.0
    return tuple(array.astype(dtype).astype(np.float64) for array in (position, mass / mass.sum()))


def exact(position, mass, rows):
    """Accelerations of some bodies with G = 1, pair by pair in float64, and the sums of the strengths of their pulls."""
    acceleration, strength = np.empty((len(rows), position.shape[1])), np.empty(len(rows))
    for k, i in enumerate(rows):
        d = position - position[i]
        squared = np.einsum("ij,ij->i", d, d)
        squared[i] = np.inf
        pull = mass / squared
        strength[k] = pull.sum()
        acceleration[k] = (pull / np.sqrt(squared)) @ d
    return acceleration, strength
