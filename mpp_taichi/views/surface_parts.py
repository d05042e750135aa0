"""The parts of shading that a view asks for, and the columns of the tables in which the renderer's kernel finds them.

A picture compiles the parts that its view asks for and no others.
"""

SURFACES = 1
"""A body has a texture, shines or casts a shadow; without this part spheres are plain."""

COLORED_LIGHT = 2
"""The light on other bodies is not white, or not of brightness 1."""

NIGHT = 4
"""A body has lights on its dark side."""

CLOUDS = 8
"""A body has clouds."""

RELIEF = 16
"""A body has slopes."""

RINGS = 32
"""A body has a ring."""

GLOSS = 64
"""A body has a map of its highlights."""

TEXTURE_AT, NIGHT_AT, CLOUDS_AT, RELIEF_AT, GLOSS_AT = 0, 3, 6, 9, 12
"""Columns of `place` from which each map has its first texel, columns and rows; without columns it is absent."""
PLACE_COLUMNS = 15

SURFACE_AXES, CLOUD_AXES = 0, 10
"""Columns of `material` from which stand the prime meridian, 90° east of it and the north pole as directions."""
SHINES, OPACITY, BRIGHTNESS, STRENGTH = 9, 19, 20, 21
"""Columns of `material`: 1 where the body shines; factors of the opacity of clouds, the light of the night, highlights."""
MATERIAL_COLUMNS = 22

RING_COLUMNS = 9
"""0…2: middle of a ring, 3…5: north pole as a direction, 6: inner radius, 7: width, 8: its first texel."""
RING_TEXELS = 1024
"""From the inner to the outer edge; behind them half as many, a quarter, … down to one: their means."""
