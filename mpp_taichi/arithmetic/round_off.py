"""The unit round-off of the numbers that kernels compute with."""

import taichi as ti


def round_off() -> float:
    """The largest relative rounding error of a number, half of the distance between 1 and the next larger number.

    2⁻²⁴ in f32 and 2⁻⁵³ in f64, of the kernels that are compiled now; needs a started Taichi.
    """
    return 2.0**-24 if ti.lang.impl.current_cfg().default_fp == ti.f32 else 2.0**-53
