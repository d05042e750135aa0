"""Fields of formulas: the text of a potential or of an acceleration, and the numbers by the names that a formula gives them."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from mpp_taichi.arithmetic.point_function import PointFunction
from mpp_taichi.scene.expressions import RESERVED, Expression, ExpressionError, parse
from mpp_taichi.scene.faults import shown
from mpp_taichi.scene.fields import Context, Field, ListOf, Number, Wrong, calculate
from mpp_taichi.scene.formulas.meanings import parsed
from mpp_taichi.scene.location import Location

PARAMETERS_ALLOWED = 24


class FormulaText(str):
    """The text of a formula, with what the scene defines of its names; they are checked together with the parameters (laws.py).

    `constants` are the constants of the scene, and the functions through points that the formula calls.
    """

    constants: Mapping[str, float | PointFunction]
    dimensions: int
    place: Location  # once the scene is loaded

    def __new__(cls, text: str, constants: Mapping[str, float | PointFunction], dimensions: int) -> "FormulaText":
        """A text that knows the numbers of its scene."""
        made = str.__new__(cls, text)
        made.constants, made.dimensions = constants, dimensions
        return made

    @property
    def expression(self) -> Expression:
        """The text, parsed."""
        return parsed(self, self.constants)

    def __getnewargs__(self) -> tuple[Any, ...]:
        """What a copy in another process is made of."""
        return str(self), self.constants, self.dimensions


@dataclass(frozen=True)
class LawText(Field):
    """A formula over names of its own, parameters and constants of the scene."""

    names: tuple[str, ...]
    optional: bool = False

    def check(self, value: Any, context: Context) -> FormulaText | None:
        """Check the grammar."""
        if value is None and self.optional:
            return None
        if not isinstance(value, str):
            value = repr(calculate(value, context))
        try:
            expression = parse(value, frozenset(context.functions))
        except ExpressionError as error:
            raise Wrong(str(error), offset=error.offset) from None
        used: dict[str, float | PointFunction | None] = {
            name: context.constants[name] for name in expression.names & set(context.constants)
        }
        used |= {name: context.functions[name] for name in expression.called & set(context.functions)}
        known = {name: number for name, number in used.items() if number is not None}
        if len(known) < len(used):
            raise Wrong("")  # reported where the constant or the function is defined
        return FormulaText(value, known, context.dimensions)

    def schema(self) -> dict[str, Any]:
        """A number or text."""
        description = f"a formula over {', '.join(self.names)} and the parameters"
        return {"anyOf": [{"type": "number"}, {"type": "string", "description": description}]}


@dataclass(frozen=True)
class LawVector(Field):
    """A formula for each axis."""

    names: tuple[str, ...]

    def check(self, value: Any, context: Context) -> tuple[FormulaText, ...] | None:
        """Check the grammar of each."""
        if value is None:
            return None
        return ListOf(LawText(self.names), (context.dimensions,), "formulas").check(value, context)

    def schema(self) -> dict[str, Any]:
        """An array of two or three."""
        return ListOf(LawText(self.names), (2, 3)).schema()


@dataclass(frozen=True)
class Numbers(Field):
    """Numbers by name."""

    def check(self, value: Any, context: Context) -> dict[str, float]:
        """Calculate each number."""
        if value is None:
            return {}
        if not isinstance(value, dict):
            raise Wrong(f"must be a mapping of names to numbers, not {shown(value)}")
        if len(value) > PARAMETERS_ALLOWED:
            raise Wrong(f"has {len(value)} numbers, allowed: {PARAMETERS_ALLOWED}")
        wrong, found = Wrong(""), {}
        for name, entry in value.items():
            if not (isinstance(name, str) and name.isidentifier()):
                wrong.parts.append(((name,), None, f"{shown(name)} cannot be the name of a number in a formula"))
            elif name in RESERVED:
                wrong.parts.append(((name,), None, f"{shown(name)} has a meaning of its own in a formula, choose another name"))
            else:
                try:
                    found[name] = Number().check(entry, context)
                except Wrong as inner:
                    wrong.parts += [((name, *path), offset, message) for path, offset, message in inner.parts]
                    wrong.parts += [] if inner.parts else [((), None, "")]
        if wrong.parts:
            raise wrong
        return found

    def schema(self) -> dict[str, Any]:
        """A mapping of names to numbers or texts."""
        return {"type": "object", "additionalProperties": Number().schema()}
