"""Motions of walls in kernels: the displacement of a surface and its rate as the formulas of the scene say."""

from typing import Any

import taichi as ti

from mpp_taichi.arithmetic.formula_steps import KernelArithmetic
from mpp_taichi.arithmetic.traced import traced


@traced
def motion_of(surface: Any, time: Any) -> list[Any]:
    """Displacement [length] and its rate [length / time] at a time, component after component."""
    program = surface.motion.motion  # of the time alone
    found = program.run(KernelArithmetic, {name: ti.cast(time, float) for name in program.names}, 1.0)
    return [ti.cast(each, float) for each in found]
