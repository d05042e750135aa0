"""Double-single numbers in kernels: a number is high + low of two f32 (see kernel_number.py).

Relative errors in u² = 2⁻⁴⁸, where no number is below 2⁻⁷⁸ (low_parts.py):

    sum         3 u²     of the result, also where both terms nearly cancel; by +=, 2 u² of the larger term
    product     7 u²
    quotient   10 u²
    roots       4 u²     one Newton step from the f32 root, in the form of Karp and Markstein

Source: Dekker, Numer. Math. 18 (1971) 224; Knuth, The Art of Computer Programming 2, §4.2.2; Karp & Markstein, ACM Trans. Math.
Softw. 23 (1997) 561; Hida, Li & Bailey, Proc. 15th IEEE Symp. Computer Arithmetic (2001) 155; Joldes, Muller & Popescu, ACM
Trans. Math. Softw. 44 (2017) 15res, algorithms 6 and 10, whose bounds these are.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.arithmetic.kernel_number import KernelNumber, NumberVector
from mpp_taichi.arithmetic.low_parts import quick_two_sum, rounded, split, two_product, two_sum
from mpp_taichi.types import Template


@ti.func
def sum_of(state: Template, a, a_low, b, b_low):
    """Both parts of (a + a_low) + (b + b_low)."""
    high, error = two_sum(state, a, b)
    low, low_error = two_sum(state, a_low, b_low)
    total, rest = quick_two_sum(state, high, error + low)
    return quick_two_sum(state, total, rest + low_error)


@ti.func
def accumulated_of(state: Template, a, a_low, b, b_low):
    """Both parts of (a + a_low) + (b + b_low) with an error of 2 u² of the larger term: half the work of `sum_of`."""
    high, error = two_sum(state, a, b)
    return quick_two_sum(state, high, error + (a_low + b_low))


@ti.func
def product_of(state: Template, a, a_low, b, b_low):
    """Both parts of (a + a_low) (b + b_low)."""
    high, error = two_product(state, a, b)
    return quick_two_sum(state, high, error + (a * b_low + a_low * b))


@ti.func
def quotient_of(state: Template, a, a_low, b, b_low):
    """Both parts of (a + a_low) / (b + b_low)."""
    first = rounded(state, a / b)
    product, error = two_product(state, first, b)
    rest = ((a - product) - error) + (a_low - first * b_low)
    return quick_two_sum(state, first, rest / b)


@ti.func
def root_of(state: Template, a, a_low):
    """Both parts of √(a + a_low), and 0 for 0."""
    first = rounded(state, ti.sqrt(a))
    square, error = two_product(state, first, first)
    rest = ((a - square) - error) + a_low
    return quick_two_sum(state, first, ti.select(first > 0, rest / (first + first), ti.cast(0, ti.f32)))


@ti.func
def inverse_root_of(state: Template, a, a_low):
    """Both parts of y = 1/√(a + a_low): a step of third order, y (1 + r/2 + 3r²/8) with r = 1 − a y²."""
    estimate = ti.sqrt(a)
    one = ti.cast(1, ti.f32)
    first = rounded(state, one / estimate)
    root, root_error = two_product(state, first, a)
    unity, error = two_product(state, root, first)
    rest = (one - unity) - (error + first * (root_error + first * a_low))
    return quick_two_sum(state, first, first * rest * (ti.cast(0.5, ti.f32) + ti.cast(0.375, ti.f32) * rest))


class DoubleSingle(KernelNumber):
    """A number of two parts in a kernel; `state` says whether roundings are guarded (low_parts.py)."""

    def __init__(self, state: Any, high: Any, low: Any) -> None:
        """Name two expressions; a number that is to be assigned to has variables or entries of fields."""
        self.state, self.high, self.low = state, high, low

    def lifted(self, other: Any) -> Any:
        """A constant in two parts."""
        return other if isinstance(other, DoubleSingle) else constant(self.state, other)

    def plus(self, other: Any) -> Any:
        """The sum, exact to 3 u²."""
        return self._with(sum_of, other)

    def minus(self, other: Any) -> Any:
        """The difference, exact to 3 u²."""
        return _made(self.state, sum_of(self.state, self.high, self.low, -other.high, -other.low))

    def times(self, other: Any) -> Any:
        """The product."""
        return self._with(product_of, other)

    def over(self, other: Any) -> Any:
        """The quotient."""
        return self._with(quotient_of, other)

    def accumulated(self, other: Any) -> Any:
        """The sum, with an error of 2 u² of the larger term."""
        return self._with(accumulated_of, other)

    def where(self, condition: Any, other: Any) -> Any:
        """Self where a condition holds, else other."""
        other = self.lifted(other)
        parts = ti.select(condition, self.high, other.high), ti.select(condition, self.low, other.low)
        return _made(self.state, parts)

    def root(self) -> Any:
        """√self."""
        return _made(self.state, root_of(self.state, self.high, self.low))

    def inverse_root(self) -> Any:
        """1/√self."""
        return _made(self.state, inverse_root_of(self.state, self.high, self.low))

    @property
    def main(self) -> Any:
        """The high part."""
        return self.high

    def copied(self) -> Any:
        """Both parts in new variables."""
        return _made(self.state, (self.high, self.low))

    def __neg__(self) -> Any:
        """−self."""
        return _made(self.state, (-self.high, -self.low))

    def _with(self, operation: Any, other: Any) -> Any:
        return _made(self.state, operation(self.state, self.high, self.low, other.high, other.low))

    def _assign(self, other: Any) -> None:
        other = self.lifted(other)
        self.high._assign(other.high)
        self.low._assign(other.low)


def _made(state: Any, parts: Sequence[Any]) -> DoubleSingle:
    """A number in two new variables of the kernel."""
    high, low = parts
    return DoubleSingle(state, ti.lang.impl.expr_init(high), ti.lang.impl.expr_init(low))


def constant(state: Any, number: float) -> DoubleSingle:
    """A number that is known when the kernel is compiled; TypeError for an expression, which has one part only."""
    if not isinstance(number, (int, float)):
        raise TypeError("a number of one part meets a double-single number")
    high, low = split(np.array(float(number)))
    # Guarded as well: a compiler for Vulkan drops the low part where a constant is added to zeros, as a uniform field is.
    return _made(state, [rounded(state, ti.lang.expr.make_constant_expr(float(part), ti.f32)) for part in (high, low)])


def zeros(state: Any) -> NumberVector:
    """A vector of zeros in new variables, to be added to."""
    return NumberVector(constant(state, 0.0) for _ in range(state.dimensions))
