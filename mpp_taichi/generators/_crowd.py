"""Places for many spheres in a box: at random where they have room, else on a lattice. NumPy; no Taichi.

All random numbers come from the given generator, so that the same seed gives the same places.
"""

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

PAIRS_AT_ONCE = 2_000_000
CELLS_ALONG = 2**20  # three of these make an index of 60 bits
ROUNDS = 600  # of random insertion
JITTER = 0.999  # of the gap between two neighbours of a lattice


@dataclass(frozen=True, eq=False)
class PlacedSpheres:
    """Spheres that are already placed: position (n, 3), radius (n,)."""

    position: np.ndarray
    radius: np.ndarray


def close_pairs(first: np.ndarray, second: np.ndarray, reach: float) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Index pairs (i of first, j of second) that include every pair nearer than `reach`; positions (n, 3), in chunks.

    The second points are sorted by cells no smaller than `reach`; each first point is compared with the points of its own
    cell and of the cells around it.
    """
    if len(first) == 0 or len(second) == 0:
        return
    origin, end = first.min(axis=0) - reach, first.max(axis=0) + reach
    inside = np.flatnonzero(np.all((second >= origin) & (second <= end), axis=1))
    cell = max(reach, float((end - origin).max()) / CELLS_ALONG)
    if len(inside) == 0 or not cell > 0.0:
        return
    size = np.floor((end - origin) / cell).astype(np.int64) + 3
    weight = np.array([1, size[0], size[0] * size[1]])
    index_first = np.floor((first - origin) / cell).astype(np.int64) + 1
    key = (np.floor((second[inside] - origin) / cell).astype(np.int64) + 1) @ weight
    order = np.argsort(key, kind="stable")
    key, order = key[order], inside[order]
    flat = first.max(axis=0) - first.min(axis=0) + np.ptp(second[inside], axis=0) == 0.0
    for offset in itertools.product(*((0,) if same else (-1, 0, 1) for same in flat)):
        wanted = (index_first + offset) @ weight
        begin, stop = np.searchsorted(key, wanted, "left"), np.searchsorted(key, wanted, "right")
        yield from _expanded(begin, stop - begin, order)


def _expanded(begin: np.ndarray, count: np.ndarray, order: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Pairs (row, order[begin[row] … + count[row]]), in chunks that fit well into memory."""
    rows = np.flatnonzero(count)
    limits = np.cumsum(count[rows])
    start = 0
    while start < len(rows):
        done = limits[start - 1] if start else 0
        stop = max(start + 1, int(np.searchsorted(limits, done + PAIRS_AT_ONCE, "right")))
        part, some = rows[start:stop], count[rows[start:stop]]
        within = np.arange(some.sum()) - np.repeat(np.cumsum(some) - some, some)
        yield np.repeat(part, some), order[np.repeat(begin[part], some) + within]
        start = stop


def overlapping(position: np.ndarray, radius: np.ndarray, others: PlacedSpheres) -> np.ndarray:
    """True for the spheres that overlap one of the others, shape (n,)."""
    hit = np.zeros(len(position), dtype=bool)
    if len(position) and len(others.radius):
        for i, j in close_pairs(position, others.position, float(radius.max() + others.radius.max())):
            hit[i[_overlap(position[i] - others.position[j], radius[i] + others.radius[j])]] = True
    return hit


def _overlapping_earlier(position: np.ndarray, radius: np.ndarray) -> np.ndarray:
    """True for the spheres that overlap one of lower index."""
    hit = np.zeros(len(position), dtype=bool)
    for i, j in close_pairs(position, position, 2.0 * float(radius.max())):
        earlier = j < i
        i, j = i[earlier], j[earlier]
        hit[i[_overlap(position[i] - position[j], radius[i] + radius[j])]] = True
    return hit


def _overlap(separation: np.ndarray, distance: np.ndarray) -> np.ndarray:
    return np.sum(separation**2, axis=1) < distance**2


