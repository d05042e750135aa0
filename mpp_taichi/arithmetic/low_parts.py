"""Low parts: the rounding error of a number, carried beside the number, so that a sum of many steps loses nothing.

A number is high + low, unevaluated, |low| ≤ half a unit in the last place of high: 48 bits from two f32. An update x += c f
works with both parts of all three numbers:

    p + e = c_high f_high exactly     [two-product: Dekker]
    s + t = x_high + p exactly        [two-sum: Knuth, Møller]
    x_high + x_low = s + (t + (e + c_low f_high + c_high f_low + x_low))

The relative error of an update is a few times 2⁻⁴⁸, of x or of c f, whichever is larger. With the product rounded to 24 bits, a
free particle moved with its velocity as rounded to f32. Numbers below 2⁻⁷⁸ have error terms that f32 has no room for.

In df64, whose forces are right to 48 bits, these roundings of x would be the largest error of a run: thousands of them in an
orbit. There the rounding of the low part is kept as well, as a third part, the rest, which goes into the next update. What is
left is a few times 2⁻⁴⁸ of c f, which is much smaller than x. Forces do not read the rest.

A compiler that may reorder sums turns (high + y) − high into y. LLVM may not do so here. Drivers that read SPIR-V may, because
Taichi does not mark operations NoContraction. On such devices the sum goes through `rounded`, an exclusive or with a zero that
only the running kernel reads; drivers see through a mere bit cast. A probe finds out whether a device needs this guard, and
whether the guard is enough (device/probes.py).
Source: Møller, BIT 5 (1965) 37 and 251; Kahan, Comm. ACM 8 (1965) 40; Knuth, The Art of Computer Programming 2, §4.2.2; Dekker,
Numer. Math. 18 (1971) 224; Joldes, Muller & Popescu, ACM Trans. Math. Softw. 44 (2017) 15res.
"""

import numpy as np
import taichi as ti

from mpp_taichi.types import Template

HEAD_BITS = 12  # of the 24 of an f32: the product of two heads, or of a head and the rest, is exact
HEAD_MASK = -(1 << 24 - HEAD_BITS)  # keeps the head of the 32 bits of an f32


def split(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Double numbers as high and low parts, whose sum has a relative error below 2⁻⁴⁹."""
    high = values.astype(np.float32)
    with np.errstate(invalid="ignore"):  # ∞ − ∞
        return high, (values - high.astype(np.float64)).astype(np.float32)


def step_parts(numbers: list[float]) -> np.ndarray:
    """High and low part of each number, (count, 2) in f32; their sum has a relative error below 2⁻⁴⁹."""
    return np.stack(split(np.array(numbers)), axis=1)


@ti.func
def rounded(state: Template, value):
    """The value as it was rounded. Where the device needs the guard, the compiler cannot simplify its computation."""
    result = value
    if ti.static(state.guards_rounding):
        result = ti.bit_cast(ti.bit_cast(value, ti.i32) ^ state.nothing[None], ti.f32)
    return result


@ti.func
def two_sum(state: Template, a, b):
    """a + b as it was rounded, and its rounding error, exactly."""
    total = rounded(state, a + b)
    of_b = rounded(state, total - a)
    return total, (a - (total - of_b)) + (b - of_b)


@ti.func
def quick_two_sum(state: Template, a, b):
    """`two_sum` for |a| ≥ |b|."""
    total = rounded(state, a + b)
    return total, b - (total - a)


@ti.func
def head_of(value):
    """The head of a number: its first 12 significant bits. What remains has 12 significant bits as well."""
    return ti.bit_cast(ti.bit_cast(value, ti.i32) & HEAD_MASK, ti.f32)


@ti.func
def two_product(state: Template, a, b):
    """a b as it was rounded, and its rounding error, exactly where |a b| is above 2⁻⁷⁸."""
    product = rounded(state, a * b)
    a_head, b_head = head_of(a), head_of(b)
    a_rest, b_rest = a - a_head, b - b_head
    # Each of these products is exact. Drivers take a common factor of two of them, whose product with the sum is not.
    heads, across = rounded(state, a_head * b_head), rounded(state, a_head * b_rest)
    back, rests = rounded(state, a_rest * b_head), rounded(state, a_rest * b_rest)
    return product, ((heads - product + across) + back) + rests


@ti.func
def added(state: Template, high, low, addend):
    """(high + low) + addend, as a high and a low part again."""
    total, error = two_sum(state, high, addend)
    return quick_two_sum(state, total, error + low)


@ti.func
def scaled_and_added(state: Template, high, low, parts, factor):
    """(high + low) + number × factor, where `parts` are the high and the low part of the number."""
    product, error = two_product(state, parts[0], factor)
    return added(state, high, (error + parts[1] * factor) + low, product)


@ti.func
def scaled_and_added_with_rest(state: Template, three: Template, parts, factor, addend):
    """The three parts of the sum of a number, of `parts` × factor and of a small addend.

    `three` are the high part, the low part and the rest of the number before, `parts` the high and the low part of the step.
    """
    product, error = two_product(state, parts[0], factor)
    total, lost = two_sum(state, three[0], product)
    low, rest = two_sum(state, three[1], lost)
    small = ((error + parts[1] * factor) + addend) + three[2]
    low_again, rest_again = two_sum(state, low, small)
    high, last = quick_two_sum(state, total, low_again)
    return high, last, rest + rest_again
