"""The arguments of the drawing kernel, under one name for all functions that it calls."""

from typing import Any, NamedTuple


class Drawing(NamedTuple):
    """The arguments of `draw_pixels`, grouped while the kernel is compiled; the group itself does not exist in the kernel.

    width, height   of the picture [pixels]
    per_pixel       length at unit depth that a pixel shows; at any depth when `orthographic` is 1, which is 0 in perspective
    table, sphere_count, start, entry   the primitives (`_primitives.py`)
    picture         at first the background
    curve           how light is displayed (`_display.py`)
    light           direction that light comes from where no body shines
    surfaces        the parts of shading (`surface_parts.py`), at compile time; the rows below are used only where it is not 0
    material, place, texels, lights, casters, rings, glow_count   as in `SurfaceTables`
    levels          light of the 256 values of a texel
    light_count, caster_count, ring_count   rows of `lights`, `casters` and `rings`
    ambient         light from all directions
    """

    width: Any
    height: Any
    per_pixel: Any
    orthographic: Any
    table: Any
    sphere_count: Any
    start: Any
    entry: Any
    picture: Any
    curve: Any
    light: Any
    surfaces: Any
    material: Any
    place: Any
    texels: Any
    levels: Any
    lights: Any
    light_count: Any
    glow_count: Any
    casters: Any
    caster_count: Any
    rings: Any
    ring_count: Any
    ambient: Any
