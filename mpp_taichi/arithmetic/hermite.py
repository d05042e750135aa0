"""Cubic Hermite interpolation between two samples of a quantity and its rate."""

from typing import Any, TypeVar

import numpy as np

Look = tuple[float, float]  # value, rate
Values = TypeVar("Values", float, np.ndarray)


def cubic(s: Values, span: Any, before: tuple[Values, Values], after: tuple[Values, Values]) -> Values:
    """The cubic through both values and both rates, at the part s in 0…1 of the span; good to span⁴/384 times |x⁗|.

    Of arrays the cubic of each entry, by NumPy's rules for shapes.
    """
    rise = s * s * (3.0 - 2.0 * s)
    return (1.0 - rise) * before[0] + rise * after[0] + span * s * (1.0 - s) * ((1.0 - s) * before[1] - s * after[1])


def crossing(begin: float, end: float, before: Look, after: Look, *, level: float) -> float:
    """When the cubic through (value, rate) at `begin` and at `end` reaches `level`; by bisection, to the last bit.

    The two values must lie on different sides of the level, or on it.
    """
    rises = after[0] >= before[0]
    low, high = 0.0, 1.0
    while high - low > 1e-15:
        middle = 0.5 * (low + high)
        value = cubic(middle, end - begin, before, after)
        beyond = value >= level if rises else value <= level
        low, high = (low, middle) if beyond else (middle, high)
    return begin + high * (end - begin)
