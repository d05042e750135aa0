"""Texts in a repeat: the variable of a repeat in an expression, `0.1 * i`, and in braces within a name, `ball_{i}`."""

import re
from collections.abc import Mapping
from enum import Enum
from functools import lru_cache

from mpp_taichi.scene.expressions import Expression, ExpressionError, UnresolvedConstant, parse

_BRACES = re.compile(r"\{([^{}]*)\}")
_NAME = re.compile(r"(?<![\w.])[^\W\d]\w*")
Shifts = tuple[tuple[int, int], ...]
NO_SHIFTS: Shifts = ()


class Use(Enum):
    """What a text stands for, by the declared type of its parameter."""

    NUMBER = "an expression"
    REFERENCE = "the name of a particle, or an expression for its index"
    TEXT = "text"


USES = {
    **dict.fromkeys(("str", "Path", "Lattice"), Use.TEXT),
    **dict.fromkeys(("Particle", "Particles", "Pair", "FourInRow"), Use.REFERENCE),
}
"""Types of parameters whose texts are more than expressions."""


def filled(
    text: str, variables: Mapping[str, int], constants: Mapping[str, float | None], use: Use
) -> tuple[str | int | float, Shifts]:
    """The text with values for the variables: a number where nothing else is in it, and the shifts of `Node`.

    ExpressionError tells the character of the text as it was written.
    """
    if "{" in text:
        return _in_braces(text, {**constants, **variables})
    expression = None if use is Use.TEXT else _read(text)
    if expression is None or not expression.names & variables.keys():
        return text, ()
    if expression.names <= variables.keys():
        return plain_number(expression.number(variables)), ()
    return (text, ()) if use is Use.REFERENCE else _replaced(text, variables)


def plain_number(value: float) -> int | float:
    """A whole number as such, so that it can be an index or a part of a name."""
    return int(value) if value.is_integer() and abs(value) < 2**53 else value


@lru_cache(maxsize=4096)
def _read(text: str) -> Expression | None:
    try:
        return parse(text)
    except ExpressionError:
        return None  # where an expression is needed, the check of the parameter says why it is none


@lru_cache(maxsize=4096)
def _braced(text: str) -> tuple[tuple[int, int, Expression], ...]:
    """Beginning, end and expression of each pair of braces."""
    found = []
    for each in _BRACES.finditer(text):
        try:
            found.append((*each.span(), parse(each[1])))
        except ExpressionError as error:
            raise ExpressionError(str(error), each.start(1) + error.offset) from None
    return tuple(found)


def _in_braces(text: str, values: Mapping[str, float | None]) -> tuple[str | int | float, Shifts]:
    made, shifts, at = "", [], 0
    for begin, end, expression in _braced(text):
        try:
            number = plain_number(expression.number(values))
        except UnresolvedConstant:
            return text, ()  # the fault stands where the constant is defined
        except ExpressionError as error:
            raise ExpressionError(str(error), begin + 1 + error.offset) from None
        if (begin, end) == (0, len(text)):
            return number, ()
        made += text[at:begin] + (str(number) if isinstance(number, int) else f"{number:.12g}")
        at = end
        shifts.append((len(made), end))
    return made + text[at:], tuple(shifts)


def _replaced(text: str, variables: Mapping[str, int]) -> tuple[str, Shifts]:
    """The expression with numbers in place of the variables; other names stay, since a constant may change later."""
    made, shifts, at = "", [], 0
    for each in _NAME.finditer(text):
        if each[0] in variables:
            made += text[at : each.start()] + str(variables[each[0]])
            at = each.end()
            shifts.append((len(made), at))
    return made + text[at:], tuple(shifts)
