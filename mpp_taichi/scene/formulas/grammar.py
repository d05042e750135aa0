"""The grammar of formulas: the expressions of a scene (scene/expressions.py) as SymPy expressions.

The text is parsed with `ast` and walked; SymPy never sees it as text. Numbers that a formula calculates are floats, so that a
power of powers cannot allocate without bound, and size and nesting are limited, so that a derivative cannot take for ever.
"""

import ast
import math
from collections.abc import Callable, Mapping
from fractions import Fraction
from typing import Any, NoReturn

import sympy

from mpp_taichi.arithmetic.point_function import PointFunction
from mpp_taichi.scene.expressions import BUILT_IN, FUNCTIONS, Expression, ExpressionError
from mpp_taichi.scene.faults import shown
from mpp_taichi.scene.formulas.meanings import Meanings, parsed
from mpp_taichi.scene.formulas.point_value import value_of

PARTS_ALLOWED = 120
"""Numbers, names and operators of a formula; its third derivative may have several thousand."""
NESTING_ALLOWED = 6
"""Functions and powers inside each other: with each, a derivative grows by a factor."""
STEPS_ALLOWED = 4000
"""Operations of a derivative."""
DERIVED_STEPS_ALLOWED = 600
"""Operations of a derivative that is derived once more; it takes a second."""
TERMS_ALLOWED = 10_000
"""Terms of an expression whose products are multiplied out, to see whether it is 0; it takes half a second."""
LARGEST_DENOMINATOR = 64  # 0.5 and 2.25 are kept as fractions, so that a power of 0.5 is a root
WITHOUT_DERIVATIVE = ("floor",)
WITH_KINK = ("abs", "min", "max")
_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "sqrt": sympy.sqrt,
    "exp": sympy.exp,
    "log": sympy.log,
    "log10": lambda value: sympy.log(value) / math.log(10.0),
    "sin": sympy.sin,
    "cos": sympy.cos,
    "tan": sympy.tan,
    "asin": sympy.asin,
    "acos": sympy.acos,
    "atan": sympy.atan,
    "sinh": sympy.sinh,
    "cosh": sympy.cosh,
    "tanh": sympy.tanh,
    "radians": lambda value: value * math.radians(1.0),
    "degrees": lambda value: value * math.degrees(1.0),
    "hypot": lambda *values: sympy.sqrt(sum(value**2 for value in values)),
    "abs": lambda value: sympy.Mul(*map(_absolute, sympy.Mul.make_args(value))),  # factor by factor
    "min": sympy.Min,
    "max": sympy.Max,
}


def _absolute(value: Any) -> Any:
    """|x|; where SymPy does not know x to be real, as of log(x), its derivative of Abs would have real and imaginary parts."""
    return sympy.Abs(value) if value.is_extended_real else sympy.Max(value, -value)


def symbolic(expression: Expression, values: Mapping[str, Any]) -> Any:
    """The SymPy expression, with symbols or numbers for its names.

    ExpressionError, with the character, where a part has no derivative or no real value, and where the formula is too large.
    """
    parts = sum(isinstance(node, (ast.Constant, ast.Name, ast.BinOp, ast.UnaryOp)) for node in ast.walk(expression.tree))
    if parts > PARTS_ALLOWED:
        raise ExpressionError(f"the formula has {parts} parts, allowed: {PARTS_ALLOWED}")
    return _Walk(expression, values).of(expression.tree, 0)


def split_numbers(text: str, fixed: Meanings) -> tuple[Meanings, tuple[tuple[str, float], ...]]:
    """The numbers by name of the exponents of a formula, and those of its other names.

    An exponent is a number while derivatives are formed, which then are much simpler. Functions through points are known then,
    too.
    """
    tree = parsed(text, fixed).tree
    powers = [node.right for node in ast.walk(tree) if isinstance(node, ast.BinOp) and isinstance(node.op, ast.Pow)]
    names = {node.id for power in powers for node in ast.walk(power) if isinstance(node, ast.Name)}
    names |= {name for name, value in fixed if isinstance(value, PointFunction)}
    others = tuple((name, value) for name, value in fixed if name not in names and not isinstance(value, PointFunction))
    return tuple(each for each in fixed if each[0] in names), others


