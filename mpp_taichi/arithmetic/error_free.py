"""Sums and products together with their rounding errors: result + error is the exact sum or product.

A result that is needed to more digits than a float has is computed with the errors of its parts, and rounded once at its end.
The product is split by the bits of its factors, so that a large factor does not overflow.
Source: Knuth, The Art of Computer Programming 2, §4.2.2; Dekker, Numer. Math. 18 (1971) 224.
"""

import taichi as ti


def _head_mask() -> tuple[int, object]:
    """Mask of the bits of a number's head, 12 of 24 or 26 of 53 significant bits, and the integer type of these bits."""
    if ti.lang.impl.current_cfg().default_fp == ti.f32:
        return -(1 << 12), ti.i32
    return -(1 << 27), ti.i64


@ti.func
def head(value):
    """The first half of the digits of a number, so that products of two heads are exact."""
    mask, integer = ti.static(_head_mask())
    return ti.bit_cast(ti.bit_cast(value, integer) & ti.cast(mask, integer), float)


@ti.func
def two_sum(a, b):
    """The float nearest to a + b, and its rounding error."""
    total = a + b
    part = total - a
    return total, (a - (total - part)) + (b - part)


@ti.func
def two_product(a, b):
    """The float nearest to a b, and its rounding error up to 2⁻⁵³ of this error (2⁻²³ in f32)."""
    product = a * b
    a_head, b_head = head(a), head(b)
    a_tail, b_tail = a - a_head, b - b_head
    return product, ((a_head * b_head - product) + a_head * b_tail + a_tail * b_head) + a_tail * b_tail
