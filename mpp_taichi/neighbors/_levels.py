"""Levels of a cell grid: which reaches share cells, how wide the cells are, and where they lie in the table. Only NumPy."""

from dataclasses import dataclass

import numpy as np

BINS_PER_OCTAVE = 8
BINS = 480  # 60 octaves; all smaller reaches share the last bin
MAXIMUM_LEVELS = 64
LARGEST_CELL_NUMBER = 2.0**30  # along an axis, to fit 32 bits
UNFOLDED = -1  # the mask that keeps every bit
HASH_STRIDES = (73856093, 19349663)  # odd, without small common factors; Teschner et al., Proc. VMV 2003, 47


@dataclass(frozen=True)
class Level:
    """Spheres of similar reach.

    reach     largest reach of the level [length]; cells are at least twice as wide
    cells     number of cells along each axis
    inverse   inverse width of a cell along each axis [1 / length]
    offset    first bucket of the level in the table
    buckets   number of buckets
    mask      folds cell numbers into the buckets where there are more cells than buckets
    strides   steps of the bucket number from a cell to the next cell along y and z
    """

    reach: float
    cells: np.ndarray
    inverse: np.ndarray
    offset: int
    buckets: int
    mask: int
    strides: tuple[int, int]

    @classmethod
    def fitted(
        cls, reach: float, count: int, extent: np.ndarray, repeats: tuple, buckets_per_sphere: int, offset: int
    ) -> "Level":
        """A level of `count` spheres in a box. Where cells by far outnumber spheres, distant cells share a bucket."""
        repeats = np.array(repeats[: len(extent)])
        width = max(extent.max() / LARGEST_CELL_NUMBER, 2.0 * reach)  # the first argument where the reach is NaN
        if not width > 0.0:
            width = 1.0  # all spheres are points at one place
        ratio = extent / width
        cells = np.where(repeats, np.maximum(np.floor(ratio), 1.0), np.floor(ratio) + 1.0)
        inverse = np.where(repeats, cells / np.where(extent > 0.0, extent, 1.0), 1.0 / width)
        if np.prod(cells) <= buckets_per_sphere * count:
            buckets, mask = int(np.prod(cells)), UNFOLDED
            strides = (int(cells[0]), int(cells[0] * cells[1]))
        else:
            buckets = 1 << max(count - 1, 1).bit_length()
            mask, strides = buckets - 1, HASH_STRIDES
        return cls(reach, cells, inverse, offset, buckets, mask, strides)


def choose_levels(bin_count: np.ndarray, largest: float) -> tuple[list[float], list[int], np.ndarray]:
    """Largest reach and number of spheres of each level, smallest first, and the level of each bin.

    `bin_count[b]` spheres have reaches from b to b + 1 eighths of an octave below the largest reach. A level begins with a bin
    that is not empty, and takes all bins down to half of its reach.
    """
    reaches: list[float] = []
    counts: list[int] = []
    first_bins: list[int] = []
    for b in np.flatnonzero(bin_count):
        full = len(reaches) >= MAXIMUM_LEVELS
        if not first_bins or (b >= first_bins[-1] + BINS_PER_OCTAVE and not full):
            first_bins.append(int(b))
            reaches.append(largest * 2.0 ** (-b / BINS_PER_OCTAVE))
            counts.append(0)
        counts[-1] += int(bin_count[b])
    level_of_bin = np.searchsorted(first_bins, np.arange(BINS), side="right") - 1
    last = len(reaches) - 1
    return reaches[::-1], counts[::-1], (last - level_of_bin).astype(np.int32)
