"""The law of a bond: from a potential V(l) of the length of a spring to the functions that the loops over springs call.

    F_i = g d with d = x_j − x_i, l = |d|, g = V′(l)/l;  along the spring ∂F/∂x = V″(l), across it g

`slope` is dg/du of u = 1/l, and `curvature` is d²g/du². The derivatives are SymPy's.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
import sympy

from mpp_taichi.scene.formulas.array_steps import ArrayArithmetic
from mpp_taichi.scene.formulas.grammar import checked_size, is_short, kinks, meaning, split_numbers, symbolic, tidy
from mpp_taichi.scene.formulas.meanings import Meanings, parsed
from mpp_taichi.scene.formulas.program import StepProgram, with_numbers
from mpp_taichi.scene.formulas.rounding_steps import Rounded, RoundingArithmetic
from mpp_taichi.scene.formulas.time_limit import in_time

LENGTH, REST = "l", "rest"
NAMES = (LENGTH, REST)


@dataclass(frozen=True, eq=False)
class BondLaw:
    """The programs of a bond, of l, the rest length of the spring, and the live numbers; `slope` and `curvature` are of u."""

    shape: StepProgram
    """g = V′/l."""
    slope: StepProgram
    """dg/du, of u = 1/l."""
    curvature: StepProgram
    """d²g/du², of u = 1/l."""
    along: StepProgram
    """V″."""
    energy: StepProgram
    """V."""
    flags: Mapping[str, Any]
    """What the law says of itself, as flags of a force."""
    needs: frozenset[str]
    """The quantities of particles and springs that the force reads."""
    live: tuple[str, ...]
    """The names whose numbers may change in a run."""

    kind = "bond"

    def at(self, name: str, length: Any, rest: Any, values: Mapping[str, float]) -> Any:
        """One of `shape`, `along` and `energy` at some lengths, by NumPy."""
        live = {key: np.float64(value) for key, value in values.items()}
        program: StepProgram = getattr(self, name)
        return program.run(ArrayArithmetic, {LENGTH: length, REST: rest, **live}, length)[0] + 0.0 * length

    def energy_errors_at(self, length: Any, rest: Any, values: Mapping[str, float]) -> Any:
        """Bounds of the rounding errors of V at some lengths, in units of rounding."""
        given = {LENGTH: length, REST: rest, **values}
        rounded = {key: Rounded(value, np.abs(value)) for key, value in given.items()}
        return self.energy.run(RoundingArithmetic, rounded, length)[0].error + 0.0 * length


def bond_law(text: str, fixed: Meanings, live: tuple[str, ...]) -> BondLaw:
    """The law of the potential `text`, with numbers for the `fixed` names; those of `live` may change in a run.

    ExpressionError, with the character in the text, where it is no potential of a length.
    """
    exponents, others = split_numbers(text, fixed)
    return with_numbers(_derived(text, exponents, (*(name for name, _ in others), *live)), others, live)


@lru_cache(maxsize=256)
@in_time
def _derived(text: str, exponents: Meanings, names: tuple[str, ...]) -> BondLaw:
    """The law with numbers for `exponents` alone, so that scenes that differ in other numbers share the derivatives."""
    expression = parsed(text, exponents)
    values: dict[str, Any] = {name: sympy.Symbol(name, positive=True) for name in NAMES}
    values |= {name: sympy.Symbol(name, real=True) for name in names} | {name: meaning(value) for name, value in exponents}
    expression.check_names(values)
    energy, length, inverse = symbolic(expression, values), values[LENGTH], sympy.Symbol("u", positive=True)
    rate = checked_size(sympy.diff(energy, length))
    along = checked_size(sympy.diff(rate, length))
    has_more = not kinks(expression) and is_short(along)
    slope = sympy.diff((rate / length).subs(length, 1 / inverse), inverse) if has_more else sympy.Integer(0)
    has_more = has_more and is_short(slope)
    derived = [tidy(rate / length), slope, sympy.diff(slope, inverse) if has_more else sympy.Integer(0), along]
    programs = [StepProgram.of([each], (*NAMES, "u"), (LENGTH, "u")) for each in (*derived, energy)]
    needs = {"mass", "spring_start", "spring_neighbor"}
    if any(REST in program.names for program in programs):
        needs.add("spring_rest_length")
    shape, slope_steps, curvature, along_steps, energy_steps = programs
    flags = {"has_derivatives": has_more}
    return BondLaw(shape, slope_steps, curvature, along_steps, energy_steps, flags, frozenset(needs), ())
