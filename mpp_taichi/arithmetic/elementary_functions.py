"""Exponentials, logarithms, sines and powers of the formulas of forces, whatever the kind of the numbers is.

A dual number takes the derivative of the function, and lanes take the function lane by lane, since explicit vectors have none.
Double-single numbers have no such functions; a scene with them is refused in df64. Vulkan has such functions in f32 only: there
an energy, which is summed in f64, takes them in f32. The functions below run while a kernel is compiled.
"""

from collections.abc import Callable
from typing import Any

import taichi as ti

from mpp_taichi.arithmetic.dual import DualNumber
from mpp_taichi.arithmetic.kernel_number import KernelNumber
from mpp_taichi.arithmetic.lanes import Lanes, vector
from mpp_taichi.arithmetic.point_function import HIGHEST_DERIVATIVE, PointFunction
from mpp_taichi.arithmetic.point_lookup import through_points
from mpp_taichi.arithmetic.traced import traced

_PLAIN: dict[str, Callable[[Any], Any]] = {
    "exp": ti.exp,
    "log": ti.log,
    "sin": ti.sin,
    "cos": ti.cos,
    "tan": ti.tan,
    "asin": ti.asin,
    "acos": ti.acos,
    "atan": lambda x: ti.atan2(x, 1.0),
    "tanh": ti.tanh,
}
# name → the derivative, from x and the value of the function
_DERIVATIVES: dict[str, Callable[[Any, Any], Any]] = {
    "exp": lambda x, value: value,
    "log": lambda x, value: 1.0 / x,
    "sin": lambda x, value: elementary("cos", x),
    "cos": lambda x, value: -elementary("sin", x),
    "tan": lambda x, value: 1.0 + value * value,
    "asin": lambda x, value: 1.0 / _root(1.0 - x * x),
    "acos": lambda x, value: -1.0 / _root(1.0 - x * x),
    "atan": lambda x, value: 1.0 / (1.0 + x * x),
    "tanh": lambda x, value: 1.0 - value * value,
}


def are_precise() -> bool:
    """Whether the device that kernels are compiled for has these functions in the precision of the run."""
    config = ti.lang.impl.current_cfg()
    return config.arch != ti.vulkan or config.default_fp == ti.f32


@traced
def elementary(name: str, x: Any) -> Any:
    """A function of one number, by its name in a formula."""
    return _applied(x, lambda plain: _PLAIN[name](_allowed(plain)), lambda inner: elementary(name, inner), _DERIVATIVES[name])


@traced
def power(x: Any, exponent: float) -> Any:
    """x^c for a number c that is not whole, x ≥ 0."""

    def slope(inner: Any, value: Any) -> Any:
        return exponent * value / inner

    return _applied(x, lambda plain: ti.pow(_allowed(plain), exponent), lambda inner: power(inner, exponent), slope)


@traced
def absolute(x: Any) -> Any:
    """|x|."""
    return x.where(x > 0.0, -x) if isinstance(x, KernelNumber) else ti.abs(x)


@traced
def at_points(function: PointFunction, derivative: int, x: Any) -> Any:
    """A derivative of a function through points."""

    def slope(inner: Any, value: Any) -> Any:
        return at_points(function, derivative + 1, inner) if derivative < HIGHEST_DERIVATIVE else 0.0

    return _applied(
        x,
        lambda plain: through_points(function, derivative, plain),
        lambda inner: at_points(function, derivative, inner),
        slope,
    )


def _applied(x: Any, plain: Callable[[Any], Any], inner: Callable[[Any], Any], slope: Callable[[Any, Any], Any]) -> Any:
    if isinstance(x, DualNumber):
        value = inner(x.value)
        value = value if isinstance(value, KernelNumber) else ti.lang.impl.expr_init(value)
        return type(x)(value) if x.change is None else type(x)(value, slope(x.value, value) * x.change).copied()
    if isinstance(x, Lanes):
        return Lanes(ti.lang.impl.expr_init(vector([plain(each) for each in x.by_lane()])))
    if isinstance(x, KernelNumber):
        raise TypeError(f"a {type(x).__name__} has no such function")
    return plain(x)


def _allowed(x: Any) -> Any:
    """A plain number in the precision in which the device has these functions."""
    return ti.cast(x, ti.f32) if ti.lang.impl.current_cfg().arch == ti.vulkan else x


def _root(x: Any) -> Any:
    return x.root() if isinstance(x, KernelNumber) else ti.sqrt(x)
