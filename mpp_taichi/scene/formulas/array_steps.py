"""Steps of a program computed by NumPy, and the functions that it knows by name."""

from collections.abc import Callable
from typing import Any

import numpy as np

from mpp_taichi.arithmetic.point_function import PointFunction

ON_ARRAYS: dict[str, Callable[..., Any]] = {
    "exp": np.exp,
    "log": np.log,
    "sin": np.sin,
    "cos": np.cos,
    "tan": np.tan,
    "asin": np.arcsin,
    "acos": np.arccos,
    "atan": np.arctan,
    "tanh": np.tanh,
    "abs": np.abs,
}
"""Functions of one number; sinh and cosh are made of exponentials, and the other functions of the grammar of these."""


class ArrayArithmetic:
    """Steps of a program computed by NumPy, in the precision of the values."""

    @staticmethod
    def number(value: float, like: Any) -> Any:
        """A number in the precision of another."""
        return np.asarray(like).dtype.type(value)

    @staticmethod
    def kept(value: Any) -> Any:
        """A value that later steps use several times."""
        return value

    @staticmethod
    def root(value: Any) -> Any:
        """√x."""
        return np.sqrt(value)

    @staticmethod
    def function(name: str, value: Any) -> Any:
        """A function of `ON_ARRAYS`."""
        return ON_ARRAYS[name](value)

    @staticmethod
    def through_points(value: Any, function: PointFunction, derivative: int) -> Any:
        """A derivative of a function through points."""
        return function.at(value, derivative).astype(np.asarray(value).dtype)

    @staticmethod
    def power(value: Any, exponent: float) -> Any:
        """x^c with a number c that is not whole."""
        return np.power(value, np.asarray(value).dtype.type(exponent))

    @staticmethod
    def chosen(condition: Any, value: Any, other: Any) -> Any:
        """The value where the condition is above 0, else the other."""
        return np.where(condition > 0.0, value, other)
