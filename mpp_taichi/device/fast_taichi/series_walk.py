"""Gravity by series of nodes of a tree, with the numbers of several nodes in the lanes of a vector register.

Taichi would unroll the sums of a series itself, and compile them for minutes. Functions in series_walk.h do them, compiled
once for each precision and order: series_f32_6.c is series_walk.h for numbers in f32 and series of order 6.
"""

from pathlib import Path
from typing import Any

import taichi as ti

from mpp_taichi.device.fast_taichi import bitcode, switch

FOLDER = Path(__file__).parent
ORDERS = {"f32": (6,), "f64": (6, 8)}
SOURCES = tuple(FOLDER / f"series_{precision}_{order}.c" for precision, orders in ORDERS.items() for order in orders)


def can_sum() -> bool:
    """Whether the functions are for the processor and the precision of the kernels that are compiled now."""
    on = switch.is_on("series_walk") and bitcode.on_linux_x64() and bitcode.has_avx512()
    return on and ti.lang.impl.current_cfg().default_fp in (ti.f32, ti.f64)


def precision() -> str:
    """The precision of the kernels that are compiled now."""
    return "f32" if ti.lang.impl.current_cfg().default_fp == ti.f32 else "f64"


def call(order: int, function: str, *variables: Any) -> Any:
    """Make the kernel that is compiled call a function with pointers to variables; inside `ti.static`."""
    suffix = f"{precision()}_{order}"
    return bitcode.call(FOLDER / f"series_{suffix}.c", f"{function}_{suffix}", *variables)


def row_width(order: int) -> int:
    """Numbers of a row: center, scale and the moments below the order, filled up to whole groups of four."""
    return (4 + order * (order + 1) * (order + 2) // 6 + 3) // 4 * 4
