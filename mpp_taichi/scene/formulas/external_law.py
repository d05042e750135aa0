"""The law of a field: from a potential V(x, y, z, t) or an acceleration to what the loops over particles call.

    a = −∇V/m, or the acceleration as it is written
    ȧ = (v·∇) a + ∂a/∂t,   ä = (v·∇) ȧ + (a·∂/∂v) ȧ + ∂ȧ/∂t

The derivatives are SymPy's. An acceleration may depend on the velocity, and then has no derivatives here. An acceleration that
is across the velocity everywhere, as that of a magnetic field, does no work: v·a is 0 for SymPy too.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import sympy

from mpp_taichi.arithmetic.point_function import PointFunction
from mpp_taichi.scene.expressions import ExpressionError
from mpp_taichi.scene.formulas.array_steps import ArrayArithmetic
from mpp_taichi.scene.formulas.grammar import checked_size, is_short, is_zero, kinks, meaning, split_numbers, symbolic, tidy
from mpp_taichi.scene.formulas.meanings import Meanings, parsed
from mpp_taichi.scene.formulas.pair_law import QUANTITIES
from mpp_taichi.scene.formulas.program import StepProgram, with_numbers
from mpp_taichi.scene.formulas.rounding_steps import Rounded, RoundingArithmetic
from mpp_taichi.scene.formulas.time_limit import in_time

PLACE = ("x", "y", "z")
MOTION = ("vx", "vy", "vz")
PUSH = ("ax", "ay", "az")  # the acceleration, of which the second derivative is a function
NAMES = (*PLACE, "r", "t", *QUANTITIES)
NAMES_WITH_VELOCITY = (*NAMES, *MOTION, "v")


@dataclass(frozen=True, eq=False)
class ExternalLaw:
    """The programs of a force on each particle, of x, y, z, vx, vy, vz, t, m, q, R and the live parameters."""

    acceleration: StepProgram
    """One result for each axis."""
    jerk: StepProgram
    """dȧ/dt along the motion; no results where the acceleration depends on the velocity."""
    snap: StepProgram
    """Of ax, ay, az as well, the acceleration of the particle by all forces."""
    energy: StepProgram
    """V; 0 where there is none, and where V depends on time, so that its power is counted as that of a drive."""
    flags: Mapping[str, Any]
    """What the law says of itself, as flags of a force."""
    needs: frozenset[str]
    """The quantities of particles that the force reads."""
    live: tuple[str, ...]
    """The names whose numbers may change in a run."""

    kind = "field"

    @staticmethod
    def errors(program: StepProgram, values: Mapping[str, Any]) -> list[Any]:
        """Bounds of the rounding errors of the results, in units of rounding."""
        rounded = {name: Rounded(value, np.abs(value)) for name, value in values.items()}
        return [each.error for each in program.run(RoundingArithmetic, rounded, 1.0)]

    @staticmethod
    def numbers(program: StepProgram, values: Mapping[str, Any]) -> list[Any]:
        """The results of a program, by NumPy in the precision of the places."""
        return program.run(ArrayArithmetic, values, values["x"])


class LawError(ExpressionError):
    """A fault in one of several formulas; `formula` is its number."""

    def __init__(self, formula: int, error: ExpressionError) -> None:
        """Keep the number of the formula beside the message and the character."""
        self.formula = formula
        super().__init__(str(error), error.offset)


def external_law(
    potential: str | None,
    acceleration: tuple[str, ...] | None,
    dimensions: int,
    fixed: Meanings,
    live: tuple[str, ...],
) -> ExternalLaw:
    """The law of a potential, of an acceleration or of both, with numbers for the `fixed` names; those of `live` may change.

    LawError, with the number of the formula and the character, where a text is no such formula.
    """
    texts = (*(() if potential is None else (potential,)), *(acceleration or ()))
    exponents = tuple(dict.fromkeys(each for text in texts for each in split_numbers(text, fixed)[0]))
    others = tuple(
        (name, value) for name, value in fixed if not isinstance(value, PointFunction) and (name, value) not in exponents
    )
    derived = _derived(potential, acceleration, dimensions, exponents, (*(name for name, _ in others), *live))
    return with_numbers(derived, others, live)


@lru_cache(maxsize=256)
@in_time
def _derived(
    potential: str | None,
    acceleration: tuple[str, ...] | None,
    dimensions: int,
    exponents: Meanings,
    names: tuple[str, ...],
) -> ExternalLaw:
    """The law with numbers for `exponents` alone, so that scenes that differ in other numbers share the derivatives."""
    symbols = {name: sympy.Symbol(name, real=True) for name in (*PLACE, *MOTION, *PUSH, "t", "q", *names)}
    symbols |= {name: sympy.Symbol(name, positive=True) for name in ("m", "R")}
    values: dict[str, Any] = {name: symbols[name] for name in (*PLACE, "t", *QUANTITIES)}
    for name in PLACE[dimensions:]:
        values[name] = sympy.Integer(0)
    values["r"] = sympy.sqrt(sum(values[name] ** 2 for name in PLACE))
    if acceleration is not None:
        values |= {name: symbols[name] if k < dimensions else sympy.Integer(0) for k, name in enumerate(MOTION)}
        values["v"] = sympy.sqrt(sum(values[name] ** 2 for name in MOTION))
    values |= {name: symbols[name] for name in names} | {name: meaning(value) for name, value in exponents}
    place, motion, push = ([symbols[name] for name in names[:dimensions]] for names in (PLACE, MOTION, PUSH))

    texts = [*([] if potential is None else [potential]), *(acceleration or ())]
    expressions, found = [], []
    for which, text in enumerate(texts):
        try:
            expression = parsed(text, exponents)
            expression.check_names(values)
            found.append(symbolic(expression, values))
            expressions.append(expression)
        except ExpressionError as error:
            raise LawError(which, error) from None
    try:
        energy = sympy.Integer(0) if potential is None else found.pop(0)
        pushes = found[:dimensions] or [sympy.Integer(0)] * dimensions
        works = not is_zero(sum((a * v for a, v in zip(pushes, motion, strict=True)), sympy.Integer(0)))
        rates = [
            tidy(push) if potential is None else checked_size(tidy(push - sympy.diff(energy, x) / symbols["m"]))
            for push, x in zip(pushes, place, strict=True)
        ]
        moved = any(rate.has(each) for rate in rates for each in motion)
        by_velocity = [[sympy.diff(rate, v) for v in motion] for rate in rates]
        linear = not any(entry.has(v) for row in by_velocity for entry in row for v in motion)
        timed = any(each.has(symbols["t"]) for each in (*rates, energy))
        jerk, snap = [], []
        has_more = not moved and not any(map(kinks, expressions)) and all(map(is_short, rates))
        if has_more:
            jerk = [_along(each, place, motion, symbols["t"]) for each in rates]
            has_more = all(map(is_short, jerk))
        if has_more:
            snap = [_along(each, place, motion, symbols["t"]) + _along_push(each, motion, push) for each in jerk]
    except LawError:
        raise
    except ExpressionError as error:
        raise LawError(0, error) from None
    variables = (*PLACE, *MOTION, *PUSH, "t", *QUANTITIES)
    laws = (rates, jerk, snap, [sympy.Integer(0) if timed else tidy(energy)])
    programs = [StepProgram.of(each, variables) for each in laws]
    flags = {
        "conserves_energy": not works and not timed,
        "depends_on_velocity": moved,
        "linear_in_velocity": linear,
        "turns": linear and _turns(by_velocity),
        "depends_on_time": timed,
        "has_derivatives": has_more,
        "proportional_to_mass": "m" not in programs[0].names,
    }
    used = {name for program in programs for name in program.names}
    needs = frozenset(QUANTITIES[each] for each in used & set(QUANTITIES)) | {"mass"}
    return ExternalLaw(programs[0], programs[1], programs[2], programs[3], flags, needs, ())


def _along(expression: Any, place: list[Any], motion: list[Any], time: Any) -> Any:
    """(v·∇) f + ∂f/∂t."""
    return sum((sympy.diff(expression, x) * v for x, v in zip(place, motion, strict=True)), sympy.diff(expression, time))


def _along_push(expression: Any, motion: list[Any], push: list[Any]) -> Any:
    """(a·∂/∂v) f."""
    return sum(sympy.diff(expression, v) * a for v, a in zip(motion, push, strict=True))


def _turns(matrix: list[list[Any]]) -> bool:
    """Whether a linear acceleration with these derivatives by the velocity is A + v × Ω: whether they are antisymmetric."""
    pairs = [(j, k) for j in range(len(matrix)) for k in range(j + 1)]
    return all(is_zero(matrix[j][k] + matrix[k][j]) for j, k in pairs)
