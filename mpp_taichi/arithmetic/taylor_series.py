"""Taylor series in several variables: the multi-indices of an order, and the derivatives of 1/ρ.

A multi-index n = (n_x, n_y, …) has the order |n| = n_x + n_y + …, and n! = n_x! n_y! …; x^n = x^n_x y^n_y ….
The derivatives D_n = ∂^n (1/ρ) with ρ² = x² + y² + … + ε² come from a recurrence over auxiliary numbers of level m,

    D_0^(m) = (−1)^m (2m − 1)!! / ρ^(2m+1),   D_(n+e_i)^(m) = x_i D_n^(m+1) + n_i D_(n−e_i)^(m+1),   D_n = D_n^(0)

(McMurchie and Davidson, J. Comput. Phys. 26 (1978) 218). The softening ε appears in ρ only.
"""

import math
from functools import cache
from itertools import product
from typing import Any

import taichi as ti

from mpp_taichi.arithmetic.traced import traced

Index = tuple[int, ...]


@cache
def indices(order: int, dimensions: int) -> tuple[Index, ...]:
    """The multi-indices up to an order, those of lower order first."""
    every = (n for n in product(range(order + 1), repeat=dimensions) if sum(n) <= order)
    return tuple(sorted(every, key=lambda n: (sum(n), tuple(-each for each in n))))


@cache
def place_of(order: int, dimensions: int) -> dict[Index, int]:
    """The place of each multi-index in `indices`."""
    return {n: k for k, n in enumerate(indices(order, dimensions))}


def added(n: Index, m: Index) -> Index:
    """n + m."""
    return tuple(a + b for a, b in zip(n, m, strict=True))


def raised(n: Index, axis: int, by: int = 1) -> Index:
    """n with one more, or fewer, along an axis."""
    return tuple(each + by * (k == axis) for k, each in enumerate(n))


def factorial(n: Index) -> float:
    """n!."""
    return float(math.prod(math.factorial(each) for each in n))


def first_axis(n: Index) -> int:
    """The first axis along which n is above 0."""
    return next(axis for axis, each in enumerate(n) if each)


@traced
def scaled_powers(x: Any, order: int) -> list[Any]:
    """x^n / n! for all multi-indices up to an order, of the components of x."""
    dimensions = len(x)
    place = place_of(order, dimensions)
    values: list[Any] = [1.0]
    for n in indices(order, dimensions)[1:]:
        axis = first_axis(n)
        values.append(ti.lang.impl.expr_init(values[place[raised(n, axis, -1)]] * x[axis] * (1.0 / n[axis])))
    return values


@traced
def derivatives(x: Any, inverse: Any, order: int) -> list[Any]:
    """D_n for all multi-indices up to an order; `inverse` is 1/ρ."""
    dimensions = len(x)
    squared = ti.lang.impl.expr_init(inverse * inverse)
    level = inverse
    start = [level]
    for m in range(1, order + 1):
        level = ti.lang.impl.expr_init(level * squared * (1.0 - 2.0 * m))
        start.append(level)
    values: dict[tuple[Index, int], Any] = {((0,) * dimensions, m): start[m] for m in range(order + 1)}
    for n in indices(order, dimensions)[1:]:
        axis = first_axis(n)
        before = raised(n, axis, -1)
        for m in range(order + 1 - sum(n)):
            value = x[axis] * values[before, m + 1]
            if before[axis] > 0:
                value = value + float(before[axis]) * values[raised(before, axis, -1), m + 1]
            values[n, m] = ti.lang.impl.expr_init(value)
    return [values[n, 0] for n in indices(order, dimensions)]
