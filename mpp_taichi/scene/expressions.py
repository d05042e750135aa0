"""Expressions in a scene, such as `sqrt(k2 / r)`: a small arithmetic, read with `ast` and walked, never executed as Python.

Allowed are numbers (all taken as floats), names, + - * / // % and ** or ^ for a power, signs and parentheses, and the functions
of FUNCTIONS.
Whatever does not give a real number (1/0, sqrt(-1), overflow) is an error at the column where it happens.
"""

import ast
import math
import operator
import re
import sys
import warnings
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from mpp_taichi.scene.did_you_mean import suggestion
from mpp_taichi.scene.faults import shown

LENGTH_ALLOWED = 1000  # characters
SMALLEST_NUMBER = sys.float_info.min
"""Numbers below it have fewer digits, and kernels take them for 0."""
NODES_ALLOWED = 300
_ANY = (1, 50)
# name → (on numbers, on arrays, (fewest, most) arguments)
FUNCTIONS: dict[str, tuple[Callable[..., Any], Callable[..., Any], tuple[int, int]]] = {
    "sqrt": (math.sqrt, np.sqrt, (1, 1)),
    "exp": (math.exp, np.exp, (1, 1)),
    "log": (math.log, np.log, (1, 1)),
    "log10": (math.log10, np.log10, (1, 1)),
    "sin": (math.sin, np.sin, (1, 1)),
    "cos": (math.cos, np.cos, (1, 1)),
    "tan": (math.tan, np.tan, (1, 1)),
    "asin": (math.asin, np.arcsin, (1, 1)),
    "acos": (math.acos, np.arccos, (1, 1)),
    "atan": (math.atan, np.arctan, (1, 1)),
    "atan2": (math.atan2, np.arctan2, (2, 2)),
    "sinh": (math.sinh, np.sinh, (1, 1)),
    "cosh": (math.cosh, np.cosh, (1, 1)),
    "tanh": (math.tanh, np.tanh, (1, 1)),
    "radians": (math.radians, np.radians, (1, 1)),
    "degrees": (math.degrees, np.degrees, (1, 1)),
    "hypot": (math.hypot, lambda *values: np.sqrt(sum(np.square(value) for value in values)), _ANY),
    "abs": (abs, np.abs, (1, 1)),
    "floor": (lambda value: float(math.floor(value)), np.floor, (1, 1)),
    "min": (lambda *values: min(values), lambda *values: np.minimum.reduce(np.broadcast_arrays(*values)), _ANY),
    "max": (lambda *values: max(values), lambda *values: np.maximum.reduce(np.broadcast_arrays(*values)), _ANY),
}
BUILT_IN = {"pi": math.pi, "tau": math.tau, "e": math.e}
RESERVED = frozenset(FUNCTIONS) | frozenset(BUILT_IN)
_BINARY: dict[type, Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.FloorDiv: operator.floordiv,
    ast.Mod: operator.mod,
    ast.Pow: operator.pow,
}
_DATE = re.compile(
    r"[0-9]{4}-[0-9]{1,2}-[0-9]{1,2}|[0-9]{1,2}-[0-9]{1,2}-[0-9]{4}"
    r"|(19|20)[0-9]{2}/[0-9]{2}/[0-9]{2}|[0-9]{2}/[0-9]{2}/(19|20)[0-9]{2}"
)
"""Year, month and day without a space, or in the other order: a date to a reader, a difference or a quotient to `ast`."""
_WITH_UNIT = re.compile(r"([-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?)\s*(%|[^\W\d_][\w/²³^*]*)")
_DECIMAL_COMMA = re.compile(r"[-+]?[0-9]+,[0-9]+")
MOST_NAMES = 12  # names that a message lists
_DIGITS = "[0-9](?:_?[0-9])*"  # an underscore stands between two digits only
_LITERAL = re.compile(rf"(?<![\w.])(?:{_DIGITS}\.?(?:{_DIGITS})?|\.{_DIGITS})(?:[eE][-+]?{_DIGITS})?")
_UNARY: dict[type, Callable[[Any], Any]] = {ast.UAdd: operator.pos, ast.USub: operator.neg}


class ExpressionError(ValueError):
    """The error in an expression, and its character (from 0)."""

    def __init__(self, message: str, offset: int = 0) -> None:
        """Keep the character beside the message."""
        self.offset = offset
        super().__init__(message)


class UnresolvedConstant(ExpressionError):
    """The expression names a constant whose own value is at fault; that fault is reported at the constant's definition."""


