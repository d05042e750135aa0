"""Arithmetic of whole vector registers: what a CPU does in one instruction, and Taichi has no word for.

Taichi never joins a product and a sum, though the CPU does, and has no fast inverse root. Both are Taichi functions here,
which in explicit vectors (explicit_vectors.py) of a whole register call a few lines of LLVM (lane_arithmetic.ll), put into the
kernel and optimised with it: a third off the pair sum. Anywhere else, and in other vectors, they are
written out. The bits of sums in lanes thus depend on the kind of processor, never on threads.
"""

from pathlib import Path
from typing import Any

import taichi as ti

from mpp_taichi.device.fast_taichi import bitcode

VECTOR_BYTES = 64  # one AVX-512 register; two are 4–9 % faster in f32 and equal in f64, for twice the compile time
SOURCE = Path(__file__).with_suffix(".ll")


def in_hardware(lanes: int) -> bool:
    """Whether the kernel that is compiled now calls LLVM for vectors of so many lanes."""
    config = ti.lang.impl.current_cfg()
    if config.real_matrix_scalarize or not bitcode.on_linux_x64():
        return False
    return lanes * (4 if config.default_fp == ti.f32 else 8) == VECTOR_BYTES


def _has_inverse_root(lanes: int, exact: bool) -> bool:
    """In f32 it is not exact, in f64 it is, where the processor has one to begin with."""
    single = ti.lang.impl.current_cfg().default_fp == ti.f32
    return in_hardware(lanes) and (not exact if single else bitcode.has_avx512())


def _call(name: str, *variables: Any) -> None:
    """Have the kernel that is compiled call a function with pointers to local vectors of it; the last one gets the result."""
    kind, suffix = (ti.f32, "f32") if ti.lang.impl.current_cfg().default_fp == ti.f32 else (ti.f64, "f64")
    for variable in variables:  # LLVM would read past the end of anything else
        if variable.element_type() != kind or variable.get_shape() != (VECTOR_BYTES // (4 if kind == ti.f32 else 8),):
            raise TypeError(
                f"{name} takes vectors of a whole register, not {variable.get_shape()} of {variable.element_type()}"
            )
    bitcode.call(SOURCE, f"{name}_{suffix}", *variables)


def _smallest_root() -> float:
    """Of normal numbers; the third power of its inverse is infinite."""
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
    """1/√a and 1/√b for vectors of lanes, of positive normal numbers; to 2e-7 in f32 unless `exact`, else to round-off.

    Written out it is b'/(a' b') and a'/(a' b') with the roots a' and b': one division for both.
    """
    first, second = a, b
    if ti.static(_has_inverse_root(a.n, exact)):
        x, y = a, b
        ti.static(_call("inverse_sqrt", x, first))
        ti.static(_call("inverse_sqrt", y, second))
    else:  # a 0 in one is not to spoil the other
        smallest = ti.static(_smallest_root())
        x, y = ti.max(ti.sqrt(a), smallest), ti.max(ti.sqrt(b), smallest)
        both = 1.0 / (x * y)
        first = both * y
        second = both * x
    return first, second
