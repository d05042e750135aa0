"""Dimming: a picture of positions that have lost their meaning, with less contrast against its background."""

import numpy as np

from mpp_taichi.views.caption import Background

CONTRAST = 0.35  # part of the difference from the background that a dimmed colour keeps


def dim(picture: np.ndarray, background: Background) -> None:
    """Bring a picture (height, width, 3), uint8, nearer to a background, in place."""
    ground = 255.0 * np.clip(background, 0.0, 1.0)
    levels = np.arange(256.0)
    for channel in range(3):
        table = np.rint(ground[channel] + CONTRAST * (levels - ground[channel])).astype(np.uint8)
        picture[..., channel] = table[picture[..., channel]]
