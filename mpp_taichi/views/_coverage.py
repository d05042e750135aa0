"""The primitive that each sample of a picture shows: for CPUs found by rows of a tile, for GPUs pixel by pixel.

On a CPU each primitive tests the few pixels of a row that it may cover, whose samples stay in the nearest cache; on a GPU each
pixel tests all primitives of its tile. The result is the same to the last bit: the nearest primitive, and of equally near
primitives the first.

Both functions fill `depth`, the depth along the ray in camera distances, and `hit`, the row of the table, four of each for a
pixel. The caller sets them to `NOWHERE` and −1, which mean that no primitive was hit. The functions return 1 if any
sample hits a primitive.
"""

import taichi as ti

from mpp_taichi.types import Template
from mpp_taichi.views._primitives import TILE
from mpp_taichi.views._sample_hits import line_hit, rays, sample_places, sphere_hit


@ti.func
def depths_of(drawing: Template, p, x, y):
    """Depth at which the rays through pixel positions meet primitive p, or `NOWHERE`."""
    found = x
    if p < drawing.sphere_count:
        right, up = rays(drawing, x, y)
        found = sphere_hit(drawing, p, right, up)
    else:
        found = line_hit(drawing, p, x, y)
    return found


@ti.func
def cover_row(drawing: Template, tile, row, left, depth: Template, hit: Template):
    """Find the primitives of all samples in one row of a tile, from its pixel `left` on."""
    table = ti.static(drawing.table)
    some = 0
    for k in range(drawing.start[tile], drawing.start[tile + 1]):
        p = drawing.entry[k]
        if table[p, 2] < row + 1 and table[p, 3] > row:
            some = 1
            first = ti.max(ti.cast(ti.floor(table[p, 0]), ti.i32), left)
            last = ti.min(ti.cast(ti.ceil(table[p, 1]), ti.i32), ti.min(left + TILE, drawing.width))
            for column in range(first, last):
                place = 4 * (column - left)
                known = ti.Vector([depth[place + s] for s in ti.static(range(4))])
                if table[p, 4] <= known.max():
                    x, y = sample_places(column, row)
                    found = depths_of(drawing, p, x, y)
                    for s in ti.static(range(4)):
                        hit[place + s] = ti.select(found[s] < known[s], p, hit[place + s])
                        depth[place + s] = ti.min(found[s], known[s])
    return some


@ti.func
def cover_pixel(drawing: Template, tile, row, column, depth: Template, hit: Template):
    """Find the primitives of the samples of one pixel."""
    table = ti.static(drawing.table)
    x, y = sample_places(column, row)
    k, end = drawing.start[tile], drawing.start[tile + 1]
    while k < end:
        p = drawing.entry[k]
        k += 1
        if table[p, 4] > depth.max():
            k = end  # nearest first: nothing behind can be seen in any sample
        elif table[p, 0] < column + 1 and table[p, 1] > column and table[p, 2] < row + 1 and table[p, 3] > row:
            found = depths_of(drawing, p, x, y)
            for s in ti.static(range(4)):
                if found[s] < depth[s]:
                    depth[s], hit[s] = found[s], p
    return ti.cast(hit.max() >= 0, ti.i32)
