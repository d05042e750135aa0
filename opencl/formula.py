"""The law of a force that is a formula, as text of a kernel: the steps that NumPy and Taichi compute (scene/formulas/)."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from .program import definition

OPERATORS = ("+", "-", "*", "/")
MOST = 31
"""Formulas of one kind in a scene: which springs or particles have each is one bit of a whole number of 32 bits with a sign."""
FUNCTIONS = {"root": "sqrt", "abs": "fabs"}
"""Steps that OpenCL calls by another name; it has the others by the same names."""


def steps_text(program: Any, precision: str) -> str:
    """FORMULA_STEPS(T) for numbers or vectors of a type T: the result of a program of one name, u.

    ValueError where a number of the formula is beyond the precision.
    """
    lines, result = steps_of(program, precision)
    return macro("FORMULA_STEPS(T)", [*lines, f"return {result};"])


def steps_of(program: Any, precision: str) -> tuple[list[str], str]:
    """The statements that compute a program, and the name of its first result, for numbers or vectors of a type T.

    ValueError where a number of the formula is beyond the precision, and where it calls a function through points.
    """
    lines, results = results_of(program, precision)
    return lines, results[0]


def results_of(program: Any, precision: str) -> tuple[list[str], list[str]]:
    """The same, with the names of all results."""
    if program.points:
        raise ValueError("it calls a function through points")
    lines = [f"const T s{place} = {_value(step, precision)};" for place, step in enumerate(program.steps)]
    return lines, [f"s{place}" for place in program.results]


def macro(head: str, lines: Sequence[str]) -> str:
    """The definition of a macro of several lines."""
    return f"#define {head} \\\n    " + " \\\n    ".join(lines) + "\n"


def bits(parts: Sequence[Any], count: int) -> np.ndarray:
    """The formulas that act on each of `count` springs or particles: bit n for formula n, whose `inside` is None for all."""
    found = np.zeros(count, np.int32)
    for number, part in enumerate(parts):
        found |= np.int32(1 << number) * (np.ones(count, bool) if part.inside is None else part.inside)
    return found


def _value(step: tuple[Any, ...], precision: str) -> str:
    operation, *arguments = step
    if operation == "number":
        return _number(arguments[0], precision)
    if operation == "name":
        return str(arguments[0])
    if operation == "power":
        return f"pow(s{arguments[0]}, {_number(arguments[1], precision)})"
    names = [f"s{each}" for each in arguments]
    if operation in OPERATORS:
        return f" {operation} ".join(names)
    if operation == "chosen":  # of vectors component by component
        return f"{names[0]} > (T)(0) ? {names[1]} : {names[2]}"
    return f"{FUNCTIONS.get(operation, operation)}({names[0]})"


def _number(value: float, precision: str) -> str:
    text = definition(value, precision)
    if not math.isfinite(value) or "inf" in text:
        raise ValueError(f"{value:g} is no number of {precision}")
    return f"(T){text}"
