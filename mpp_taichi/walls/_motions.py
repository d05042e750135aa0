"""Formulas of the time in kernels of walls, and the displacement of a surface and its rate."""

from typing import Any

import taichi as ti

from mpp_taichi.arithmetic.formula_steps import KernelArithmetic
from mpp_taichi.arithmetic.traced import traced


@traced
def motion_of(surface: Any, time: Any) -> list[Any]:
    """Displacement [length] and its rate [length / time] at a time, component after component."""
    return [ti.cast(each, float) for each in at_time(surface.motion.motion, time)]


def at_time(program: Any, time: Any) -> list[Any]:
    """The results of a program of the time alone."""
    return list(program.run(KernelArithmetic, {name: ti.cast(time, float) for name in program.names}, 1.0))
