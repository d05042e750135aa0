"""Steps of a program as expressions of a kernel, for numbers of every kind; these functions run while a kernel is compiled."""

from typing import Any

import taichi as ti

from mpp_taichi.arithmetic.double_single import DoubleSingle
from mpp_taichi.arithmetic.elementary_functions import absolute, at_points, elementary, power
from mpp_taichi.arithmetic.force_numbers import root
from mpp_taichi.arithmetic.kernel_number import KernelNumber
from mpp_taichi.arithmetic.point_function import PointFunction
from mpp_taichi.arithmetic.unit_step import unit_step


class KernelArithmetic:
    """The operations that a program asks for beside + − × ÷."""

    @staticmethod
    def number(value: float, like: Any) -> Any:
        """A constant, of the kind of another number."""
        return like.lifted(value) if isinstance(like, KernelNumber) else value

    @staticmethod
    def kept(value: Any) -> Any:
        """A variable of the kernel, so that a value that is used several times is computed once."""
        return value if isinstance(value, KernelNumber) else ti.lang.impl.expr_init(value)

    @staticmethod
    def root(value: Any) -> Any:
        """√x."""
        return root(value)

    @staticmethod
    def function(name: str, value: Any) -> Any:
        """A function by its name."""
        return absolute(value) if name == "abs" else elementary(name, value)

    @staticmethod
    def through_points(value: Any, function: PointFunction, derivative: int) -> Any:
        """A derivative of a function through points."""
        return at_points(function, derivative, value)

    @staticmethod
    def power(value: Any, exponent: float) -> Any:
        """x^c."""
        return power(value, exponent)

    @staticmethod
    def chosen(condition: Any, value: Any, other: Any) -> Any:
        """The value where the condition is above 0, else the other.

        Of vectors of lanes both must be finite, as a comparison of whole vectors is not to be had (unit_step.py).
        """
        if isinstance(condition, ti.lang.expr.Expr) and condition.is_tensor():
            step = KernelArithmetic.kept(unit_step(condition))
            return other + (value - other) * step
        above = condition > 0.0
        kinds = [each for each in (value, other) if isinstance(each, KernelNumber)]
        if not kinds:
            return ti.select(above, value, other)
        return kinds[0].lifted(value).where(above, other)


def number_like(value: Any, like: Any) -> Any:
    """A live parameter as a number of the kind of another number."""
    if isinstance(like, DoubleSingle):
        return DoubleSingle(like.state, value.high, value.low) if isinstance(value, DoubleSingle) else like.lifted(value)
    return like.lifted(value) if isinstance(like, KernelNumber) else value
