"""Steps of a program with bounds of their rounding errors, by running error analysis.

A number carries a bound of its error in units of rounding u: of a sum e_a + e_b + |a + b|, of a product |a| e_b + |b| e_a +
|a b|, of a quotient q = a/b (e_a + |q| e_b)/|b| + ROUNDINGS_OF_QUOTIENT |q|, of a function |f′| e + ROUNDINGS_OF_FUNCTION |f|.
Terms of second order in u are left out, but for those of products, e_a e_b u, and of roots: where a spring has its rest length,
(l − rest)³ and √|l − rest| have no others. Source: N. J. Higham, Accuracy and Stability of Numerical Algorithms (2002), §3.3.
"""

from typing import Any

import numpy as np

from mpp_taichi.arithmetic.point_function import PointFunction
from mpp_taichi.scene.formulas.array_steps import ON_ARRAYS

# In units of the last place of a device, of two roundings each, by the OpenCL C Specification 3.0, §7.4: a quotient 2.5, a root
# 3, exponentials, logarithms and sines 4, tangents and inverse functions 5, powers 16.
ROUNDINGS_OF_QUOTIENT = 5
ROUNDINGS_OF_ROOT = 6
ROUNDINGS_OF_FUNCTION = 10
ROUNDINGS_OF_POWER = 32
ROUNDINGS_OF_SUM = 8  # of a cubic: three products and three sums, a factor and the coefficients themselves
ROUNDINGS_OF_INTERVAL = 8  # of the number of an interval, (x − first)/step, in units of the largest |x| of the points
LARGEST_UNIT, SMALLEST_UNIT = 2.0**-24, 2.0**-53
"""Units of rounding of f32 and f64, for terms that are of another order in u than the first."""
_SLOPES = {
    "exp": lambda x, value: value,
    "log": lambda x, value: 1.0 / x,
    "sin": lambda x, value: np.cos(x),
    "cos": lambda x, value: np.sin(x),
    "tan": lambda x, value: 1.0 + value * value,
    "asin": lambda x, value: 1.0 / np.sqrt(1.0 - x * x),
    "acos": lambda x, value: 1.0 / np.sqrt(1.0 - x * x),
    "atan": lambda x, value: 1.0 / (1.0 + x * x),
    "tanh": lambda x, value: 1.0 - value * value,
    "abs": lambda x, value: 1.0,
}


class Rounded:
    """A number, or an array of numbers, and a bound of its error in units of rounding."""

    def __init__(self, value: Any, error: Any) -> None:
        """Keep both."""
        self.value, self.error = value, error

    def __add__(self, other: "Rounded") -> "Rounded":
        """The sum."""
        value = self.value + other.value
        return Rounded(value, self.error + other.error + np.abs(value))

    def __sub__(self, other: "Rounded") -> "Rounded":
        """The difference."""
        value = self.value - other.value
        return Rounded(value, self.error + other.error + np.abs(value))

    def __mul__(self, other: "Rounded") -> "Rounded":
        """The product."""
        value = self.value * other.value
        first = np.abs(self.value) * other.error + np.abs(other.value) * self.error
        return Rounded(value, first + LARGEST_UNIT * self.error * other.error + np.abs(value))

    def __truediv__(self, other: "Rounded") -> "Rounded":
        """The quotient."""
        value = self.value / other.value
        error = (self.error + np.abs(value) * other.error) / np.abs(other.value)
        return Rounded(value, error + ROUNDINGS_OF_QUOTIENT * np.abs(value))


class RoundingArithmetic:
    """The operations of a program for such numbers."""

    @staticmethod
    def number(value: float, like: Any) -> Rounded:
        """A number of the formula, which is rounded where it is stored."""
        return Rounded(value, abs(value))

    @staticmethod
    def kept(value: Any) -> Any:
        """A value that later steps use several times."""
        return value

    @staticmethod
    def root(number: Rounded) -> Rounded:
        """√x, whose error is at most √(e u) near 0."""
        value = np.sqrt(number.value)
        above = value > 0.0
        first = np.where(above, 0.5 * number.error / np.where(above, value, 1.0), np.inf)
        return Rounded(value, np.minimum(first, np.sqrt(number.error / SMALLEST_UNIT)) + ROUNDINGS_OF_ROOT * value)

    @staticmethod
    def function(name: str, number: Rounded) -> Rounded:
        """A function by its name."""
        value = ON_ARRAYS[name](number.value)
        slope = np.abs(_SLOPES[name](number.value, value))
        return Rounded(value, slope * number.error + ROUNDINGS_OF_FUNCTION * np.abs(value))

    @staticmethod
    def through_points(number: Rounded, function: PointFunction, derivative: int) -> Rounded:
        """A derivative of a function through points, whose place and coefficients are rounded where they are stored.

        Rounding in f32 may take a number that is near a point to the other side of the point, where another cubic is the curve.
        """
        x = number.value
        moved = number.error + 2.0 * np.abs(x)
        reach = 2.0 * LARGEST_UNIT * (moved + ROUNDINGS_OF_INTERVAL * np.abs(function.x).max())
        slope, jump = function.spread_around(x, derivative, reach)
        error = slope * moved + jump / SMALLEST_UNIT + ROUNDINGS_OF_SUM * function.magnitude_at(x, derivative)
        return Rounded(function.at(x, derivative), error)

    @staticmethod
    def power(number: Rounded, exponent: float) -> Rounded:
        """x^c."""
        value = np.power(number.value, exponent)
        return Rounded(value, np.abs(exponent * value / number.value) * number.error + ROUNDINGS_OF_POWER * np.abs(value))

    @staticmethod
    def chosen(condition: Rounded, one: Rounded, other: Rounded) -> Rounded:
        """One number where the condition is above 0, else the other; where rounding in f32 may decide, no error is excluded."""
        above = condition.value > 0.0
        value = np.where(above, one.value, other.value)
        undecided = np.abs(condition.value) <= 2.0**-23 * condition.error
        jump = np.where(undecided, 2.0**53 * np.abs(one.value - other.value), 0.0)
        return Rounded(value, np.where(above, one.error, other.error) + jump)
