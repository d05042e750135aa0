"""What the samples of a picture see: for CPUs a row of a tile at a time, for GPUs pixel by pixel.

A primitive looks at its own few pixels of a row, whose samples stay in the nearest cache; a pixel of a GPU looks through all
primitives of its tile. The result is the same to the last bit: the nearest one, and of equally near ones the first.

Both fill `depth` along the rays, in camera distances, and `hit`, rows of the table, four of each for a pixel. They come as
nothing seen, `NOWHERE` and −1; returned is 1 where anything is seen.
"""

import taichi as ti

from mpp_taichi.types import Template
from mpp_taichi.views._primitives import TILE
from mpp_taichi.views._sample_hits import line_hit, rays, sample_places, sphere_hit


@ti.func
def depths_of(drawing: Template, p, x, y):
    """Of primitive p, where the samples at pixel positions meet it."""
    found = x
    if p < drawing.sphere_count:
        right, up = rays(drawing, x, y)
        found = sphere_hit(drawing, p, right, up)
    else:
        found = line_hit(drawing, p, x, y)
    return found


@ti.func
def cover_row(drawing: Template, tile, row, left, depth: Template, hit: Template):
    """The samples of one row of a tile, from its pixel `left` on."""
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
    """The samples of one pixel."""
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
