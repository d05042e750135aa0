"""From particles and segments to the data of the renderer: a table of primitives, and a list of primitives for each tile.

All lengths are divided by the camera's distance, so that a scene in astronomical units, in metres or in nanometres looks the
same to single precision. Screen coordinates are pixels from the upper left corner.
"""

import math
from dataclasses import dataclass

import numpy as np

from mpp_taichi.views.camera import Camera

TILE = 16  # pixels; side of the square that shares one list of primitives
NEAR, FAR = 1.0e-3, 1.0e9  # depths drawn, in camera distances; squares of FAR fit into single precision
FIELDS = 16
"""Columns of the table, float32, one row per primitive.

 0…3   box on the screen: left, right, top, bottom [pixels];  4: smallest depth
 sphere: 5…7 centre in camera coordinates, 8 radius, 9…11 linear colour; where bodies have surfaces, 12 material, 13 index
 line:   5…7 first end: x, y [pixels], w;  8…10 second end less the first;  11: 1/|second − first|² on the screen, or 0;
         12: half the width [pixels];  13…15: linear colour.  w is 1/depth in perspective, which is linear on the screen,
         and the depth itself in an orthographic picture.
"""


@dataclass(frozen=True, eq=False)
class Primitives:
    """The primitives of a picture: rows of `table`, front to back within each tile; the first `sphere_count` rows are spheres.

    The rows seen in tile t are entry[start[t]] … entry[start[t + 1] - 1].
    """

    table: np.ndarray
    sphere_count: int
    start: np.ndarray
    entry: np.ndarray


