"""The law of a pair: from a potential V(r) to the functions that the loops over pairs call.

    V = A₁ A₂ U(r): the factor A of a particle's mass, charge and radius is the same function for both particles of the pair.
    a_i = r_i Σ_j s_j g(u) d with r_i = A_i/m_i, s_j = A_j, g = U′(r)/r = −u³ dU/du, and u = 1/r.

`slope` is dg/du, `curvature` is d²g/du². The derivatives are SymPy's.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import sympy

from mpp_taichi.scene.expressions import Expression, ExpressionError
from mpp_taichi.scene.formulas.array_steps import ArrayArithmetic
from mpp_taichi.scene.formulas.grammar import checked_size, is_short, is_zero, kinks, meaning, split_numbers, symbolic, tidy
from mpp_taichi.scene.formulas.meanings import Meanings, parsed
from mpp_taichi.scene.formulas.program import StepProgram, with_numbers
from mpp_taichi.scene.formulas.rounding_steps import ROUNDINGS_OF_QUOTIENT, Rounded, RoundingArithmetic
from mpp_taichi.scene.formulas.time_limit import in_time

DISTANCE = "r"
QUANTITIES = {"m": "mass", "q": "charge", "R": "radius"}
"""Letters of the quantities of particles; in a formula a 1 or a 2 behind the letter tells the particle of the pair."""
NAMES = (DISTANCE, *(f"{letter}{end}" for letter in QUANTITIES for end in (1, 2)))
_U = sympy.Symbol("u", positive=True)


@dataclass(frozen=True, eq=False)
class PairLaw:
    """The programs of a pair force; each has the names of its live parameters beside those that are told here."""

    shape: StepProgram
    """g, of u."""
    slope: StepProgram
    """dg/du, of u."""
    curvature: StepProgram
    """d²g/du², of u."""
    energy: StepProgram
    """U, of u: the potential energy of a pair without the factors A₁ A₂."""
    source: StepProgram
    """A, of m, q and R of one particle."""
    response: StepProgram
    """A/m, of m, q and R of one particle."""
    flags: Mapping[str, Any]
    """What the law says of itself, as flags of a force."""
    needs: frozenset[str]
    """The quantities of particles that the force reads."""
    live: tuple[str, ...]
    """The names whose numbers may change in a run."""
    reach: StepProgram
    """The cutoff, of the numbers; infinite where there is none."""

    kind = "pair"

    def reach_at(self, values: Mapping[str, float]) -> float:
        """The distance beyond which there is no force."""
        with np.errstate(all="ignore"):
            return float(self.reach.run(ArrayArithmetic, {k: np.float64(v) for k, v in values.items()}, 0.0)[0])

    @property
    def fixed_reach(self) -> float:
        """The cutoff where it is a number that does not change in a run, else infinity."""
        return math.inf if self.reach.names else self.reach_at({})

    def energy_at(self, distance: Any, values: Mapping[str, float]) -> Any:
        """U at some distances, by NumPy."""
        return self._at(self.energy, distance, values)

    def shape_at(self, distance: Any, values: Mapping[str, float]) -> Any:
        """G = U′(r)/r at some distances, by NumPy."""
        return self._at(self.shape, distance, values)

    def energy_errors_at(self, distance: Any, values: Mapping[str, float]) -> Any:
        """Bounds of the rounding errors of U at some distances, in units of rounding."""
        return self._rounded(self.energy, distance, values).error

    @staticmethod
    def of_particles(program: StepProgram, values: Mapping[str, Any]) -> Any:
        """`source` or `response` of some particles, by NumPy."""
        return program.run(ArrayArithmetic, values, values["m"])[0]

    @staticmethod
    def _rounded(program: StepProgram, distance: Any, values: Mapping[str, float]) -> Rounded:
        inverse = Rounded(1.0 / distance, ROUNDINGS_OF_QUOTIENT / distance)
        live = {name: Rounded(value, abs(value)) for name, value in values.items()}
        found: Rounded = program.run(RoundingArithmetic, {"u": inverse, **live}, inverse)[0]
        return found

    @staticmethod
    def _at(program: StepProgram, distance: Any, values: Mapping[str, float]) -> Any:
        inverse = 1.0 / np.asarray(distance)
        live = {name: inverse.dtype.type(value) for name, value in values.items()}
        return program.run(ArrayArithmetic, {"u": inverse, **live}, inverse)[0]


def pair_law(text: str, fixed: Meanings, live: tuple[str, ...], cutoff: str | None = None) -> PairLaw:
    """The law of the potential `text`, with numbers for the `fixed` names; those of `live` may change in a run.

    Beyond the `cutoff`, a formula of the same names, there is no force, and U is shifted to be 0 there. ExpressionError, with
    the character in the text, where it is no potential of a pair; CutoffError where the cutoff is no distance.
    """
    exponents, others = split_numbers(text, fixed)
    law = with_numbers(_derived(text, exponents, (*(name for name, _ in others), *live), cutoff), others, live)
    if cutoff is not None and not live and not law.reach_at({}) > 0.0:
        raise CutoffError(f"{law.reach_at({}):g} is not allowed, must be above 0")
    return law


@lru_cache(maxsize=256)
@in_time
def _derived(text: str, exponents: Meanings, names: tuple[str, ...], cutoff: str | None) -> PairLaw:
    """The law with numbers for `exponents` alone, so that scenes that differ in other numbers share the derivatives."""
    expression = parsed(text, exponents)
    values: dict[str, Any] = {f"{letter}{end}": _symbol(letter, str(end)) for letter in QUANTITIES for end in (1, 2)}
    values[DISTANCE] = 1 / _U
    values |= {name: sympy.Symbol(name, real=True) for name in names} | {name: meaning(value) for name, value in exponents}
    expression.check_names(values)
    potential = symbolic(expression, values)
    factor, alone = _separated(sympy.factor_terms(potential), expression)
    derivatives = [checked_size(tidy(-(_U**3) * sympy.diff(alone, _U)))]
    has_more = not kinks(expression)
    for _ in range(2):
        more = tidy(sympy.diff(derivatives[-1], _U)) if is_short(derivatives[-1]) else sympy.Integer(0)
        has_more = has_more and is_short(derivatives[-1]) and is_short(more)
        derivatives.append(more if has_more else sympy.Integer(0))
    mass, charge = _symbol("m"), _symbol("q")
    energy, within = tidy(alone), None
    reach = sympy.oo if cutoff is None else _reach(cutoff, exponents, values)
    if cutoff is not None:
        within = _U - 1 / reach
        energy = energy - alone.subs(_U, 1 / reach)
    shape, slope, curvature, energy = (StepProgram.of([each], ("u",), ("u",), within) for each in (*derivatives, energy))
    source, response = (StepProgram.of([each], tuple(QUANTITIES)) for each in (factor, sympy.powsimp(factor / mass)))
    flags = {
        "proportional_to_mass": factor.has(mass) and (factor / mass).subs(mass, 0).is_finite is not False,
        "proportional_to_charge": factor.subs(charge, 0) == 0,
        "has_derivatives": has_more,
    }
    needs = {QUANTITIES[name] for name in source.names | response.names if name in QUANTITIES}
    return PairLaw(
        shape, slope, curvature, energy, source, response, flags, frozenset(needs | {"mass"}), (), StepProgram.of([reach], ())
    )


class CutoffError(ExpressionError):
    """A fault in the formula of a cutoff."""

    of_cutoff = True


def _reach(text: str, exponents: Meanings, values: Mapping[str, Any]) -> Any:
    """The cutoff as an expression of the numbers of a formula."""
    try:
        expression = parsed(text, exponents)
        numbers = {name: value for name, value in values.items() if name not in NAMES}
        expression.check_names(numbers)
        reach = symbolic(expression, numbers)
    except ExpressionError as error:
        raise CutoffError(str(error), error.offset) from None
    if reach.is_number and not reach > 0:
        raise CutoffError(f"{float(reach):g} is not allowed, must be above 0")
    return reach


def _separated(potential: Any, expression: Expression) -> tuple[Any, Any]:
    """(A of one particle, U) of V = A₁ A₂ U; refused where V is no such product."""
    ends = [{_symbol(letter, str(end)) for letter in QUANTITIES} for end in (1, 2)]
    factors: list[Any] = [sympy.Integer(1), sympy.Integer(1)]
    alone: Any = sympy.Integer(1)
    for each in sympy.Mul.make_args(sympy.expand_power_base(potential)):
        of = [bool(each.free_symbols & end) for end in ends]
        if not any(of):
            alone *= each
        elif all(of) or _U in each.free_symbols:
            raise ExpressionError(
                "must be a function of r times the same function of m1, q1, R1 and of m2, q2, R2, such as q1*q2/r; "
                "write a sum as several pair forces"
            )
        else:
            factors[of.index(True)] *= each
    one, other = (_of_any(each, end) for each, end in zip(factors, (1, 2), strict=True))
    if one != other and not is_zero(one - other):
        raise ExpressionError(
            f"{sympy.sstr(factors[0])} of the first particle is not {sympy.sstr(factors[1])} of the second: the forces would "
            "not be opposite; must be the same function of both"
        )
    return one, alone


def _of_any(factor: Any, end: int) -> Any:
    """The factor of one end as a function of m, q and R."""
    return factor.xreplace({_symbol(letter, str(end)): _symbol(letter) for letter in QUANTITIES})


def _symbol(letter: str, end: str = "") -> Any:
    """The symbol of a quantity; masses and radii are positive, and a charge may have either sign."""
    return sympy.Symbol(f"{letter}{end}", **({"real": True} if letter == "q" else {"positive": True}))
