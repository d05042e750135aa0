"""Conversion between displayed values and light.  [IEC 61966-2-1]"""

import numpy as np


def linear_from_srgb(color: np.ndarray) -> np.ndarray:
    """Light from displayed values in 0…1."""
    color = np.clip(color, 0.0, 1.0)
    return np.where(color <= 0.04045, color / 12.92, ((color + 0.055) / 1.055) ** 2.4)


def srgb_from_linear(light: np.ndarray) -> np.ndarray:
    """Displayed values in 0…1 from light."""
    light = np.clip(light, 0.0, 1.0)
    return np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1.0 / 2.4) - 0.055)
