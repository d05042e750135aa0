"""Symmetric positive definite matrices with few entries: an order with a narrow band, and Cholesky's factors in it. NumPy only.

All sums are elementwise or have one order, and no library of linear algebra takes part: results do not depend on its threads.
"""

import numpy as np
from numpy.lib.stride_tricks import as_strided


def narrow_order(count: int, first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """The nodes of a graph with edges first[k]–second[k] in the order of Cuthill & McKee, reversed.

    Source: Cuthill & McKee, Proc. 24th Nat. Conf. ACM (1969) 157.
    """
    neighbors: list[set[int]] = [set() for _ in range(count)]
    for a, b in zip(first.tolist(), second.tolist(), strict=True):
        neighbors[a].add(b)
        neighbors[b].add(a)
    degree = [len(each) for each in neighbors]
    near = [sorted(each, key=lambda a: (degree[a], a)) for each in neighbors]
    reached = [False] * count
    order: list[int] = []
    for start in sorted(range(count), key=lambda a: (degree[a], a)):
        if reached[start]:
            continue
        level = _breadth_first(_far_end(start, near), near, reached)
        order.extend(level)
    return np.array(order[::-1], dtype=np.intp)


def _far_end(start: int, near: list[list[int]]) -> int:
    """A node at the end of a longest of the shortest ways from `start`: an order that begins there has a narrower band."""
    return _breadth_first(start, near, [False] * len(near))[-1]


def _breadth_first(start: int, near: list[list[int]], reached: list[bool]) -> list[int]:
    reached[start] = True
    found = [start]
    for a in found:
        for b in near[a]:
            if not reached[b]:
                reached[b] = True
                found.append(b)
    return found


class BandedCholesky:
    """The factors of a symmetric positive definite matrix, which is given as its band.

    band[p, width + q − p] is the entry of row p and column q; both halves are given. ends[p] is one more than the last column
    that any row up to p reaches.
    """

    def __init__(self, band: np.ndarray, ends: np.ndarray):
        """Factorize in place; FloatingPointError where a pivot is not positive."""
        count, columns = band.shape
        width = (columns - 1) // 2
        self.reach = [int(end) - p - 1 for p, end in enumerate(ends)]
        self.rows: list[np.ndarray] = []
        self.pivot = np.empty(count)
        flat = band.reshape(-1)
        size = flat.itemsize
        room = np.empty((width, width))
        for p, reach in enumerate(self.reach):
            pivot = band[p, width]
            if not pivot > 0.0:
                raise FloatingPointError("the matrix is not positive definite")
            self.pivot[p] = root = np.sqrt(pivot)
            row = band[p, width + 1 : width + 1 + reach] / root
            self.rows.append(row)
            if reach > 0:
                below = as_strided(flat[p * columns + 3 * width + 1 :], (reach, reach), (2 * width * size, size))
                product = room[:reach, :reach]
                np.multiply(row[:, None], row[None, :], out=product)
                np.subtract(below, product, out=below)

    def solve(self, right: np.ndarray) -> np.ndarray:
        """The solution for a right-hand side."""
        x = right.copy()
        for p, (row, reach) in enumerate(zip(self.rows, self.reach, strict=True)):
            x[p] /= self.pivot[p]
            if reach > 0:
                x[p + 1 : p + 1 + reach] -= row * x[p]
        for p in range(len(x) - 1, -1, -1):
            reach = self.reach[p]
            x[p] = (x[p] - (self.rows[p] * x[p + 1 : p + 1 + reach]).sum()) / self.pivot[p]
        return x
