"""Low parts: the rounding error of a number, carried beside the number, so that a sum of many steps loses nothing.

A position is high + low, unevaluated, |low| ≤ half a unit in the last place of high: 48 bits from two f32. An update is

    y = c v + low,  high' = high + y,  low' = y − (high' − high)    [Kahan and Møller]

where c is a number of the step, such as the time of a drift. The product c v is known to 36 bits: with the product of a kick
rounded to 24 bits, the energy errors of clusters in f32c and ds were two to five times as large. The update loses the rounding
of y only. In a motion of frequency ω and with steps h, this rounding is smaller than the rounding of high by the factor h ω,
and it is smaller than the rounding of the forces, which are f32 of separations with low parts (ds) or without them (f32c).
Where a coordinate passes zero and |high| < |y|, the update rounds y a second time.

A compiler that may reorder sums turns (high + y) − high into y. LLVM may not do so here. Drivers that read SPIR-V may, because
Taichi does not mark operations NoContraction. On such devices the sum goes through `rounded`, an exclusive or with a zero that
only the running kernel reads; drivers see through a mere bit cast. A probe finds out whether a device needs this guard, and
whether the guard is enough (device/probes.py).
Source: Møller, BIT 5 (1965) 37 and 251; Kahan, Comm. ACM 8 (1965) 40; Dekker, Numer. Math. 18 (1971) 224.
"""

import numpy as np
import taichi as ti

from mpp_taichi.types import Template

HEAD_BITS = 12  # of the 24 of an f32: the product of two heads is exact
HEAD_MASK = -(1 << 24 - HEAD_BITS)  # keeps the head of the 32 bits of an f32


def split(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Double numbers as high and low parts, whose sum has a relative error below 2⁻⁴⁹."""
    high = values.astype(np.float32)
    with np.errstate(invalid="ignore"):  # ∞ − ∞
        return high, (values - high.astype(np.float64)).astype(np.float32)


def step_parts(numbers: list[float]) -> np.ndarray:
    """Head, of 12 significant bits, and rest of each number, (count, 2) in f32; their sum has a relative error below 2⁻³⁷."""
    fraction, exponent = np.frexp(np.array(numbers))
    head = np.ldexp(np.rint(np.ldexp(fraction, HEAD_BITS)), exponent - HEAD_BITS)
    return np.stack([head, np.array(numbers) - head], axis=1).astype(np.float32)


@ti.func
def rounded(state: Template, value):
    """The value as it was rounded. Where the device needs the guard, the compiler cannot simplify its computation."""
    result = value
    if ti.static(state.guards_rounding):
        result = ti.bit_cast(ti.bit_cast(value, ti.i32) ^ state.nothing[None], ti.f32)
    return result


@ti.func
def added(state: Template, high, low, addend):
    """(high + low) + addend, as a high and a low part again."""
    corrected = addend + low
    total = rounded(state, high + corrected)
    return total, corrected - (total - high)


@ti.func
def head_of(value):
    """The head of a number: its first 12 significant bits."""
    return ti.bit_cast(ti.bit_cast(value, ti.i32) & HEAD_MASK, ti.f32)


@ti.func
def scaled_and_added(state: Template, high, low, parts, factor):
    """(high + low) + number × factor, where `parts` holds the number as a head of 12 bits and the rest."""
    head = head_of(factor)  # 12 bits as well, so that the product of both heads is exact
    rest = parts[0] * (factor - head) + (parts[1] * factor + low)
    return added(state, high, rest, parts[0] * head)
