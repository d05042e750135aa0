"""The unit step of a number or of each lane of a vector, without a comparison, which explicit vectors do not have."""

import taichi as ti

from mpp_taichi.arithmetic.traced import traced

STEEP = {"f32": 2.0**60, "f64": 2.0**200}
"""The slope of the ramp that stands for the step. Numbers between 0 and the inverse slope would get less than 1."""


@traced
def unit_step(value):
    """1 where a value is above 0, else 0; the value is not between 0 and 1/STEEP, and its product with STEEP is finite."""
    steep = STEEP["f32" if ti.lang.impl.current_cfg().default_fp == ti.f32 else "f64"]
    return ti.min(ti.max(value * steep, 0.0), 1.0)
