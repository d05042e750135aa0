"""Closed skins in space: triangles between the particles of a group, as on a geodesic sphere. Host only, float64.

A geodesic sphere of ν divisions is an icosahedron whose 20 faces are divided into ν² triangles each, with all corners moved to
the sphere: 10 ν² + 2 corners, 30 ν² edges, 20 ν² triangles. Four corners are a tetrahedron. Source: H. S. M. Coxeter, Regular
Polytopes (1973), §3.7; C. J. H. Clinton, Advanced Structural Geometry Studies (1971).
"""

import math
from collections.abc import Iterator
from functools import lru_cache

import numpy as np

MOST_NEIGHBORS = 6
TETRAHEDRON = 4
MOST_DIVISIONS = 64


def corner_count(divisions: int) -> int:
    """The corners of a geodesic sphere, 10 ν² + 2."""
    return 10 * divisions**2 + 2


def divisions_of(count: int) -> int | None:
    """ν of a geodesic sphere with so many corners; 0 for the four of a tetrahedron, None where there is no such skin."""
    if count == TETRAHEDRON:
        return 0
    divisions = math.isqrt(max(count - 2, 0) // 10)
    return divisions if 1 <= divisions <= MOST_DIVISIONS and corner_count(divisions) == count else None


def directions(divisions: int) -> np.ndarray:
    """Unit vectors from the centre to the corners, (10 ν² + 2, 3): those of the icosahedron first."""
    return _sphere(divisions)[0]


def triangles(count: int) -> np.ndarray:
    """The corners of each triangle, (triangles, 3), which go round against the clock where they are seen from outside."""
    divisions = divisions_of(count)
    if divisions is None:
        raise ValueError(f"no closed skin has {count} corners")
    if divisions == 0:
        return np.array([[0, 1, 2], [0, 2, 3], [0, 3, 1], [1, 3, 2]])
    return _sphere(divisions)[1]


def edge_count(count: int) -> int:
    """The edges of a closed skin of triangles with so many corners, by Euler's formula."""
    return 3 * (count - 2)


def edges(count: int) -> np.ndarray:
    """The two ends of each edge, the lower number first, in ascending order, (edges, 2)."""
    found = triangles(count)
    both = np.concatenate([found[:, [0, 1]], found[:, [1, 2]], found[:, [2, 0]]])
    return np.unique(np.sort(both, axis=1), axis=0)


def rings(count: int) -> np.ndarray:
    """The neighbours of each corner, (corners, 6), against the clock from outside; of fewer than six the first is repeated."""
    following: list[dict[int, int]] = [{} for _ in range(count)]
    for triangle in triangles(count).tolist():
        for k in range(3):
            corner, one, other = triangle[k], triangle[(k + 1) % 3], triangle[(k + 2) % 3]
            following[corner][one] = other
    found = np.empty((count, MOST_NEIGHBORS), np.int32)
    for corner, after in enumerate(following):
        ring = [min(after)]
        while len(ring) < len(after):
            ring.append(after[ring[-1]])
        found[corner] = ring + [ring[0]] * (MOST_NEIGHBORS - len(ring))
    return found


def enclosed_volume(corners: np.ndarray) -> float:
    """The volume inside a closed skin with its sign, above 0 where its triangles go round as `triangles` says [length³].

    It is summed about the first corner, so that a skin far from the origin keeps its digits.
    """
    away = corners - corners[0]
    one, two, three = (away[triangles(len(corners))[:, k]] for k in range(3))
    return float(np.sum(one * np.cross(two, three))) / 6.0


@lru_cache(maxsize=16)
def _sphere(divisions: int) -> tuple[np.ndarray, np.ndarray]:
    """Directions and triangles of a geodesic sphere.

    A corner is known by the corners of the icosahedron that it lies between, with their weights, so that faces share corners.
    """
    corners, faces = _icosahedron()
    known: dict[tuple[tuple[int, int], ...], int] = {((k, divisions),): k for k in range(len(corners))}
    places = list(corners)
    found: list[list[int]] = []
    for face in faces:

        def number(a: int, b: int, face: list[int] = face) -> int:
            weights = {face[0]: divisions - a - b, face[1]: a, face[2]: b}
            key = tuple(sorted((corner, weight) for corner, weight in weights.items() if weight))
            if key not in known:
                known[key] = len(places)
                place = np.sum([weight * corners[corner] for corner, weight in key], axis=0)
                places.append(place / np.linalg.norm(place))
            return known[key]

        found += [[number(*corner) for corner in cell] for cell in _cells(divisions)]
    return np.array(places), np.array(found)


def _cells(divisions: int) -> Iterator[tuple[tuple[int, int], tuple[int, int], tuple[int, int]]]:
    """The triangles of a divided face, by the steps a and b of each corner along two of its sides."""
    for a in range(divisions):
        for b in range(divisions - a):
            yield (a, b), (a + 1, b), (a, b + 1)
            if a + b < divisions - 1:
                yield (a + 1, b), (a + 1, b + 1), (a, b + 1)


def _icosahedron() -> tuple[np.ndarray, list[list[int]]]:
    """Unit vectors to the twelve corners, poles first and last, and the twenty faces, seen from outside against the clock."""
    height, width = 1.0 / math.sqrt(5.0), 2.0 / math.sqrt(5.0)
    upper = [(width * math.cos(k * math.tau / 5), width * math.sin(k * math.tau / 5), height) for k in range(5)]
    lower = [
        (width * math.cos((k + 0.5) * math.tau / 5), width * math.sin((k + 0.5) * math.tau / 5), -height) for k in range(5)
    ]
    faces = []
    for k in range(5):
        n = (k + 1) % 5
        faces += [[0, 1 + k, 1 + n], [1 + k, 6 + k, 1 + n], [6 + k, 6 + n, 1 + n], [11, 6 + n, 6 + k]]
    return np.array([(0.0, 0.0, 1.0), *upper, *lower, (0.0, 0.0, -1.0)]), faces
