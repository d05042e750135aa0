"""The looks of a window: as a film shows the scene, or with plain spheres."""

LOOKS = ("auto", "film", "plain")
MOST_PARTICLES = 50_000
"""Particles up to which `auto` is the look of films: at 1280 × 720 the renderer takes some 50 ms for them on two cores."""


def is_film(look: str, particle_count: int) -> bool:
    """Whether a scene has the look of films, by the look that was asked for: `auto`, `film` or `plain`."""
    return look == "film" or (look == "auto" and particle_count <= MOST_PARTICLES)
