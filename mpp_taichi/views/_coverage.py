"""What each sample of a picture shows, tile by tile: for CPUs, where a tile's samples stay in the cache.

A primitive looks at its own few pixels of a tile, while a pixel of a GPU looks through all primitives of its tile. The result
is the same to the last bit: the nearest one, and of equally near ones the first.
"""

import numpy as np
import taichi as ti

from mpp_taichi.views._primitives import TILE, Primitives, Screen, at_least_one
from mpp_taichi.views._sample_hits import SAMPLES, line_hit, single, sphere_hit

SAMPLES_PER_TILE = 4 * TILE * TILE


class Coverage:
    """Depths and primitives of the samples of some tiles; memory is kept from picture to picture.

    depth   (tiles, samples) along the ray, in camera distances
    hit     (tiles, samples) rows of the table, −1 for none
    """

    def __init__(self) -> None:
        """Nothing is seen yet."""
        self.depth, self.hit = np.zeros((1, 1), np.float32), np.zeros((1, 1), np.int32)

    def find(self, tiles: np.ndarray, primitives: Primitives, screen: Screen) -> None:
        """Look at all samples of these tiles."""
        if len(tiles) > len(self.depth) or self.depth.shape[1] != SAMPLES_PER_TILE:
            self.depth = np.empty((len(tiles), SAMPLES_PER_TILE), np.float32)
            self.hit = np.empty((len(tiles), SAMPLES_PER_TILE), np.int32)
        places = [np.arange(size, dtype=np.float32)[:, None] for size in (screen.width, screen.height)]
        x, y = (place + np.float32(0.5) + np.array(SAMPLES, np.float32)[:, axis] for axis, place in enumerate(places))
        _cover(
            tiles,
            screen.tiles_across,
            primitives.sphere_count,
            at_least_one(primitives.table),
            primitives.start,
            at_least_one(primitives.entry),
            x,
            y,
            np.float32(screen.width) * np.float32(0.5),
            np.float32(screen.height) * np.float32(0.5),
            screen.focal,
            int(screen.orthographic),
            self.depth,
            self.hit,
        )


@ti.kernel
def _cover(
    tiles: ti.types.ndarray(ti.i32, ndim=1),
    across: ti.i32,
    sphere_count: ti.i32,
    table: ti.types.ndarray(ti.f32, ndim=2),
    start: ti.types.ndarray(ti.i32, ndim=1),
    entry: ti.types.ndarray(ti.i32, ndim=1),
    x: ti.types.ndarray(ti.f32, ndim=2),
    y: ti.types.ndarray(ti.f32, ndim=2),
    middle_x: ti.f32,
    middle_y: ti.f32,
    focal: ti.f32,
    orthographic: ti.i32,
    depth: ti.types.ndarray(ti.f32, ndim=2),
    hit: ti.types.ndarray(ti.i32, ndim=2),
):
    ti.loop_config(block_dim=4, block_dim_adaptive=False)
    for q in range(tiles.shape[0]):
        tile = tiles[q]
        top, left = tile // across * TILE, tile % across * TILE
        for k in range(SAMPLES_PER_TILE):
            depth[q, k] = single(3.0e38)
            hit[q, k] = -1
        for k in range(start[tile], start[tile + 1]):
            p = entry[k]
            first_column = ti.max(ti.cast(ti.floor(table[p, 0]), ti.i32), left)
            last_column = ti.min(ti.cast(ti.ceil(table[p, 1]), ti.i32), ti.min(left + TILE, x.shape[0]))
            first_row = ti.max(ti.cast(ti.floor(table[p, 2]), ti.i32), top)
            last_row = ti.min(ti.cast(ti.ceil(table[p, 3]), ti.i32), ti.min(top + TILE, y.shape[0]))
            nearest = table[p, 4]
            for row in range(first_row, last_row):
                for column in range(first_column, last_column):
                    place = 4 * ((row - top) * TILE + column - left)
                    known = ti.Vector([depth[q, place + s] for s in ti.static(range(4))])
                    if nearest <= known.max():
                        for s in ti.static(range(4)):
                            found = single(-1)
                            if p < sphere_count:
                                rx, ry = (x[column, s] - middle_x) / focal, (middle_y - y[row, s]) / focal
                                found = sphere_hit(table, p, rx, ry, orthographic)
                            else:
                                found = line_hit(table, p, x[column, s], y[row, s], orthographic)
                            if found > 0 and found < known[s]:
                                depth[q, place + s] = found
                                hit[q, place + s] = p
