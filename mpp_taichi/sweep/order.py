"""Order: coarse to fine, so that a picture of the whole exists after a small part of the work."""

import numpy as np


def coarse_to_fine(shape: tuple[int, ...], *, spread: bool = True) -> np.ndarray:
    """All members of a grid, those of a coarse grid first, then those of grids twice as fine along each axis.

    The grid of the level l consists of the multiples of 2^(L − l) along each axis, L so large that level 0 holds only the first
    place. Without `spread` members come by their numbers: the first of many random members are a random sample already.
    """
    count = int(np.prod(shape))
    if not spread:
        return np.arange(count)
    level = np.zeros(shape, np.int16)
    deepest = max(int(size - 1).bit_length() for size in shape)
    for axis, size in enumerate(shape):
        places = np.arange(size)
        zeros = np.full(size, deepest)
        zeros[1:] = np.log2(places[1:] & -places[1:]).astype(int)
        own = (deepest - zeros).reshape([-1 if k == axis else 1 for k in range(len(shape))])
        level = np.maximum(level, own)
    return np.argsort(level.ravel(), kind="stable")
