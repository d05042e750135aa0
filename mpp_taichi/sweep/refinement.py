"""Refinement: which members of a grid are run where a sweep spends its time on the places at which neighbours differ.

The first round runs a coarse grid, whose cells are boxes between neighbours. Each next round divides the cells in which members
differ: in their status, or in a measure by more than a share of its range. A cell is looked at again as long as rounds go on,
with all members on its edges that cells beside it have brought, so that a boundary that is found once is followed.
"""

from collections.abc import Iterator, Sequence
from itertools import product

import numpy as np

PARTS = 16  # of the longest axis in the first round, at least
EDGE_SHARE = 0.005  # of the values at each end of a measure that do not count for its range
BLOCK = 1_000_000  # members that are looked at together


class GridRefinement:
    """The rounds of a grid; an axis whose values have no order, such as words, has all of its values in the first round."""

    def __init__(self, shape: Sequence[int], ordered: Sequence[bool], share: float) -> None:
        """`share` of the range of a measure is the difference from which on members differ."""
        self.shape, self.ordered, self.share = np.array(shape), np.array(ordered, bool), share
        self._ends = np.where(self.ordered, np.maximum(self.shape - 1, 1), self.shape)  # where cells may not begin
        longest = int(self.shape[self.ordered].max(initial=1))
        size = 1
        while 2 * size * PARTS <= longest - 1:
            size *= 2
        lows = np.ix_(
            *(np.arange(0, end, size if has_order else 1) for end, has_order in zip(self._ends, ordered, strict=True))
        )
        places = np.stack([each.ravel() for each in np.broadcast_arrays(*lows)], axis=1)
        self._cells: dict[int, np.ndarray] = {size: places}  # the numbers along each axis at which cells of a size begin

    @property
    def is_over(self) -> bool:
        """Whether no cell can be divided."""
        return not any(size > 1 and len(lows) for size, lows in self._cells.items())

    def first(self) -> np.ndarray:
        """The members of the first round, by their numbers."""
        ((size, lows),) = self._cells.items()
        return np.unique(self._within(lows, size, size))

    def next(self, known: np.ndarray, status: np.ndarray, values: np.ndarray) -> np.ndarray:
        """The members of the next round, by their numbers; empty where the grid is as fine as it has to be.

        known    (members,) whether a member is done
        status, values   (members,) and (members, measures), of the members that are done
        """
        least = self.share * ranges_of(values[known])
        found = np.zeros(0, np.int64)
        while not self.is_over and not len(found):
            rough = {size: self._differ(lows, size, known, status, values, least) for size, lows in self._cells.items()}
            if not any(each.any() for each in rough.values()):
                self._cells = {}
                break
            found = np.concatenate([found, *self._divide(rough)])
            found = np.unique(found[~known[found]])
        return found

    def _divide(self, rough: dict[int, np.ndarray]) -> Iterator[np.ndarray]:
        """Divide the cells that are rough; the members of their parts."""
        cells = self._cells
        self._cells = {size: lows[~rough[size]] for size, lows in cells.items()}
        for size, lows in cells.items():
            divided = lows[rough[size]]
            if len(divided):
                half = size // 2
                steps = np.array(list(product(*((0, half) if has_order else (0,) for has_order in self.ordered))))
                parts = (divided[:, None] + steps).reshape(-1, len(self.shape))
                parts = parts[(parts < self._ends).all(axis=1)]
                self._cells[half] = np.concatenate([self._cells.get(half, parts[:0]), parts])
                yield np.unique(self._within(parts, half, half))

    def _within(self, lows: np.ndarray, size: int, spacing: int) -> np.ndarray:
        """The members of cells at a spacing, with both ends, (cells, members of a cell). No cell goes beyond the last value."""
        along = [np.arange(0, size + 1, spacing) if has_order else np.zeros(1, int) for has_order in self.ordered]
        offsets = np.stack([each.ravel() for each in np.meshgrid(*along, indexing="ij")], axis=1)
        places = np.minimum(lows[:, None] + offsets, self.shape - 1)
        return np.ravel_multi_index(tuple(np.moveaxis(places, 2, 0)), tuple(self.shape))

    def _differ(
        self, lows: np.ndarray, size: int, known: np.ndarray, status: np.ndarray, values: np.ndarray, least: np.ndarray
    ) -> np.ndarray:
        """For each cell of a size whether its members differ that are known; False where it cannot be divided."""
        result = np.zeros(len(lows), bool)
        if size == 1:
            return result
        together = max(1, BLOCK // (size + 1) ** int(self.ordered.sum()))
        for begin in range(0, len(lows), together):
            members = self._within(lows[begin : begin + together], size, 1)
            has = known[members]
            words = status[members].astype(int)
            rough = np.where(has, words, -1).max(axis=1) != np.where(has, words, 127).min(axis=1)
            for k, limit in enumerate(least):
                numbers = values[members, k]
                finite = has & np.isfinite(numbers)
                mixed = finite.any(axis=1) & (finite != has).any(axis=1)
                high, low = (np.where(finite, numbers, -np.inf).max(axis=1), np.where(finite, numbers, np.inf).min(axis=1))
                rough |= mixed | (finite.any(axis=1) & (high - low > limit))
            result[begin : begin + together] = rough
        return result


def ranges_of(values: np.ndarray) -> np.ndarray:
    """The range of each measure, (measures,), of values (members, measures), but for the few at its ends."""
    found = np.zeros(values.shape[1])
    for k, column in enumerate(values.T):
        finite = column[np.isfinite(column)]
        if len(finite):
            low, high = np.quantile(finite, (EDGE_SHARE, 1.0 - EDGE_SHARE))
            found[k] = high - low if high > low else np.ptp(finite)
    return found
