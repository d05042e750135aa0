"""Patterns of clouds, lights at night, heights and highlights, made from a seed. Decoration, no maps of real bodies."""

import numpy as np

from mpp_taichi.views.patterns import ROWS, craters, height_and_depth, ice_share, random_of
from mpp_taichi.views.sphere_noise import directions, noise

CLOUD_WHITE = 0.97  # as displayed
TOWNS = 14000  # places that may have lights
TOWN_COLOR = np.array([1.0, 0.80, 0.50])  # as displayed
SEA_GLOSS, ICE_GLOSS = 0.55, 0.12  # share of a light in the middle of its highlight
NORTHERNMOST = 0.90  # sine of the latitude beyond which there are no towns


def cloud_picture(name: str, seed: int) -> np.ndarray:
    """White clouds with their opacity in the last channel, uint8, shape (ROWS, 2 ROWS, 4)."""
    random, direction = random_of(name, seed), directions(ROWS)
    bent = direction + 0.25 * np.stack([noise(direction, 1.5, 3, random) for _ in range(3)], axis=2)
    cloud = noise(bent * np.array([1.0, 1.0, 2.2], np.float32), 2.2, 6, random)
    opacity = np.clip(1.9 * cloud - 0.25, 0.0, 0.92)
    picture = np.full((ROWS, 2 * ROWS, 4), CLOUD_WHITE)
    picture[..., 3] = opacity
    return np.rint(255.0 * picture).astype(np.uint8)


def night_picture(name: str, seed: int) -> np.ndarray:
    """Towns on the land, most of them near its coasts and in clusters, uint8, shape (ROWS, 2 ROWS, 3)."""
    random, direction = random_of(name, seed), directions(ROWS)
    _, depth = height_and_depth(direction, random)
    crowd = np.clip(0.35 + noise(direction, 4.0, 3, random), 0.0, 1.0) ** 2 * np.exp(-4.0 * np.clip(depth, 0.0, 1.0))
    crowd = np.where((depth > 0.0) & (np.abs(direction[..., 2]) < NORTHERNMOST), crowd, 0.0)
    row = ROWS * np.arccos(random.uniform(-NORTHERNMOST, NORTHERNMOST, TOWNS)) / np.pi
    column = random.uniform(0.0, 2 * ROWS, TOWNS)
    size = 0.12 * (1.0 - random.random(TOWNS)) ** -0.6  # few large towns among many small towns
    place = row.astype(int), column.astype(int)
    light = np.minimum(size, 1.5) * (random.random(TOWNS) < crowd[place])
    picture = np.zeros((ROWS, 2 * ROWS))
    for down in (-1, 0, 1):
        for across in (-1, 0, 1):
            at = np.clip(place[0] + down, 0, ROWS - 1), (place[1] + across) % (2 * ROWS)
            np.add.at(picture, at, light * 0.35 ** (down * down + across * across))
    shown = np.clip(picture[..., None] ** (1.0 / 2.2) * TOWN_COLOR, 0.0, 1.0)
    return np.asarray(np.rint(255.0 * shown), dtype=np.uint8)


def gloss_picture(name: str, seed: int) -> np.ndarray:
    """Seas that mirror a light, ice that mirrors little of it, and land that mirrors none, uint8, shape (ROWS, 2 ROWS, 3)."""
    random, direction = random_of(name, seed), directions(ROWS)
    height, depth = height_and_depth(direction, random)
    share = np.where(depth > 0.0, 0.0, SEA_GLOSS)
    ice = ice_share(direction, height)
    share = share + ice * (ICE_GLOSS - share)
    return np.asarray(np.rint(255.0 * np.repeat(share[..., None], 3, axis=2)), dtype=np.uint8)


def height_picture(name: str, seed: int) -> np.ndarray:
    """Heights, mostly within 0…1, shape (ROWS, 2 ROWS)."""
    random, direction = random_of(name, seed), directions(ROWS)
    return _HEIGHTS[name](direction, random)


def _mountains(direction: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Land with ridges that rise from the coasts; the sea is level."""
    _, depth = height_and_depth(direction, random)
    ridge = 1.0 - np.abs(noise(direction, 6.0, 4, random))
    return np.where(depth > 0.0, np.clip(depth, 0.0, 1.0) ** 0.7 * (0.35 + 0.65 * np.clip(ridge, 0.0, 1.0)), 0.0)


def _craters(direction: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Bowls with rims, whose depth grows with their radius, on rolling plains."""
    height = 0.5 + 0.10 * noise(direction, 1.4, 5, random)
    for part, away, radius in craters(direction, random):
        rim = 0.6 * np.exp(-((away - 1.0) ** 2) / 0.10)
        bowl = 0.9 * np.clip(1.0 - away, 0.0, 0.7)
        height[part] += 5.0 * radius * (rim - bowl)
    return height


_HEIGHTS = {"mountains": _mountains, "craters": _craters}
