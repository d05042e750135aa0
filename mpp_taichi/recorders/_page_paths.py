"""Finer paths for a page: places between the frames, for the trails of the few particles that turn far from frame to frame.

The browser draws cubics through the places of frames, with speeds from the differences of places, so that no velocities are
stored. Where such cubics would miss a path, the page has places at 2, 4, 8 or 16 times as many moments for this particle.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mpp_taichi.arithmetic.hermite import cubic
from mpp_taichi.recorders._column_code import EncodedColumn, encode
from mpp_taichi.views._base import Frame

FINEST = 16  # moments for each frame
SHARES = np.arange(1, FINEST) / FINEST
MOST_ROWS = 100_000  # places, and never more than a quarter of those of the frames where that is more

PathPoints = tuple[np.ndarray, np.ndarray]
"""Indices of particles (count,), and their places at `SHARES` of the time before a frame, (FINEST − 1, count, 3)."""


@dataclass(frozen=True, eq=False)
class FinerPaths:
    """The particles, the moments for each frame, and the columns x, y, z of (frames − 1) · pieces + 1 rows."""

    particles: np.ndarray
    pieces: int
    columns: tuple[EncodedColumn, ...]

    def description(self) -> dict[str, object]:
        """The entry of the header."""
        columns = [column.description() for column in self.columns]
        return {"particles": self.particles.tolist(), "pieces": self.pieces, "columns": columns}


def finer_paths(
    frames: Sequence[Frame], paths: Sequence[PathPoints | None], tolerance: float, byte_count: int
) -> FinerPaths | None:
    """The paths that the page needs so that its trails are within `tolerance` [length]; None where the frames are enough.

    `paths` has an entry for each frame; later entries hold all particles of earlier ones.
    """
    found = next((each for each in reversed(paths) if each is not None), None)
    if found is None or len(frames) < 2:
        return None
    particles = found[0]
    fine = _places(frames, paths, particles)
    missed = [_deviation(fine, FINEST // pieces) for pieces in (1, 2, 4, 8)]
    chosen = missed[0] > tolerance
    if not chosen.any():
        return None
    largest = [float(each[chosen].max()) for each in missed]
    pieces = next((2**n for n, each in enumerate(largest) if each <= tolerance), FINEST)
    room = max(MOST_ROWS, len(frames) * len(frames[0].position) // 4)
    while pieces > 1 and int(chosen.sum()) * pieces * len(frames) > room:
        pieces //= 2
    if pieces == 1:
        return None
    rows = fine[:: FINEST // pieces, chosen]
    columns = tuple(encode(f"path_{name}", rows[:, :, axis], byte_count) for axis, name in enumerate("xyz"))
    return FinerPaths(particles[chosen], pieces, columns)


def _places(frames: Sequence[Frame], paths: Sequence[PathPoints | None], particles: np.ndarray) -> np.ndarray:
    """Places at all moments, ((frames − 1) · FINEST + 1, particles, 3)."""
    coarse = np.stack([frame.position[particles] for frame in frames])
    fine = np.empty(((len(frames) - 1) * FINEST + 1, len(particles), 3))
    fine[::FINEST] = coarse
    guessed = _curves(coarse, FINEST)  # of a particle before it turned far for the first time
    for n, share in enumerate(range(1, FINEST)):
        fine[share::FINEST] = guessed[:, n]
    for number, path in enumerate(paths[1:]):
        if path is not None:
            index, points = path
            fine[number * FINEST + 1 : (number + 1) * FINEST, np.searchsorted(particles, index)] = points
    return fine


def _deviation(fine: np.ndarray, step: int) -> np.ndarray:
    """How far the browser's cubics through every `step`-th row are from the rows between, of each particle."""
    coarse = fine[::step]
    drawn = _curves(coarse, step)
    true = np.stack([fine[n::step][: len(coarse) - 1] for n in range(1, step)], axis=1)
    away = np.linalg.norm(drawn - true, axis=3)
    return np.nan_to_num(away, nan=0.0).max(axis=(0, 1), initial=0.0)


def _curves(rows: np.ndarray, step: int) -> np.ndarray:
    """Points of the browser's cubics at the shares 1/step … of each interval, (rows − 1, step − 1, count, 3)."""
    way = _ways(rows)
    p0, p1, v0, v1 = rows[:-1, None], rows[1:, None], way[:-1, None], way[1:, None]
    return cubic((np.arange(1, step) / step)[None, :, None, None], 1.0, (p0, v0), (p1, v1))


def _ways(rows: np.ndarray) -> np.ndarray:
    """Speeds as ways within a row, from differences of fourth or second order, as `tangent` of trails.js."""
    way = np.gradient(rows, axis=0, edge_order=2 if len(rows) > 2 else 1)
    if len(rows) > 4:
        way[2:-2] = (8.0 * (rows[3:-1] - rows[1:-3]) - (rows[4:] - rows[:-4])) / 12.0
    return np.asarray(way)
