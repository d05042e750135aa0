"""Python functions that a kernel calls while it is compiled."""

from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, TypeVar

import taichi as ti

Function = TypeVar("Function", bound=Callable)


def traced(function: Function) -> Function:
    """Let Taichi functions call a Python function, which returns expressions; the call runs once, at compile time.

    Taichi warns of such calls unless it takes the function for one of its own.
    """
    vars(function).update(_is_taichi_function=True, _is_real_function=False, func=SimpleNamespace(has_print=False))
    return function


def entry_of(field: Any, i: Any) -> Any:
    """field[i] or vector[i] in a kernel, as a Python function writes it."""
    return ti.lang.impl.subscript(None, field, i)