@dataclass(frozen=True)
class Expression:
    """A checked expression, ready to be given values for its names."""

    text: str
    tree: ast.expr

    @property
    def names(self) -> frozenset[str]:
        """The names that must be given, built-in constants left out."""
        return frozenset(self._name_offsets)

    @property
    def called(self) -> frozenset[str]:
        """The names of the functions that the expression calls."""
        calls = (node.func for node in ast.walk(self.tree) if isinstance(node, ast.Call))
        return frozenset(function.id for function in calls if isinstance(function, ast.Name))

    def check_names(self, known: Collection[str]) -> None:
        """Refuse the first name that is not known, at its column."""
        for name, offset in self._name_offsets.items():
            if name not in known:
                raise ExpressionError(f"unknown name {shown(name)}{_known_names(name, known)}", offset)

    def number(self, values: Mapping[str, float | None]) -> float:
        """The value with numbers for the names; a name whose value is None raises UnresolvedConstant."""
        self.check_names(values)
        return float(_Evaluation(self.text, values, on_arrays=False).of(self.tree))

    def array(self, values: Mapping[str, Any]) -> Any:
        """The value with arrays (or numbers) for the names, by NumPy's broadcasting."""
        self.check_names(values)
        with np.errstate(divide="raise", over="raise", invalid="raise", under="ignore"):
            return _Evaluation(self.text, values, on_arrays=True).of(self.tree)

    @cached_property
    def _name_offsets(self) -> dict[str, int]:
        found: dict[str, int] = {}
        called = {id(node.func) for node in ast.walk(self.tree) if isinstance(node, ast.Call)}
        for node in ast.walk(self.tree):
            if isinstance(node, ast.Name) and id(node) not in called and node.id not in BUILT_IN:
                offset = _offset(self.text, node)
                found[node.id] = min(offset, found.get(node.id, offset))
        return dict(sorted(found.items(), key=lambda item: item[1]))


@lru_cache(maxsize=4096)  # the members of a sweep have the same expressions
def parse(text: str, own: frozenset[str] = frozenset()) -> Expression:
    """Read an expression; ExpressionError says which part is not allowed and where it is.

    `own` are the names of functions of one number that the scene defines.
    """
    if len(text) > LENGTH_ALLOWED:
        raise ExpressionError(f"an expression of {len(text)} characters is too long, allowed: {LENGTH_ALLOWED}")
    if _DATE.fullmatch(text.strip()):
        raise ExpressionError(f"{shown(text)} is a date and no number; an expression has spaces around its operators")
    if _DECIMAL_COMMA.fullmatch(text.strip()):
        raise ExpressionError(f"{shown(text)} is no number; a decimal number has a point, as {text.strip().replace(',', '.')}")
    for number in _LITERAL.finditer(text):
        if is_lost(number[0]):
            raise ExpressionError(
                f"{shown(number[0])} is too small for a number, the least is {SMALLEST_NUMBER:.3g}", number.start()
            )
    padding = len(text) - len(text.lstrip())
    flat = text.replace("\n", " ").replace("\t", " ")
    powers = [place for place, character in enumerate(flat) if character == "^"]
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            tree = ast.parse(flat.lstrip().replace("^", "**"), mode="eval").body
    except SyntaxError as error:
        written = _as_written(max((error.offset or 1) - 1, 0), [place - padding for place in powers])
        column = min(written, max(len(text) - padding - 1, 0))
        raise ExpressionError(_not_an_expression(text), column + padding) from None
    except (ValueError, RecursionError, MemoryError, OverflowError):
        raise ExpressionError(f"{shown(text)} is neither a number nor an expression") from None
    before = [len(flat[:place].lstrip().encode()) for place in powers]  # `ast` counts bytes
    for node in ast.walk(tree):  # columns as in the text itself
        if hasattr(node, "col_offset"):
            node.col_offset = _as_written(node.col_offset, before) + padding
    expression = Expression(flat, tree)
    _check(expression, own)
    return expression


def _as_written(column: int, powers: Sequence[int]) -> int:
    """The column in a text with ^ at these columns, of a column in the text with ** in their place."""
    return column - sum(place + number < column for number, place in enumerate(powers))


def _known_names(name: str, known: Collection[str]) -> str:
    """What a message says behind an unknown name: the nearest name, or those that there are."""
    if name == "G":
        return "; G is known where the scene has units:"
    if near := suggestion(name, [*known, *RESERVED]):
        return near
    listed = [*sorted(known), *BUILT_IN]
    more = ", …" if len(listed) > MOST_NAMES else ""
    return f", known: {', '.join(listed[:MOST_NAMES])}{more}; names of your own stand under constants:"


def _not_an_expression(text: str) -> str:
    """Why a text is no expression, with the remedy where a unit, a percent sign or a decimal comma is the cause."""
    told = f"{shown(text)} is neither a number nor an expression"
    if (found := _WITH_UNIT.fullmatch(text.strip())) is None:
        return told
    if found[2] == "%":
        return f"{told}; write {float(found[1]) / 100:g}"
    return f"{told}; write {found[1]} alone: the units of all numbers are given once, under units:"


def is_lost(literal: str) -> bool:
    """Whether a number that is written with a digit above 0 is too small for a float64 with all its digits."""
    mantissa = literal.lower().partition("e")[0]
    return abs(float(literal)) < SMALLEST_NUMBER and any(digit in mantissa for digit in "123456789")