def meaning(value: float | PointFunction) -> Any:
    """What a name of a formula stands for while derivatives are formed: a number of SymPy, or a function through points."""
    return value if isinstance(value, PointFunction) else number(value)


def number(value: float) -> Any:
    """A number for SymPy: a fraction where its denominator is small, else a float of 53 bits."""
    if not math.isfinite(value):
        raise ExpressionError(f"{value:g} is not a number of a formula")
    exact = Fraction(value)
    if exact.denominator <= LARGEST_DENOMINATOR and abs(exact.numerator) <= 2**53:
        return sympy.Rational(exact.numerator, exact.denominator)
    return sympy.Float(value, 17)


def kinks(expression: Expression) -> list[tuple[str, int]]:
    """The functions of a formula that have a kink, with their characters."""
    found = []
    for node in ast.walk(expression.tree):
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id in WITH_KINK:
            found.append((node.func.id, _character(expression, node)))
    return found


def tidy(expression: Any) -> Any:
    """Common factors of the terms taken out, which is never slow and never less accurate."""
    return sympy.factor_terms(expression)


def is_short(expression: Any) -> bool:
    """Whether a derivative has a further derivative; without, methods that ask for one are refused."""
    return bool(expression.count_ops() <= DERIVED_STEPS_ALLOWED)


def is_zero(expression: Any) -> bool:
    """Whether an expression is seen to be 0 once its products are multiplied out.

    An expression that would have more than `TERMS_ALLOWED` terms is not multiplied out, and counts as different from 0.
    """
    return bool(_terms(expression) <= TERMS_ALLOWED and sympy.expand(expression) == 0)


def _terms(expression: Any) -> float:
    """A bound of the number of terms of an expression, or of any part of it, when products are multiplied out."""
    counts = [_terms(each) for each in expression.args]
    largest = max(counts, default=1.0)
    if largest > TERMS_ALLOWED:
        return math.inf
    if expression.is_Add:
        return sum(counts)
    if expression.is_Mul:
        return math.prod(counts)
    if expression.is_Pow:  # of k terms to the power n: as many terms as there are ways to choose n of k, with repetition
        exponent = float(abs(expression.exp.as_coeff_Add()[0]))
        if counts[0] > 1 and exponent > TERMS_ALLOWED:
            return math.inf
        n, k = int(exponent), int(counts[0])
        return max(largest, float(math.comb(n + k - 1, n))) if k > 1 else largest
    return largest


def checked_size(expression: Any) -> Any:
    """The expression itself; ExpressionError where a derivative has become too long."""
    if expression.count_ops() > STEPS_ALLOWED:
        raise ExpressionError(f"a derivative of the formula has more than {STEPS_ALLOWED} operations; write it more simply")
    return expression


