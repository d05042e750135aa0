"""Double-single numbers in kernels: a number is high + low of two f32, and has the operators of a number.

A formula that only adds, subtracts, multiplies and divides is one text for numbers of one part and of two parts: Taichi applies
the operators of Python, which are those of the classes below where a value has two parts. For roots, choices and constants a
formula calls force_numbers.py.

Relative errors in u² = 2⁻⁴⁸, where no number is below 2⁻⁷⁸ (low_parts.py):

    sum         3 u²     of the result, also where both terms nearly cancel; by +=, 2 u² of the larger term
    product     7 u²
    quotient   10 u²
    roots       4 u²     one Newton step from the f32 root, in the form of Karp and Markstein

A result is a new local variable of the kernel. `x = y` gives a second name to a number and does not copy it, so a formula must
not assign to x or y afterwards; results of operators and `zeros` may be assigned to.
Source: Dekker, Numer. Math. 18 (1971) 224; Knuth, The Art of Computer Programming 2, §4.2.2; Karp & Markstein, ACM Trans. Math.
Softw. 23 (1997) 561; Hida, Li & Bailey, Proc. 15th IEEE Symp. Computer Arithmetic (2001) 155; Joldes, Muller & Popescu, ACM
Trans. Math. Softw. 44 (2017) 15res, algorithms 6 and 10, whose bounds these are.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.arithmetic.low_parts import quick_two_sum, rounded, split, two_product, two_sum
from mpp_taichi.arithmetic.traced import traced
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


class DoubleSingle:
    """A number of two parts in a kernel; `state` says whether roundings are guarded (low_parts.py)."""

    _data_oriented = True  # Taichi passes such objects on as they are

    def __init__(self, state: Any, high: Any, low: Any) -> None:
        """Name two expressions; a number that is to be assigned to has variables or entries of fields."""
        self.state, self.high, self.low = state, high, low

    def __add__(self, other: Any) -> Any:
        """Self + other; adding the constant 0, as a softening of 0, takes no work."""
        return self if isinstance(other, (int, float)) and other == 0 else self._with(sum_of, other)

    def __sub__(self, other: Any) -> Any:
        """Self − other."""
        other = self._lifted(other)
        return _made(self.state, sum_of(self.state, self.high, self.low, -other.high, -other.low))

    def __mul__(self, other: Any) -> Any:
        """Self × other, where other is a number or a vector."""
        return NotImplemented if isinstance(other, DoubleSingleVector) else self._with(product_of, other)

    def __truediv__(self, other: Any) -> Any:
        """Self / other."""
        return self._with(quotient_of, other)

    def __radd__(self, other: Any) -> Any:
        """Other + self."""
        return self._lifted(other) + self

    def __rsub__(self, other: Any) -> Any:
        """Other − self."""
        return self._lifted(other) - self

    def __rmul__(self, other: Any) -> Any:
        """Other × self."""
        return self._lifted(other) * self

    def __rtruediv__(self, other: Any) -> Any:
        """Other / self."""
        return self._lifted(other) / self

    def __neg__(self) -> Any:
        """−self."""
        return _made(self.state, (-self.high, -self.low))

    def __gt__(self, other: float) -> Any:
        """Self > other, where other is 0."""
        return self._sign(other) > 0.0

    def __ne__(self, other: object) -> Any:
        """Self ≠ other, where other is 0."""
        return self._sign(other) != 0.0

    def where(self, condition: Any, other: Any) -> Any:
        """Self where a condition holds, else other."""
        other = self._lifted(other)
        parts = ti.select(condition, self.high, other.high), ti.select(condition, self.low, other.low)
        return _made(self.state, parts)

    def _with(self, operation: Any, other: Any) -> Any:
        other = self._lifted(other)
        return _made(self.state, operation(self.state, self.high, self.low, other.high, other.low))

    def _lifted(self, other: Any) -> Any:
        return other if isinstance(other, DoubleSingle) else constant(self.state, other)

    def _sign(self, other: object) -> Any:
        if other != 0.0:
            raise TypeError("a double-single number is compared with 0 only")
        return self.high

    # Names that Taichi calls for assignments

    def _assign(self, other: Any) -> None:
        other = self._lifted(other)
        self.high._assign(other.high)
        self.low._assign(other.low)

    def _augassign(self, other: Any, operator: str) -> None:
        self._assign(AUGMENTED[operator](self, self._lifted(other)))


class DoubleSingleVector:
    """A vector of double-single numbers in a kernel."""

    _data_oriented = True

    def __init__(self, components: Any) -> None:
        """Name the components."""
        self.components = tuple(components)
        self.n = len(self.components)

    def __getitem__(self, k: int) -> DoubleSingle:
        """One component."""
        return self.components[k]

    def __add__(self, other: Any) -> Any:
        """Self + other, both vectors."""
        return DoubleSingleVector(a + b for a, b in zip(self.components, other.components, strict=True))

    def __sub__(self, other: Any) -> Any:
        """Self − other, both vectors."""
        return DoubleSingleVector(a - b for a, b in zip(self.components, other.components, strict=True))

    def __mul__(self, factor: Any) -> Any:
        """Self × number."""
        return DoubleSingleVector(each * factor for each in self.components)

    def __rmul__(self, factor: Any) -> Any:
        """Number × self."""
        return self * factor

    def __neg__(self) -> Any:
        """−self."""
        return DoubleSingleVector(-each for each in self.components)

    @traced
    def dot(self, other: Any) -> Any:
        """Inner product."""
        total = self[0] * other[0]
        for k in range(1, self.n):
            total = accumulated(total, self[k] * other[k])
        return total

    def _assign(self, other: Any) -> None:
        for k in range(self.n):
            self[k]._assign(other[k])

    def _augassign(self, other: Any, operator: str) -> None:
        for k in range(self.n):
            self[k]._augassign(other[k], operator)


def accumulated(a: DoubleSingle, b: DoubleSingle) -> DoubleSingle:
    """a + b in a sum of several terms."""
    return _made(a.state, accumulated_of(a.state, a.high, a.low, b.high, b.low))


AUGMENTED = {"Add": accumulated, "Sub": lambda a, b: accumulated(a, -b), "Mult": lambda a, b: a * b}
"""The operators of += and its like, by Taichi's names."""


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


def root_of_number(number: DoubleSingle) -> DoubleSingle:
    """√number."""
    return _made(number.state, root_of(number.state, number.high, number.low))


def inverse_of_root(number: DoubleSingle) -> DoubleSingle:
    """1/√number."""
    return _made(number.state, inverse_root_of(number.state, number.high, number.low))


def zeros(state: Any) -> DoubleSingleVector:
    """A vector of zeros in new variables, to be added to."""
    return DoubleSingleVector(constant(state, 0.0) for _ in range(state.dimensions))