def _offset(text: str, node: ast.AST) -> int:
    """Column in characters; `ast` counts bytes."""
    return len(text.encode()[: getattr(node, "col_offset", 0)].decode(errors="ignore"))


def _check(expression: Expression, own: frozenset[str]) -> None:
    """Refuse every node that the small arithmetic does not have."""
    functions = {id(node.func) for node in ast.walk(expression.tree) if isinstance(node, ast.Call)}
    for count, node in enumerate(ast.walk(expression.tree)):
        reason = _refusal(node, functions, own)
        if count > NODES_ALLOWED:
            reason = f"the expression has more than {NODES_ALLOWED} parts"
        if reason:
            raise ExpressionError(reason, _offset(expression.text, node))


def _refusal(node: ast.AST, functions: set[int], own: frozenset[str]) -> str:
    """Why a node may not stand in an expression; empty when it may."""
    if isinstance(node, ast.Constant):
        if isinstance(node.value, bool) or not isinstance(node.value, (int, float)):
            return f"{shown(node.value)} is not a number"
    elif isinstance(node, ast.Name):
        if id(node) in functions and node.id not in FUNCTIONS and node.id not in own:
            return f"unknown function {shown(node.id)}{suggestion(node.id, [*own, *FUNCTIONS])}"
        if id(node) not in functions and (node.id in FUNCTIONS or node.id in own):
            return f"{node.id} is a function, write {node.id}(…)"
    elif isinstance(node, ast.Call):
        if not isinstance(node.func, ast.Name):
            return "only the named functions can be called"
        if node.keywords or any(isinstance(argument, ast.Starred) for argument in node.args):
            return f"{node.func.id} takes numbers only"
        fewest, most = FUNCTIONS.get(node.func.id, (None, None, (1, 1) if node.func.id in own else _ANY))[2]
        if not fewest <= len(node.args) <= most:
            return f"{node.func.id} takes {fewest if fewest == most else 'one or more'} number(s), not {len(node.args)}"
    elif isinstance(node, ast.BinOp):
        if type(node.op) not in _BINARY:
            return "this operator is not allowed"
    elif isinstance(node, ast.UnaryOp):
        if type(node.op) not in _UNARY:
            return "this operator is not allowed"
    elif not isinstance(node, (ast.operator, ast.unaryop, ast.expr_context)):
        return "only numbers, names, + - * / // % ** ^ and functions are allowed in an expression"
    return ""


@dataclass(frozen=True)
class _Evaluation:
    """One walk over an expression, with values for its names."""

    text: str
    values: Mapping[str, Any]
    on_arrays: bool

    def of(self, node: ast.expr) -> Any:
        if isinstance(node, ast.Name):
            return self._name(node)
        try:
            if isinstance(node, ast.Constant):
                result = float(node.value)  # type: ignore[arg-type]
            elif isinstance(node, ast.UnaryOp):
                result = _UNARY[type(node.op)](self.of(node.operand))
            elif isinstance(node, ast.BinOp):
                left, right = self.of(node.left), self.of(node.right)
                if self.on_arrays and isinstance(node.op, ast.Pow):
                    left = np.asarray(left, dtype=float)  # so that numbers fail as arrays do
                result = _BINARY[type(node.op)](left, right)
            else:
                assert isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
                on_numbers, on_arrays, _ = FUNCTIONS[node.func.id]
                result = (on_arrays if self.on_arrays else on_numbers)(*[self.of(argument) for argument in node.args])
        except ExpressionError:
            raise
        except (ArithmeticError, ValueError) as error:
            reason = "division by zero" if isinstance(error, ZeroDivisionError) else "not a real number here"
            reason = "too large a number" if isinstance(error, OverflowError) else reason
            raise ExpressionError(f"{shown(ast.unparse(node))}: {reason}", _offset(self.text, node)) from None
        if isinstance(result, complex) or (not self.on_arrays and not math.isfinite(result)):
            raise ExpressionError(f"{shown(ast.unparse(node))}: not a real number here", _offset(self.text, node))
        return result

    def _name(self, node: ast.Name) -> Any:
        value = self.values[node.id] if node.id in self.values else BUILT_IN[node.id]
        if value is None:
            raise UnresolvedConstant(f"{node.id} has no value", _offset(self.text, node))
        return value


@dataclass(frozen=True)
class Formula:
    """A number or expression with a value for every particle, over names that the generator offers."""

    expression: Expression
    constants: Mapping[str, float]

    def __call__(self, count: int, **names: Any) -> np.ndarray:
        """Evaluate for `count` particles; every result is finite, or ExpressionError says why not."""
        result = np.broadcast_to(np.asarray(self.expression.array({**self.constants, **names}), dtype=float), (count,))
        if not np.all(np.isfinite(result)):
            first = int(np.flatnonzero(~np.isfinite(result))[0])
            raise ExpressionError(f"{shown(self.expression.text)} is {result[first]} for particle {first}")
        return result
