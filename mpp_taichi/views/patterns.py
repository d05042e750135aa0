"""Patterns: surfaces of bodies without any file, made from a seed and a colour. They are decoration, no maps of real bodies."""

from collections.abc import Callable, Iterator

import numpy as np

from mpp_taichi.views.sphere_noise import direction_of, directions, noise

ROWS = 320  # of a pattern; twice as many columns
CRATERS, LARGEST_CRATER, SMALLEST_CRATER = 140, 0.28, 0.025  # angular radii [radians]
SEA_SHARE = 0.62
CHECKS = 12  # from pole to pole


def pattern_picture(name: str, seed: int, color: tuple[float, ...]) -> np.ndarray:
    """A pattern as a picture of longitude and latitude, uint8, shape (ROWS, 2 ROWS, 3), in shades of a displayed colour."""
    random = random_of(name, seed)
    direction = directions(ROWS)
    picture = _PATTERNS[name](direction, np.array(color, dtype=float), random)
    return np.rint(255.0 * np.clip(picture, 0.0, 1.0)).astype(np.uint8)


def random_of(name: str, seed: int) -> np.random.Generator:
    """The random numbers of a pattern; patterns that share a landscape share the numbers of one of them."""
    return np.random.default_rng([seed, sum(_LANDSCAPE.get(name, name).encode())])


def _banded(direction: np.ndarray, color: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Belts and zones with ragged edges, and one oval storm."""
    swirl = noise(direction * np.array([1.0, 1.0, 3.0], np.float32), 3.0, 4, random)
    height = direction[..., 2] + 0.035 * swirl
    knots = random.uniform(-1.0, 1.0, 22)
    belt = np.interp(height, np.linspace(-1.0, 1.0, len(knots)), knots) + 0.25 * swirl
    storm_at = direction_of(random.uniform(-np.pi, np.pi), -0.38)
    offset = direction - storm_at
    storm = np.exp(-(offset[..., 0] ** 2 + offset[..., 1] ** 2 + 4.0 * offset[..., 2] ** 2) / 0.025)
    light, dark = 0.55 * color + 0.45, 0.62 * color
    share = np.clip(0.5 + 0.55 * belt, 0.0, 1.0)[..., None]
    surface = share * light + (1.0 - share) * dark
    red = np.array([0.75, 0.4, 0.28]) * (0.6 + 0.4 * color.max())
    return surface + 0.7 * storm[..., None] * (red - surface)


def _continents(direction: np.ndarray, color: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Seas of the body's colour, land, ice around the poles, clouds."""
    surface = _coasts(direction, color, random)
    cloud = np.clip(1.7 * noise(direction * np.array([1.0, 1.0, 1.8], np.float32), 2.6, 5, random) - 0.35, 0.0, 0.85)[..., None]
    return np.asarray(surface + cloud * (0.97 - surface))


def _coasts(direction: np.ndarray, color: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Seas of the body's colour, land, ice around the poles."""
    height, depth = height_and_depth(direction, random)
    depth = depth[..., None]
    sea = color * (0.62 + 0.38 * np.clip(1.0 + 1.5 * depth, 0.0, 1.0))
    warm = np.clip(1.0 - np.abs(direction[..., 2]) * 1.15, 0.0, 1.0)[..., None]
    dry = np.clip(0.5 + 1.2 * noise(direction, 3.0, 3, random), 0.0, 1.0)[..., None]
    low = dry * np.array([0.72, 0.60, 0.36]) + (1.0 - dry) * np.array([0.20, 0.42, 0.16])
    land = warm * low + (1.0 - warm) * np.array([0.38, 0.42, 0.30])
    land = land + np.clip(1.4 * depth - 0.5, 0.0, 1.0) * (np.array([0.55, 0.50, 0.45]) - land)
    surface = np.where(depth > 0.0, land, sea)
    ice = ice_share(direction, height)[..., None]
    surface = surface + ice * (0.95 - surface)
    return surface


def ice_share(direction: np.ndarray, height: np.ndarray) -> np.ndarray:
    """The share of ice around the poles of continents."""
    return np.asarray(np.clip((np.abs(direction[..., 2]) + 0.06 * height - 0.88) * 14.0, 0.0, 1.0))


def height_and_depth(direction: np.ndarray, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """The heights of continents, and the depth of the sea below 0 to the height of the land above 0, within −1…1."""
    height = noise(direction, 1.6, 6, random)
    return height, np.clip((height - np.quantile(height, SEA_SHARE)) * 1.8, -1.0, 1.0)


def _cratered(direction: np.ndarray, color: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Dark plains, and craters whose number grows as the inverse square of their size."""
    plains = noise(direction, 1.4, 5, random)
    shade = 0.82 + 0.22 * np.clip(1.5 * plains, -1.0, 1.0)
    for part, away, _ in craters(direction, random):
        shade[part] += 0.16 * np.exp(-((away - 1.0) ** 2) / 0.06) - 0.13 * np.clip(1.0 - away, 0.0, 0.6)
    return shade[..., None] * color


def craters(direction: np.ndarray, random: np.random.Generator) -> Iterator[tuple[slice, np.ndarray, float]]:
    """Rows that a crater may reach, the squares of their distances from its middle in radii, and its radius [radians]."""
    for share in (np.arange(CRATERS) + 0.5) / CRATERS:
        radius = 1.0 / np.sqrt(1.0 / LARGEST_CRATER**2 + share * (1.0 / SMALLEST_CRATER**2 - 1.0 / LARGEST_CRATER**2))
        middle = direction_of(random.uniform(-np.pi, np.pi), np.arcsin(random.uniform(-1.0, 1.0)))
        rows = np.nonzero(np.abs(np.arcsin(direction[:, 0, 2]) - np.arcsin(middle[2])) < 1.7 * radius)[0]
        if len(rows) == 0:
            continue
        part = slice(rows[0], rows[-1] + 1)
        yield part, 2.0 * (1.0 - direction[part] @ middle) / radius**2, float(radius)


def _checker(direction: np.ndarray, color: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Squares of 15° with one meridian marked, so that a rotation is visible."""
    del random
    rows, columns = np.arange(ROWS)[:, None] * CHECKS // ROWS, np.arange(2 * ROWS)[None, :] * CHECKS // ROWS
    surface = np.where(((rows + columns) % 2 == 0)[..., None], color, 0.4 * color)
    middle = (np.abs(np.arange(2 * ROWS) - ROWS) < ROWS // 64)[None, :, None]
    return np.where(middle, 1.0 - 0.7 * color, surface)


_PATTERNS: dict[str, Callable[[np.ndarray, np.ndarray, np.random.Generator], np.ndarray]] = {
    "banded": _banded,
    "continents": _continents,
    "coasts": _coasts,
    "cratered": _cratered,
    "checker": _checker,
}
_LANDSCAPE = {
    "coasts": "continents",
    "cities": "continents",
    "mountains": "continents",
    "oceans": "continents",
    "craters": "cratered",
}