class _Walk:
    """One walk over an expression."""

    def __init__(self, expression: Expression, values: Mapping[str, Any]) -> None:
        self.expression, self.values = expression, values

    def of(self, node: ast.AST, depth: int) -> Any:
        """The value of a node that stands inside `depth` functions and powers."""
        if depth > NESTING_ALLOWED:
            self.fail(node, f"more than {NESTING_ALLOWED} functions and powers stand inside each other here")
        if isinstance(node, ast.Constant):
            return number(float(node.value))  # type: ignore[arg-type]
        if isinstance(node, ast.Name):
            return self.values[node.id] if node.id in self.values else number(BUILT_IN[node.id])
        if isinstance(node, ast.UnaryOp):
            value = self.of(node.operand, depth)
            return -value if isinstance(node.op, ast.USub) else value
        if isinstance(node, ast.BinOp):
            return self.combined(node, depth)
        assert isinstance(node, ast.Call) and isinstance(node.func, ast.Name)
        return self.called(node, node.func.id, depth)

    def combined(self, node: ast.BinOp, depth: int) -> Any:
        """Two values with an operator between them."""
        if isinstance(node.op, (ast.FloorDiv, ast.Mod)):
            self.fail(node, f"{'//' if isinstance(node.op, ast.FloorDiv) else '%'} has no derivative, which a force needs")
        inner = depth + isinstance(node.op, ast.Pow)
        left, right = self.of(node.left, inner), self.of(node.right, inner)
        if isinstance(node.op, ast.Add):
            return self.kept(node, left + right)
        if isinstance(node.op, ast.Sub):
            return self.kept(node, left - right)
        if isinstance(node.op, ast.Mult):
            return self.kept(node, left * right)
        if isinstance(node.op, ast.Div):
            if right == 0:
                self.fail(node, f"{shown(ast.unparse(node))}: division by zero")
            return self.kept(node, left / right)
        if left.is_number and right.is_number:
            return self.power(node, float(left), float(right))
        if left.is_number and not left > 0:
            self.fail(node, f"{shown(ast.unparse(node))}: a power that varies needs a base above 0")
        return self.kept(node, left**right)

    def power(self, node: ast.AST, base: float, exponent: float) -> Any:
        """A power of numbers, by floats: whole numbers would be kept with all their digits."""
        try:
            value = base**exponent
        except (ArithmeticError, ValueError):
            self.fail(node, f"{shown(ast.unparse(node))}: not a real number of ordinary size")
        if isinstance(value, complex):
            self.fail(node, f"{shown(ast.unparse(node))}: not a real number")
        return number(value)

    def called(self, node: ast.Call, name: str, depth: int) -> Any:
        """A function of values."""
        if name in WITHOUT_DERIVATIVE:
            self.fail(node, f"{name} has no derivative, which a force needs")
        own = self.values.get(name)
        if isinstance(own, PointFunction):
            return self.through_points(node, own, self.of(node.args[0], depth + 1))
        if name not in _FUNCTIONS:
            self.fail(node, f"{name} cannot stand in the formula of a force, allowed: {', '.join(_FUNCTIONS)}")
        arguments = [self.of(each, depth + 1) for each in node.args]
        if not all(each.is_number for each in arguments):
            return self.kept(node, _FUNCTIONS[name](*arguments))
        try:  # of numbers alone the function is a number, and stays a float
            return number(float(FUNCTIONS[name][0](*map(float, arguments))))
        except (ArithmeticError, ValueError):
            self.fail(node, f"{shown(ast.unparse(node))}: not a real number")

    def through_points(self, node: ast.Call, function: PointFunction, x: Any) -> Any:
        """A function through points."""
        if not x.is_number:
            return value_of(function, x)
        value = float(function.at(float(x)))
        if not math.isfinite(value):
            self.fail(node, f"{shown(ast.unparse(node))}: not a number, for {function.told}")
        return number(value)

    def kept(self, node: ast.AST, value: Any) -> Any:
        """The value itself, or a fault where it is no real number."""
        if value.has(sympy.zoo, sympy.nan, sympy.oo, -sympy.oo, sympy.I):
            self.fail(node, f"{shown(ast.unparse(node))}: not a real number")
        return sympy.Float(value, 17) if value.is_number and not value.is_Rational else value

    def fail(self, node: ast.AST, message: str) -> NoReturn:
        """Raise with the character at which a node begins."""
        raise ExpressionError(message, _character(self.expression, node))


def _character(expression: Expression, node: ast.AST) -> int:
    """The character at which a node begins; `ast` counts bytes."""
    return len(expression.text.encode()[: getattr(node, "col_offset", 0)].decode(errors="ignore"))
