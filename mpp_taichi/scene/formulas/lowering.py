"""Lowering: SymPy expressions as steps of a program.

Powers to whole numbers are products that share their squares. Factors that are numbers, or will be, stand first in a product,
so that they are multiplied once; the other factors of a quotient are collected below one line.
"""

from collections.abc import Collection, Sequence
from functools import reduce
from typing import Any

import sympy

from mpp_taichi.arithmetic.point_function import POINTS
from mpp_taichi.scene.expressions import ExpressionError
from mpp_taichi.scene.faults import shown
from mpp_taichi.scene.formulas.point_value import PointValue, parts_of

MOST_FACTORS = 64  # of a power to a whole number, which is computed by products
_FUNCTIONS = {
    sympy.exp: "exp",
    sympy.log: "log",
    sympy.sin: "sin",
    sympy.cos: "cos",
    sympy.tan: "tan",
    sympy.asin: "asin",
    sympy.acos: "acos",
    sympy.atan: "atan",
    sympy.tanh: "tanh",
    sympy.Abs: "abs",
}


class Lowering:
    """The steps of SymPy expressions while they are made."""

    def __init__(self, variables: Collection[str], inverted: Collection[str] = ()) -> None:
        """Begin without steps; the values of all names but the `variables` stay the same during a run.

        Of the `inverted` names the inverse is computed once.
        """
        self.variables, self.inverted = variables, inverted
        self.steps: list[tuple[Any, ...]] = []
        self._known: dict[tuple[Any, ...], int] = {}
        self._lowered: dict[Any, int] = {}

    def step(self, *step: Any) -> int:
        """The place of a step, which is made where there is no equal step yet."""
        if step not in self._known:
            self._known[step] = len(self.steps)
            self.steps.append(step)
        return self._known[step]

    def _number(self, value: float) -> int:
        return self.step("number", float(value))

    def lower(self, expression: Any) -> int:
        """The step whose value is the expression."""
        expression = sympy.sympify(expression)
        if expression not in self._lowered:
            self._lowered[expression] = self._new(expression)
        return self._lowered[expression]

    def _new(self, expression: Any) -> int:
        if expression.is_number:
            return self._number(_real(expression))
        if expression.is_Symbol:
            return self.step("name", expression.name)
        if expression.is_Add:
            return self._sum(expression)
        if expression.is_Mul:
            return self._product(expression)
        if expression.is_Pow and expression.base != sympy.E:
            return self._power(expression)
        return self._function(expression)

    def varies(self, expression: Any) -> bool:
        """Whether an expression depends on a variable; if not, it is a number once all names have values."""
        return any(symbol.name in self.variables for symbol in expression.free_symbols)

    def is_inverted(self, factor: Any) -> bool:
        """Whether a factor is the inverse, or a power of the inverse, of one of the `inverted` names."""
        return bool(
            _is_quotient(factor) and factor.base.is_Symbol and factor.base.name in self.inverted and factor.exp.is_Integer
        )

    def _sum(self, expression: Any) -> int:
        """A sum, with the terms that have a minus sign subtracted, behind those that have none."""
        minus = [term for term in expression.args if term.could_extract_minus_sign()]
        plus = [term for term in expression.args if term not in minus]
        if not plus:  # −a − b = (−a) − b
            plus, minus = minus[:1], minus[1:]
        total = self.lower(plus[0])
        for term in plus[1:]:
            total = self.step("+", total, self.lower(term))
        for term in minus:
            total = self.step("-", total, self.lower(-term))
        return total

    def _product(self, expression: Any) -> int:
        """A product over a product: numbers first, which kernels multiply once."""
        above: list[int] = []
        below: list[int] = []
        coefficient = 1.0
        for factor in sorted(_without_sign(expression.args), key=lambda each: (self.varies(each), each.sort_key())):
            if factor.is_number:
                coefficient *= _real(factor)
            elif self.varies(factor) and _is_quotient(factor) and not self.is_inverted(factor):
                below.append(self.lower(factor.base**-factor.exp))
            else:
                above.append(self.lower(factor))
        if coefficient != 1.0 or not above:
            above.insert(0, self._number(coefficient))
        product = reduce(lambda a, b: self.step("*", a, b), above)
        return product if not below else self.step("/", product, reduce(lambda a, b: self.step("*", a, b), below))

    def _power(self, expression: Any) -> int:
        base, exponent = expression.base, expression.exp
        if not exponent.is_number:
            return self.lower(sympy.exp(exponent * sympy.log(base)))
        if self.is_inverted(expression):
            return self._repeated(self.step("/", self._number(1.0), self.lower(base)), -int(exponent))
        if exponent.is_negative:
            return self.step("/", self._number(1.0), self.lower(base**-exponent))
        whole = int(exponent)
        rest = exponent - whole
        if whole > MOST_FACTORS or rest not in (0, sympy.Rational(1, 2)):
            return self.step("power", self.lower(base), float(exponent))
        place = self.lower(base)
        result = None if not whole else self._repeated(place, whole)
        if rest:
            root = self.step("root", place)
            result = root if result is None else self.step("*", result, root)
        assert result is not None
        return result

    def _repeated(self, place: int, count: int) -> int:
        """A power to a whole number by products: x⁶ = (x³)², x³ = x x²."""
        if count == 1:
            return place
        half = self._repeated(place, count // 2)
        square = self.step("*", half, half)
        return square if count % 2 == 0 else self.step("*", place, square)

    def _function(self, expression: Any) -> int:
        kind, arguments = expression.func, expression.args
        if kind in _FUNCTIONS:
            return self.step(_FUNCTIONS[kind], self.lower(arguments[0]))
        if kind is PointValue:
            x, function, derivative = parts_of(expression)
            return self.step(POINTS, self.lower(x), function, derivative)
        if kind in (sympy.sinh, sympy.cosh):
            grown = sympy.exp(arguments[0])
            return self.lower((grown - 1 / grown) / 2 if kind is sympy.sinh else (grown + 1 / grown) / 2)
        if kind in (sympy.Max, sympy.Min):
            return reduce(lambda a, b: self._extreme(kind is sympy.Max, a, b), map(self.lower, arguments))
        if kind is sympy.sign:
            at = self.lower(arguments[0])
            below = self.step("chosen", self.lower(-arguments[0]), self._number(-1.0), self._number(0.0))
            return self.step("chosen", at, self._number(1.0), below)
        if kind is sympy.Heaviside:
            return self.step("chosen", self.lower(arguments[0]), self._number(1.0), self._number(0.0))
        if kind is sympy.DiracDelta:  # of a kink, which is one point
            return self._number(0.0)
        raise ExpressionError(
            f"the formula, or a derivative of it, needs {shown(kind.__name__)}, which cannot be computed here"
        )

    def _extreme(self, largest: bool, a: int, b: int) -> int:
        difference = self.step("-", a, b) if largest else self.step("-", b, a)
        return self.step("chosen", difference, a, b)


def _real(value: Any) -> float:
    """A number as a float."""
    try:
        return float(value)
    except TypeError:
        raise ExpressionError(f"a derivative of the formula has the number {shown(str(value))}, which is not real") from None


def _without_sign(factors: Sequence[Any]) -> Sequence[Any]:
    """The factors of a product, with a sign of the product moved into a difference: −u (a − b) is u (b − a)."""
    differences = [each for each in factors if each.is_Add and any(term.could_extract_minus_sign() for term in each.args)]
    if sympy.S.NegativeOne not in factors or not differences:
        return factors
    turned = sympy.Add(*[-term for term in differences[0].args])
    return [turned if each is differences[0] else each for each in factors if each != sympy.S.NegativeOne]


def _is_quotient(factor: Any) -> bool:
    """Whether a factor of a product belongs below the line."""
    return bool(factor.is_Pow and factor.exp.is_number and factor.exp.is_negative and factor.base != sympy.E)
