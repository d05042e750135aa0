"""The value of a function through points (point_function.py) as an expression of SymPy, which knows its derivatives."""

from typing import Any
from weakref import WeakValueDictionary

import sympy

from mpp_taichi.arithmetic.point_function import HIGHEST_DERIVATIVE, PointFunction

_known: WeakValueDictionary[str, PointFunction] = WeakValueDictionary()


class PointValue(sympy.Function):
    """f⁽ᵏ⁾(x), of x, the number k of the derivative, and a symbol that stands for the points."""

    nargs = 3
    is_real = True

    def _eval_derivative(self, symbol: Any) -> Any:
        """f⁽ᵏ⁺¹⁾(x) dx/ds; the fourth derivative is 0, since jumps of the third are left out."""
        x, derivative, points = self.args
        inner = x.diff(symbol)
        if inner == 0 or derivative == HIGHEST_DERIVATIVE:
            return sympy.Integer(0)
        return PointValue(x, derivative + 1, points) * inner


def value_of(points: PointFunction, x: Any) -> Any:
    """f(x)."""
    _known[repr(points)] = points
    return PointValue(x, sympy.Integer(0), sympy.Symbol(repr(points)))


def parts_of(value: Any) -> tuple[Any, PointFunction, int]:
    """x, the points and the number of the derivative."""
    x, derivative, points = value.args
    return x, _known[points.name], int(derivative)
