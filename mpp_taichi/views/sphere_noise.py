"""Directions of a picture of longitude and latitude, and smooth noise over them. NumPy on the host."""

import numpy as np

LATTICE = 32  # of the noise, which repeats after this size


def directions(rows: int) -> np.ndarray:
    """Unit directions of the texels, float32, shape (rows, 2 rows, 3): longitude from −180° eastward, north on top."""
    latitude = np.pi * (0.5 - (np.arange(rows) + 0.5) / rows)[:, None]
    longitude = np.pi * ((np.arange(2 * rows) + 0.5) / rows - 1.0)[None, :]
    level = np.cos(latitude)
    return np.stack(
        [level * np.cos(longitude), level * np.sin(longitude), np.broadcast_to(np.sin(latitude), (rows, 2 * rows))], axis=2
    ).astype(np.float32)


def direction_of(longitude: float, latitude: float) -> np.ndarray:
    """The unit direction of a longitude and a latitude, radians."""
    level = np.cos(latitude)
    return np.array([level * np.cos(longitude), level * np.sin(longitude), np.sin(latitude)])


def noise(direction: np.ndarray, frequency: float, octaves: int, random: np.random.Generator) -> np.ndarray:
    """Sum of smooth noises of doubled frequency and halved strength, about 0 and mostly within −1…1.

    Value noise: random numbers at the points of a lattice, between them third-order interpolation.
    """
    total = np.zeros(direction.shape[:2], np.float32)
    for octave in range(octaves):
        table = random.uniform(-1.0, 1.0, LATTICE**3).astype(np.float32)
        place = direction * np.float32(frequency * 2.0**octave) + random.uniform(0.0, LATTICE, 3).astype(np.float32)
        corner = np.floor(place)
        share = place - corner
        share = share * share * (3.0 - 2.0 * share)
        corner = corner.astype(np.int32)
        low, high = corner % LATTICE, (corner + 1) % LATTICE
        corners = [[side[..., axis] * LATTICE ** (2 - axis) for side in (low, high)] for axis in range(3)]
        edges = []
        for slab in corners[0]:
            for row in corners[1]:
                first, second = (table[slab + row + column] for column in corners[2])
                edges.append(_between(first, second, share[..., 2]))
        faces = [_between(edges[k], edges[k + 1], share[..., 1]) for k in (0, 2)]
        value = _between(faces[0], faces[1], share[..., 0])
        total += value * np.float32(0.5**octave)
    return total


def _between(first: np.ndarray, second: np.ndarray, share: np.ndarray) -> np.ndarray:
    return first + share * (second - first)
