"""Patterns of rings from their inner to their outer edge: colour and opacity, made from a seed or from the rings of Saturn."""

import numpy as np

_SECTIONS = (
    # First radius [km] of a section, optical depth, brightness of its colour.  [NASA, Saturnian Rings Fact Sheet]
    (74_658, 0.10, 0.55),  # ring C
    (92_000, 1.10, 0.90),  # inner ring B
    (99_000, 2.20, 1.00),  # outer ring B
    (117_580, 0.10, 0.60),  # Cassini Division
    (122_170, 0.60, 0.85),  # ring A
    (133_427, 0.01, 0.85),  # Encke Gap
    (133_752, 0.55, 0.85),
    (136_512, 0.01, 0.85),  # Keeler Gap
    (136_548, 0.50, 0.85),
)
_OUTER = 136_775  # [km]


def ring_profile(name: str, seed: int, color: tuple[float, ...], count: int) -> np.ndarray:
    """Red, green, blue as displayed and opacity within 0…1 at places from the inner to the outer edge, shape (count, 4)."""
    share = (np.arange(count) + 0.5) / count
    depth, brightness = _saturn(share) if name == "saturn" else _bands(share, np.random.default_rng([seed, 29]))
    shown = np.clip(brightness[:, None] * np.array(color), 0.0, 1.0)
    return np.concatenate([shown, 1.0 - np.exp(-depth)[:, None]], axis=1)


def _saturn(share: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Optical depths and brightnesses of the main rings, with finer ringlets in each."""
    first, depth, brightness = np.array(_SECTIONS).T
    radius = first[0] + share * (_OUTER - first[0])
    section = np.searchsorted(first, radius, side="right") - 1
    grain = _ripple(share, np.random.default_rng(6), (40, 90, 200))
    return depth[section] * np.exp(0.45 * grain), brightness[section] * (1.0 + 0.08 * grain)


def _bands(share: np.ndarray, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Broad bands with ringlets in them and some gaps; edges fade."""
    broad, fine = _ripple(share, random, (6, 13)), _ripple(share, random, (50, 120))
    depth = 0.9 * np.exp(1.1 * broad + 0.5 * fine)
    for middle in random.uniform(0.1, 0.95, 3):
        depth = depth * np.clip(np.abs(share - middle) / random.uniform(0.006, 0.02), 0.02, 1.0) ** 2
    edge = np.clip(np.minimum(share / 0.06, (1.0 - share) / 0.02), 0.0, 1.0)
    return depth * edge, np.clip(0.85 + 0.12 * broad + 0.06 * fine, 0.0, 1.1)


def _ripple(share: np.ndarray, random: np.random.Generator, counts: tuple[int, ...]) -> np.ndarray:
    """A sum of interpolated random numbers at these counts of places, about 0 and mostly within −1…1."""
    parts = [np.interp(share, np.linspace(0.0, 1.0, count), random.uniform(-1.0, 1.0, count)) for count in counts]
    return np.asarray(sum(part * 0.7**k for k, part in enumerate(parts)))