def at_random(
    random: np.random.Generator, lower: np.ndarray, upper: np.ndarray, radius: np.ndarray, obstacles: Sequence[PlacedSpheres]
) -> np.ndarray | None:
    """Random addition of spheres that lie wholly within `lower` … `upper`, large spheres first; None where no room is found.

    Each round draws places for the largest spheres that have no place yet, several places for each sphere if they are few,
    and keeps the places that overlap neither a placed sphere nor a place drawn earlier in the round. Along an axis on which
    the box has no extent, all centres have its coordinate.
    """
    count, axes = len(radius), upper > lower
    at_once = max(64, count // 16)
    position = np.zeros((count, 3))
    order = np.argsort(-radius, kind="stable")
    left, placed = order, order[:0]
    for _ in range(ROUNDS):
        if len(left) == 0:
            return position
        row = np.resize(left[:at_once], at_once)
        size = radius[row][:, None] * axes
        drawn = lower + size + random.random((len(row), 3)) * (upper - lower - 2.0 * size)
        free = ~_overlapping_earlier(drawn, radius[row])
        for each in (PlacedSpheres(position[placed], radius[placed]), *obstacles):
            kept = np.flatnonzero(free)
            free[kept] = ~overlapping(drawn[kept], radius[row[kept]], each)
        found, where = np.unique(row[free], return_index=True)
        position[found] = drawn[free][where]
        placed = np.concatenate([placed, found])
        left = left[~np.isin(left, found)]
    return position if len(left) == 0 else None


def on_lattice(
    random: np.random.Generator, lower: np.ndarray, upper: np.ndarray, radius: np.ndarray, obstacles: Sequence[PlacedSpheres]
) -> np.ndarray | None:
    """Places on a lattice that is stretched to fill the box, and shaken; None where no lattice has enough room.

    The lattice holds the points of a rectangular grid whose indices have an even sum: hexagonal in a flat box where the
    spacings are as 1 : √3, face-centred cubic where they are equal. The lattice whose neighbours are farthest apart is
    taken; its empty places are chosen at random. Then each sphere is moved at random by at most half the gap between
    neighbours, and moved back if it would overlap an obstacle.
    """
    largest, count = float(radius.max()), len(radius)
    axes = upper > lower
    low, room = lower + largest * axes, np.maximum(0.0, upper - lower - 2.0 * largest * axes)
    wanted = count
    while True:
        counts, nearest = _widest_grid(room, wanted)
        if nearest < 2.0 * largest * (1.0 - 1e-12):
            return None
        sites = low + _even_points(counts) * _spacing(room, counts)
        for each in obstacles:
            sites = sites[~overlapping(sites, np.full(len(sites), largest), each)]
        if len(sites) >= count:
            break
        wanted += max(count - len(sites), wanted // 100 + 1)
    chosen = sites[np.sort(random.permutation(len(sites))[:count])]
    way = max(0.0, 0.5 * JITTER * (min(nearest, float(room.max())) - 2.0 * largest))
    moved = chosen + _within_ball(random, count, room > 0.0) * way
    moved = np.clip(moved, low, low + room)  # which takes none farther from its place, as that is within
    for each in obstacles:
        moved = np.where(overlapping(moved, radius, each)[:, None], chosen, moved)
    return moved


def _widest_grid(room: np.ndarray, wanted: int) -> tuple[tuple[int, int, int], float]:
    """Counts along the axes of the grid with `wanted` even points whose neighbours are farthest apart, and how far."""
    points = 2 * wanted - 1
    most = [min(points, 4 + int(2.0 * length * _number_density(room, wanted))) if length > 0.0 else 1 for length in room]
    n = np.stack(np.meshgrid(*(np.arange(1, most[axis] + 1) for axis in (0, 1)), indexing="ij"), axis=-1).reshape(-1, 2)
    last = np.maximum(1, -(-points // np.prod(n, axis=1)))
    n = np.column_stack([n, last])
    n = n[(n[:, 2] == 1) | (room[2] > 0.0)]
    spacing = room / np.maximum(1, n - 1)
    nearest = np.full(len(n), math.inf)
    for a, b in itertools.combinations(range(3), 2):
        both = (n[:, a] > 1) & (n[:, b] > 1)
        nearest = np.where(both, np.minimum(nearest, np.hypot(spacing[:, a], spacing[:, b])), nearest)
    for axis in range(3):
        nearest = np.where(n[:, axis] > 2, np.minimum(nearest, 2.0 * spacing[:, axis]), nearest)
    if len(n) == 0:
        return (1, 1, 1), 0.0
    best = int(np.argmax(nearest))
    return (int(n[best, 0]), int(n[best, 1]), int(n[best, 2])), float(nearest[best])


def _number_density(room: np.ndarray, wanted: int) -> float:
    """Grid points per length of a grid of equal spacings along the axes that have any length."""
    long = room[room > 0.0]
    return float((2.0 * wanted / np.prod(long)) ** (1.0 / len(long))) if len(long) else 0.0


def _spacing(room: np.ndarray, counts: Sequence[int]) -> np.ndarray:
    return room / np.maximum(1, np.array(counts) - 1)


def _even_points(counts: Sequence[int]) -> np.ndarray:
    """Indices of a grid whose sum is even, shape (n, 3)."""
    grid = np.stack(np.meshgrid(*(np.arange(n) for n in counts), indexing="ij"), axis=-1).reshape(-1, 3)
    return grid[grid.sum(axis=1) % 2 == 0].astype(float)


def _within_ball(random: np.random.Generator, count: int, axes: np.ndarray) -> np.ndarray:
    """Vectors of at most length 1, evenly distributed, along the axes that are True."""
    direction = random.normal(size=(count, 3)) * axes
    length = np.linalg.norm(direction, axis=1, keepdims=True)
    unit = np.divide(direction, length, out=np.zeros_like(direction), where=length > 0.0)
    return unit * random.random((count, 1)) ** (1.0 / max(1, int(axes.sum())))
