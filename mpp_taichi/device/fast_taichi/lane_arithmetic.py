"""Arithmetic of whole vector registers: two operations of a CPU for which Taichi has no function.

Taichi never joins a product and a sum into one instruction, though the CPU has such an instruction, and Taichi has no fast
inverse root. Here both are Taichi functions. In explicit vectors (explicit_vectors.py) of a whole register they call a few
lines of LLVM (lane_arithmetic.ll), which become part of the kernel and are optimised with it; the pair sum then takes a third
less time. For other vectors, and on other systems, both are written out in Taichi. Hence the bits of sums in lanes depend on
the kind of processor, never on the number of threads.
"""

from pathlib import Path
from typing import Any

import taichi as ti

from mpp_taichi.device.fast_taichi import bitcode, switch

VECTOR_BYTES = 64  # one AVX-512 register; two are 4–9 % faster in f32 and equal in f64, for twice the compile time
SOURCE = Path(__file__).with_suffix(".ll")


def in_hardware(lanes: int) -> bool:
    """Whether the kernel that is compiled now calls LLVM for vectors of this number of lanes."""
    config = ti.lang.impl.current_cfg()
    if config.real_matrix_scalarize or not bitcode.on_linux_x64() or not switch.is_on("lane_arithmetic"):
        return False
    return lanes * (4 if config.default_fp == ti.f32 else 8) == VECTOR_BYTES


def _has_inverse_root(lanes: int, exact: bool) -> bool:
    """Whether LLVM computes the inverse root: in f32 a rough root only, in f64 an exact root if there is AVX-512."""
    single = ti.lang.impl.current_cfg().default_fp == ti.f32
    return in_hardware(lanes) and (not exact if single else bitcode.has_avx512())


def _call(name: str, *variables: Any) -> None:
    """Make the kernel that is compiled call a function with pointers to local vectors; the last vector gets the result."""
    kind, suffix = (ti.f32, "f32") if ti.lang.impl.current_cfg().default_fp == ti.f32 else (ti.f64, "f64")
    for variable in variables:  # of a shorter vector LLVM would read past the end
        if variable.element_type() != kind or variable.get_shape() != (VECTOR_BYTES // (4 if kind == ti.f32 else 8),):
            raise TypeError(
                f"{name} takes vectors of a whole register, not {variable.get_shape()} of {variable.element_type()}"
            )
    bitcode.call(SOURCE, f"{name}_{suffix}", *variables)


def _smallest_root() -> float:
    """A lower bound for the roots of positive normal numbers; the third power of its inverse is infinite."""
    return 2.0**-63 if ti.lang.impl.current_cfg().default_fp == ti.f32 else 2.0**-511


@ti.func
def multiply_add(a, b, c):
    """a b + c for vectors of lanes; rounded once where the processor can."""
    result = c
    if ti.static(in_hardware(c.n)):
        x, y, z = a, b, c
        ti.static(_call("multiply_add", x, y, z, result))
    else:
        result = a * b + c
    return result


@ti.func
def inverse_roots(a, b, exact: ti.template()):  # type: ignore[valid-type]
    """1/√a and 1/√b for vectors of lanes of positive normal numbers: to 2e-7 in f32 unless `exact`, else to round-off.

    Written out, the results are b'/(a' b') and a'/(a' b') with the roots a' and b': one division serves both.
    """
    first, second = a, b
    if ti.static(_has_inverse_root(a.n, exact)):
        x, y = a, b
        ti.static(_call("inverse_sqrt", x, first))
        ti.static(_call("inverse_sqrt", y, second))
    else:  # a 0 in one vector must not spoil the other vector
        smallest = ti.static(_smallest_root())
        x, y = ti.max(ti.sqrt(a), smallest), ti.max(ti.sqrt(b), smallest)
        both = 1.0 / (x * y)
        first = both * y
        second = both * x
    return first, second
