"""The parts of shading that a view asks for; a picture compiles these parts and no others."""

SURFACES = 1
"""A body has a texture, shines or casts a shadow; without this part spheres are plain."""

COLORED_LIGHT = 2
"""The light on other bodies is not white, or not of brightness 1."""
