"""Rough functions: powers and exponentials that may have few digits, on devices too that have none in f64.

Vulkan has them in f32 only, and Taichi ends the program where a kernel asks for more. Where a number only chooses, such as the
length of a step or the opening of a node of a tree, six digits are enough.
"""

import taichi as ti

from mpp_taichi.types import Template

ROOTS = 3  # square roots taken first: the eighth root of every number in f64 is in the range of f32


@ti.func
def rough_power(x, exponent: Template):
    """x^exponent, x ≥ 0 and |exponent| ≤ 2; where x = 0 and the exponent is negative, infinity.

    CPUs and CUDA raise in the precision of x. Vulkan computes (x^(1/8))^(8 exponent) in f32, to some 3 + 2 |log₂ of the result|
    roundings of f32, and gives 0 or infinity where the result is no number of f32.
    """
    result = x
    if ti.static(_is_single_only()):
        root = x
        for _ in ti.static(range(ROOTS)):
            root = ti.sqrt(root)
        if root > 0.0:
            result = ti.pow(ti.cast(root, ti.f32), ti.cast(ti.static(2.0**ROOTS * exponent), ti.f32))
        elif ti.static(exponent < 0.0):
            result = ti.math.inf
    else:
        result = ti.pow(x, ti.static(exponent))
    return result


@ti.func
def rough_exponential(x):
    """e^x in the precision of x on CPUs and CUDA; on Vulkan in f32, to some 3 + 3 |x| roundings of f32, and 0 below −87."""
    result = x
    if ti.static(_is_single_only()):
        result = ti.exp(ti.cast(x, ti.f32))
    else:
        result = ti.exp(x)
    return result


def _is_single_only() -> bool:
    """Whether the device that kernels are compiled for has these functions in f32 only."""
    return bool(ti.lang.impl.current_cfg().arch == ti.vulkan)
