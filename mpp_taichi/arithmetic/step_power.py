"""Step power: x^p for the length of a step, on devices too that have no powers of numbers in f64."""

import taichi as ti

from mpp_taichi.types import Template

ROOTS = 3  # square roots taken first: the eighth root of every number in f64 is in the range of f32


@ti.func
def step_power(x, exponent: Template):
    """x^exponent, x ≥ 0 and |exponent| ≤ 1; where x = 0 and the exponent is negative, infinity.

    CPUs and CUDA raise in the precision of x. Vulkan raises in f32 only: there (x^(1/8))^(8 exponent) in f32, to a relative
    error of some 10⁻⁶. The length of a step needs no more digits, and the step then has this length to all digits of f64.
    """
    result = x
    if ti.static(_raises_in_single_only()):
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


def _raises_in_single_only() -> bool:
    """Whether the device that kernels are compiled for raises numbers to powers in f32 only."""
    return bool(ti.lang.impl.current_cfg().arch == ti.vulkan)
