"""Functions through points in kernels: the points lie in fields, and the interval of a number is found by its place.

Of points at equal distances the interval is computed, of others it is found by halving the list, in log₂ n steps.
"""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.arithmetic.point_function import HIGHEST_DERIVATIVE, PointFunction, falling
from mpp_taichi.arithmetic.traced import entry_of, traced
from mpp_taichi.types import Template

EVEN = 4.0
"""In roundings of the largest |x|: how far from equal distances the points may be and count as even. An x that is so near to a
point may be given to the interval beside it, whose cubic continues the curve with the same f, f′ and f″."""


@dataclass(frozen=True, eq=False)
class PointFields:
    """The points of one function on the device.

    x            x_k, and behind the last a number that is none
    coefficients c₀ to c₃ of each interval, one after the other: kernels in explicit vectors misread fields of vectors
    """

    program: Any
    x: Any
    coefficients: Any
    step: float
    count: int
    repeats: bool
    first: float
    last: float
    slack: float


_fields: dict[tuple[PointFunction, str], PointFields] = {}


def provide(functions: Iterable[PointFunction]) -> None:
    """Put the points of functions on the device that runs, before a kernel that calls them is compiled."""
    runtime = ti.lang.impl.get_runtime()
    for function in functions:
        known = _fields.get(_key(function))
        if known is None or known.program is not runtime.prog:
            _fields[_key(function)] = _made(function, runtime.prog)


def _key(function: PointFunction) -> tuple[PointFunction, str]:
    """A function and the precision of its numbers; Taichi makes a new object for its type each time."""
    return function, str(ti.lang.impl.current_cfg().default_fp)


def _made(function: PointFunction, program: Any) -> PointFields:
    x, coefficients = ti.field(float, len(function.x) + 1), ti.field(float, function.coefficients.size)
    kind = np.float32 if ti.lang.impl.current_cfg().default_fp == ti.f32 else np.float64
    x.from_numpy(np.append(function.x, np.nan).astype(kind))
    coefficients.from_numpy(function.coefficients.ravel().astype(kind))
    step = float(np.diff(function.x).mean())
    off = np.abs(function.x - (function.x[0] + step * np.arange(len(function.x)))).max()
    even = bool(off <= EVEN * np.finfo(float).eps * np.abs(function.x).max())
    return PointFields(
        program,
        x,
        coefficients,
        step if even else 0.0,
        len(function.x),
        function.repeats,
        float(function.x[0]),
        float(function.x[-1]),
        function.slack,
    )


@traced
def through_points(function: PointFunction, derivative: int, x: Any) -> Any:
    """A derivative of a function at x; no number outside of its points."""
    fields = _fields[_key(function)]
    place = ti.lang.impl.expr_init(x)
    if fields.repeats:
        span = fields.last - fields.first
        place = ti.lang.impl.expr_init(place - span * ti.floor((place - fields.first) / span))
    k = ti.lang.impl.expr_init(interval(fields, place))
    d = ti.lang.impl.expr_init(place - entry_of(fields.x, k))
    begin = (HIGHEST_DERIVATIVE + 1) * k
    value = falling(HIGHEST_DERIVATIVE, derivative) * entry_of(fields.coefficients, begin + HIGHEST_DERIVATIVE)
    for power in range(HIGHEST_DERIVATIVE - 1, derivative - 1, -1):
        value = value * d + falling(power, derivative) * entry_of(fields.coefficients, begin + power)
    if fields.repeats:
        return value
    inside = (place >= fields.first - fields.slack) & (place <= fields.last + fields.slack)
    return ti.select(inside, value, entry_of(fields.x, fields.count))


@ti.func
def interval(fields: Template, place):
    """The number of the interval in which a place is; of a place outside of the points, the first or the last."""
    low = 0
    if ti.static(fields.step > 0.0):
        # Clamped as a floating-point number, since a number beyond the integers has no integer.
        most = ti.static(float(fields.count - 2))
        low = ti.cast(ti.min(ti.max((place - fields.first) / fields.step, 0.0), most), ti.i32)
    else:
        high = fields.count - 1
        for _ in range(ti.static(math.ceil(math.log2(max(fields.count - 1, 1))))):
            middle = (low + high) // 2
            if fields.x[middle] <= place:
                low = middle
            else:
                high = middle
    return low
