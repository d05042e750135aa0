"""Motions of walls in kernels: the displacement of a surface and its rate as the formulas of the scene say."""

from typing import Any

import taichi as ti

from mpp_taichi.arithmetic.formula_steps import KernelArithmetic
from mpp_taichi.arithmetic.traced import traced


@traced
def shift_of(surface: Any, axis: int, time: Any) -> Any:
    """Displacement of a surface along an axis at a time [length]."""
    return ti.cast(_run(surface, time)[axis], float)


@traced
def shift_rate_of(surface: Any, axis: int, time: Any) -> Any:
    """Rate of the displacement along an axis [length / time]."""
    return ti.cast(_run(surface, time)[surface.motion.dimensions + axis], float)


def _run(surface: Any, time: Any) -> Any:
    program = surface.motion.motion  # of the time alone
    return program.run(KernelArithmetic, {name: ti.cast(time, float) for name in program.names}, 1.0)