@dataclass(frozen=True)
class Screen:
    """Size of a picture in pixels and the camera's focal length in pixels (per scaled length when orthographic)."""

    width: int
    height: int
    focal: float
    orthographic: bool

    @staticmethod
    def of(camera: Camera, width: int, height: int) -> "Screen":
        """The screen of a camera."""
        if camera.orthographic:
            return Screen(width, height, height * camera.distance / camera.height, True)
        return Screen(width, height, height / 2.0 / math.tan(math.radians(camera.field_of_view) / 2.0), False)

    @property
    def tiles_across(self) -> int:
        """Tiles in one row of tiles."""
        return -(-self.width // TILE)

    @property
    def tiles_down(self) -> int:
        """Rows of tiles."""
        return -(-self.height // TILE)


def spheres(
    center: np.ndarray, radius: np.ndarray, color: np.ndarray, screen: Screen, *, marks: np.ndarray | None = None
) -> np.ndarray:
    """Rows for the spheres in view; `center` in scaled camera coordinates, colours linear, marks as in surfaces.py.

    A sphere that holds the camera is left out; a sphere that reaches behind the near plane is boxed by the whole picture.
    """
    usable = (np.abs(center) < FAR).all(axis=1) & (radius > 0.0) & (radius < FAR) & (center[:, 2] + radius > NEAR)
    if not screen.orthographic:
        with np.errstate(over="ignore", invalid="ignore"):  # the sphere is left out anyway
            usable &= np.einsum("ij,ij->i", center, center) > radius * radius * (1.0 + 1.0e-6)
    center, radius, color = center[usable], radius[usable], color[usable]
    right, up, depth = center.T
    if screen.orthographic:
        low_x, high_x, low_y, high_y = right - radius, right + radius, up - radius, up + radius
    else:
        low_x, high_x = _tangents(right, depth, radius)
        low_y, high_y = _tangents(up, depth, radius)
    table = np.empty((len(center), FIELDS), np.float32)
    table[:, 0] = np.clip(screen.width / 2.0 + screen.focal * low_x, -TILE, screen.width + TILE)
    table[:, 1] = np.clip(screen.width / 2.0 + screen.focal * high_x, -TILE, screen.width + TILE)
    table[:, 2] = np.clip(screen.height / 2.0 - screen.focal * high_y, -TILE, screen.height + TILE)
    table[:, 3] = np.clip(screen.height / 2.0 - screen.focal * low_y, -TILE, screen.height + TILE)
    table[:, 4] = depth - radius
    table[:, 5:8] = center
    table[:, 8] = radius
    table[:, 9:12] = color
    table[:, 12:] = 0.0
    if marks is not None:
        table[:, 12:14] = marks[usable]
    return table[_in_view(table, screen)]


def _tangents(side: np.ndarray, depth: np.ndarray, radius: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Slopes of the two lines from the eye that touch a sphere, in the plane of one screen axis and the depth."""
    whole = depth - radius < NEAR
    square = np.where(whole, 1.0, depth * depth - radius * radius)
    reach = radius * np.sqrt(np.maximum(side * side + square, 0.0))
    low, high = (side * depth - reach) / square, (side * depth + reach) / square
    return np.where(whole, -1.0e6, low), np.where(whole, 1.0e6, high)


def lines(ends: np.ndarray, color: np.ndarray, width: np.ndarray, screen: Screen) -> np.ndarray:
    """Rows for segments, clipped to the picture; `ends` (count, 2, 3) in scaled camera coordinates, width in pixels."""
    usable = (np.abs(ends) < FAR).all(axis=(1, 2)) & (ends[..., 2] > NEAR).any(axis=1)
    first, second = ends[usable, 0], ends[usable, 1]
    color, half = color[usable], width[usable] / 2.0
    first, second = _in_front(first, second), _in_front(second, first)
    a, b = _project(first, screen), _project(second, screen)
    enter, leave = np.zeros(len(a)), np.ones(len(a))
    for axis, size in ((0, screen.width), (1, screen.height)):
        _clip(a[:, axis], b[:, axis], -half - 1.0, size + half + 1.0, enter, leave)
    kept = enter < leave
    a, along = a[kept], (b - a)[kept]
    a, b = a + enter[kept, None] * along, a + leave[kept, None] * along
    color, half = color[kept], half[kept]
    along = b - a
    length2 = along[:, 0] ** 2 + along[:, 1] ** 2
    nearest = np.minimum(first[kept, 2], second[kept, 2])
    table = np.empty((len(a), FIELDS), np.float32)
    table[:, 0], table[:, 1] = np.minimum(a[:, 0], b[:, 0]) - half, np.maximum(a[:, 0], b[:, 0]) + half
    table[:, 2], table[:, 3] = np.minimum(a[:, 1], b[:, 1]) - half, np.maximum(a[:, 1], b[:, 1]) + half
    table[:, 4] = nearest * (1.0 - 1.0e-5)  # rounding may make the depth found on the screen smaller
    table[:, 5:8], table[:, 8:11] = a, along
    table[:, 11] = np.where(length2 > 0.0, 1.0 / np.where(length2 > 0.0, length2, 1.0), 0.0)
    table[:, 12] = half
    table[:, 13:16] = color
    return table[_in_view(table, screen)]


def _in_front(point: np.ndarray, other: np.ndarray) -> np.ndarray:
    """The point, moved along the segment to the near plane where it lies behind."""
    behind = point[:, 2] < NEAR
    rise = np.where(behind, other[:, 2] - point[:, 2], 1.0)
    share = np.where(behind, (NEAR - point[:, 2]) / rise, 0.0)
    return point + share[:, None] * (other - point)


def _project(point: np.ndarray, screen: Screen) -> np.ndarray:
    w = point[:, 2] if screen.orthographic else 1.0 / point[:, 2]
    factor = screen.focal if screen.orthographic else screen.focal * w
    return np.stack([screen.width / 2.0 + factor * point[:, 0], screen.height / 2.0 - factor * point[:, 1], w], axis=1)


def _clip(a: np.ndarray, b: np.ndarray, low: np.ndarray, high: np.ndarray, enter: np.ndarray, leave: np.ndarray) -> None:
    """Narrow enter…leave to the part of a…b between low and high.  [Liang & Barsky 1984, ACM Trans. Graph. 3, 1]"""
    along = b - a
    level = along == 0.0
    step = np.where(level, 1.0, along)
    to_low, to_high = (low - a) / step, (high - a) / step
    outside = level & ((a < low) | (a > high))
    np.maximum(enter, np.where(level, 0.0, np.minimum(to_low, to_high)), out=enter)
    np.minimum(leave, np.where(outside, -1.0, np.where(level, 1.0, np.maximum(to_low, to_high))), out=leave)


def _in_view(table: np.ndarray, screen: Screen) -> np.ndarray:
    return (table[:, 1] > 0) & (table[:, 0] < screen.width) & (table[:, 3] > 0) & (table[:, 2] < screen.height)


def bin_into_tiles(sphere_table: np.ndarray, line_table: np.ndarray, screen: Screen) -> Primitives:
    """List the primitives of every tile, nearest first; ties keep the order of the table, so that pictures repeat.

    A primitive enters, row of tiles by row of tiles, the tiles between its leftmost and rightmost pixel there, so that a long
    oblique line fills a staircase of tiles and not its whole box.
    """
    table = np.concatenate([sphere_table, line_table])
    across, down = screen.tiles_across, screen.tiles_down
    first_row = np.clip(np.floor(table[:, 2] / TILE), 0, down - 1).astype(np.int64)
    last_row = np.clip(np.floor(table[:, 3] / TILE), 0, down - 1).astype(np.int64)
    order = np.argsort(table[:, 4], kind="stable")
    owner, offset = _spread(order, (last_row - first_row + 1)[order])
    row = first_row[owner] + offset
    left, right = table[owner, 0], table[owner, 1]
    is_line = owner >= len(sphere_table)
    left[is_line], right[is_line] = _reach(table[owner[is_line]], row[is_line])
    first = np.clip(np.floor(left / TILE), 0, across - 1).astype(np.int64)
    last = np.clip(np.floor(right / TILE), 0, across - 1).astype(np.int64)
    span, offset = _spread(np.arange(len(owner)), np.maximum(last - first + 1, 0))
    tile = row[span] * across + first[span] + offset
    if across * down <= 1 << 16:
        tile = tile.astype(np.uint16)  # 16-bit integers, which NumPy sorts ten times as fast, by radix
    by_tile = np.argsort(tile, kind="stable")
    start = np.zeros(across * down + 1, np.int32)
    start[1:] = np.cumsum(np.bincount(tile, minlength=across * down))
    return Primitives(table, len(sphere_table), start, owner[span][by_tile].astype(np.int32))


def _spread(owner: np.ndarray, count: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Each owner repeated `count` times, and 0, 1, … count − 1 beside it."""
    first = np.cumsum(count) - count
    return np.repeat(owner, count), np.arange(int(count.sum())) - np.repeat(first, count)


def _reach(line: np.ndarray, row: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Leftmost and rightmost pixel of lines within one row of tiles each."""
    ax, ay, dx, dy, half = line[:, 5], line[:, 6], line[:, 8], line[:, 9], line[:, 12]
    level = np.abs(dy) < 1.0e-3
    step = np.where(level, 1.0, dy)
    share = [
        np.where(level, end, np.clip(((row + end) * TILE + (2.0 * end - 1.0) * half - ay) / step, 0, 1)) for end in (0.0, 1.0)
    ]
    x = [ax + s * dx for s in share]
    return np.minimum(*x) - half, np.maximum(*x) + half


def at_least_one(rows: np.ndarray) -> np.ndarray:
    """The array, or one row of zeros in place of none: an array of a kernel may not be empty."""
    return rows if len(rows) else np.zeros((1, *rows.shape[1:]), rows.dtype)
