"""From light in 0…1 to the levels that a screen is given.  [sRGB: IEC 61966-2-1]"""

import numpy as np
import taichi as ti

from mpp_taichi.types import Template
from mpp_taichi.views._single import single
from mpp_taichi.views.srgb import srgb_from_linear

ENTRIES = 4096
CURVE = (255.0 * srgb_from_linear(np.linspace(0.0, 1.0, ENTRIES))).astype(np.float32)
"""Levels 0…255 at which evenly spaced light is displayed. The curve is straight between two entries to 0.005 levels: most
above light of 0.0031, where its second derivative is 2400 · 255, by ⅛ of that and the square of 1/4095."""


@ti.func
def displayed(curve: Template, light, share):
    """The level of light, rounded up where the fractional part of the level and the `share` in 0…1 add up to 1 or more."""
    place = light * (ENTRIES - 1)
    first = ti.min(ti.max(ti.cast(place, ti.i32), 0), ENTRIES - 2)
    level = curve[first] + (place - ti.cast(first, ti.f32)) * (curve[first + 1] - curve[first])
    return ti.min(ti.cast(level + share, ti.i32), 255)


@ti.func
def dither(row, column):
    """A number in 0…1 for each pixel, the same in every frame: rounded by it, neighbouring pixels have the right mean.

    Without this dithering the slow gradients of a glow in a dark sky show as rings.
    """
    mixed = ti.cast(row * 73856093 ^ column * 19349663, ti.u32)
    mixed = (mixed ^ (mixed >> 16)) * ti.cast(0x7FEB352D, ti.u32)
    mixed = (mixed ^ (mixed >> 15)) * ti.cast(0x2C1B3C6D, ti.u32)
    return ti.cast((mixed >> 8) & 0xFFFF, ti.f32) * single(1.0 / 65536.0)
