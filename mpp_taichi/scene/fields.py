"""Fields: the checked types that keys of a scene have, as annotations for pydantic.

Each type defines in one place which values are valid, how an expression becomes a number, the message for an invalid value,
and how the JSON Schema (and so the editor) describes the key.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

from pydantic_core import PydanticCustomError, core_schema

from mpp_taichi.scene.did_you_mean import choices
from mpp_taichi.scene.expressions import SMALLEST_NUMBER, ExpressionError, Formula, UnresolvedConstant, parse
from mpp_taichi.scene.faults import shown
from mpp_taichi.wording.told_apart import told_apart

LARGEST_NUMBER = 1e300


@dataclass(frozen=True)
class Context:
    """The constants, dimensions, folder and functions through points that the checks of a scene need; None: it is at fault."""

    constants: Mapping[str, float | None] = field(default_factory=dict)
    dimensions: int = 3
    folder: Path = Path()
    functions: Mapping[str, Any] = field(default_factory=dict)


class Wrong(Exception):
    """A fault inside a value: its place below the key, the character of a text, and the reason."""

    def __init__(self, message: str, *, path: tuple[Any, ...] = (), offset: int | None = None) -> None:
        """Keep the place beside the message."""
        self.parts: list[tuple[tuple[Any, ...], int | None, str]] = [(path, offset, message)] if message else []
        super().__init__(message)


class Field(ABC):
    """Base of the annotations: `check` returns the value or raises Wrong, `schema` describes it."""

    @abstractmethod
    def check(self, value: Any, context: Context) -> Any:
        """Turn the value that the scene gives into the value that the program uses."""

    @abstractmethod
    def schema(self) -> dict[str, Any]:
        """The JSON Schema of the values that the scene may give."""

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        """Let pydantic call `check`."""

        def validate(value: Any, info: Any) -> Any:
            try:
                return self.check(value, info.context)
            except Wrong as wrong:
                raise PydanticCustomError("wrong", "{reason}", {"reason": str(wrong), "parts": wrong.parts}) from None

        return core_schema.with_info_plain_validator_function(validate)

    def __get_pydantic_json_schema__(self, core: Any, handler: Any) -> dict[str, Any]:
        """Let pydantic use `schema`."""
        return self.schema()


def calculate(value: Any, context: Context) -> float:
    """A number, or the value of an expression over the scene's constants."""
    if isinstance(value, str):
        try:
            value = parse(value).number(context.constants)
        except UnresolvedConstant:
            raise Wrong("") from None  # reported where the constant is defined
        except ExpressionError as error:
            raise Wrong(str(error), offset=error.offset) from None
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise Wrong(f"{shown(value)} is not a number")
    if not abs(value) <= LARGEST_NUMBER:
        raise Wrong(f"{shown(value)} is not a finite number" + ("" if math.isnan(value) else f" up to {LARGEST_NUMBER:g}"))
    if 0.0 < abs(value) < SMALLEST_NUMBER:
        raise Wrong(f"{shown(value)} is too small for a number with all its digits, the least is {SMALLEST_NUMBER:.3g}")
    return float(value)


@dataclass(frozen=True)
class Ranged(Field, ABC):
    """A finite number or an expression, within a range: the common part of numbers and whole numbers."""

    json_type: ClassVar[str] = "number"
    minimum: float | None = None
    maximum: float | None = None
    above: float | None = None

    def calculated(self, value: Any, context: Context) -> float:
        """Calculate and compare with the range."""
        number = calculate(value, context)
        low = (self.minimum is None or number >= self.minimum) and (self.above is None or number > self.above)
        if not low or (self.maximum is not None and number > self.maximum):
            bounds = [each for each in (self.minimum, self.maximum, self.above) if each is not None]
            raise Wrong(f"{told_apart(number, *bounds, digits=12)[0]} is not allowed, must be {self.range()}")
        return number

    def range(self) -> str:
        """The range in words."""
        parts = []
        if self.above is not None:
            parts.append(f"above {self.above:g}")
        if self.minimum is not None:
            parts.append(f"at least {self.minimum:g}")
        if self.maximum is not None:
            parts.append(f"at most {self.maximum:g}")
        return " and ".join(parts)

    def listed(self) -> dict[str, Any]:
        """The keywords of the schema that list the values one by one."""
        return {}

    def schema(self) -> dict[str, Any]:
        """A number in the range, or text."""
        bounds = {"minimum": self.minimum, "maximum": self.maximum, "exclusiveMinimum": self.above}
        return {
            "anyOf": [
                {"type": self.json_type, **_present(bounds), **self.listed()},
                {"type": "string", "description": "an expression"},
            ]
        }


@dataclass(frozen=True)
class Number(Ranged):
    """A finite number or an expression, within a range."""

    def check(self, value: Any, context: Context) -> float:
        """Calculate and compare with the range."""
        return self.calculated(value, context)


@dataclass(frozen=True)
class Whole(Ranged):
    """A whole number within a range, or one of a few choices; 1e6 and expressions are allowed."""

    json_type: ClassVar[str] = "integer"
    choices: tuple[int, ...] = ()

    def check(self, value: Any, context: Context) -> int:
        """Calculate and refuse a fraction."""
        number = self.calculated(value, context)
        if number != math.floor(number):
            raise Wrong(f"{shown(number)} is not a whole number")
        if self.choices and number not in self.choices:
            raise Wrong(f"{shown(number)} is not allowed, must be {' or '.join(map(str, self.choices))}")
        return int(value) if isinstance(value, int) else int(number)

    def listed(self) -> dict[str, Any]:
        """The choices, if there are any."""
        return {"enum": list(self.choices)} if self.choices else {}


@dataclass(frozen=True)
class Flag(Field):
    """A field that is true or false."""

    def check(self, value: Any, context: Context) -> bool:
        """Refuse everything else."""
        if not isinstance(value, bool):
            raise Wrong(f"must be true or false, not {shown(value)}")
        return value

    def schema(self) -> dict[str, Any]:
        """A boolean."""
        return {"type": "boolean"}


@dataclass(frozen=True)
class Text(Field):
    """A text, or one of several words."""

    choices: tuple[str, ...] = ()

    def check(self, value: Any, context: Context) -> str:
        """Compare with the words."""
        if not isinstance(value, str):
            raise Wrong(f"must be text, not {shown(value)}" + ("" if isinstance(value, (dict, list)) else "; put it in quotes"))
        if self.choices and value not in self.choices:
            raise Wrong(f"{shown(value)} is unknown{choices(value, self.choices)}")
        return value

    def schema(self) -> dict[str, Any]:
        """A string."""
        return {"type": "string", "enum": list(self.choices)} if self.choices else {"type": "string"}


@dataclass(frozen=True)
class ListOf(Field):
    """A list of a fixed length, every item of one type; all faulty items are reported."""

    item: Field
    lengths: tuple[int, ...] = (3,)
    what: str = "numbers"

    def check(self, value: Any, context: Context) -> tuple[Any, ...]:
        """Check every item."""
        if not isinstance(value, list) or len(value) not in self.lengths:
            count = " or ".join(map(str, self.lengths))
            if len(self.lengths) > 3:
                count = f"{self.lengths[0]} to {self.lengths[-1]}"
            apart = isinstance(value, list) and any(isinstance(each, str) and ";" in each for each in value)
            hint = "; commas separate the entries" if apart else ""
            raise Wrong(f"must be a list of {count} {self.what}, not {shown(value)}{hint}")
        wrong = Wrong("")
        items = []
        for index, entry in enumerate(value):
            try:
                items.append(self.item.check(entry, context))
            except Wrong as inner:
                wrong.parts += [((index, *path), offset, message) for path, offset, message in inner.parts]
                wrong.parts += [] if inner.parts else [((), None, "")]
        if wrong.parts:
            raise wrong
        return tuple(items)

    def schema(self) -> dict[str, Any]:
        """An array."""
        return {"type": "array", "items": self.item.schema(), "minItems": min(self.lengths), "maxItems": max(self.lengths)}


@dataclass(frozen=True)
class InSpace(Field):
    """A vector in the scene's space: with `dimensions: 2`, two components are enough and a third must be 0."""

    item: Field

    def check(self, value: Any, context: Context) -> tuple[Any, ...]:
        """Check the components, and add the third one in the plane."""
        flat = context.dimensions == 2
        vector = ListOf(self.item, (2, 3) if flat else (3,)).check(value, context)
        if flat and len(vector) == 3 and not is_zero(vector[2]):
            raise Wrong(f"must be 0 in a scene of dimensions: 2, not {shown(value[2])}", path=(2,))
        return vector if len(vector) == 3 else (*vector, self.item.check(0.0, context))

    def schema(self) -> dict[str, Any]:
        """An array of two or three."""
        return ListOf(self.item, (2, 3)).schema()


@dataclass(frozen=True)
class Axes(Field):
    """true or false for every axis, or one for all."""

    def check(self, value: Any, context: Context) -> tuple[bool, ...]:
        """Spread one value over the axes; the third axis of a flat scene is free."""
        if isinstance(value, bool):
            return (value, value, value)
        lengths = (2, 3) if context.dimensions == 2 else (3,)
        axes = ListOf(Flag(), lengths, "of true and false").check(value, context)
        return axes if len(axes) == 3 else (*axes, True)

    def schema(self) -> dict[str, Any]:
        """A boolean or an array of them."""
        return {"anyOf": [{"type": "boolean"}, ListOf(Flag(), (2, 3)).schema()]}


@dataclass(frozen=True)
class Counts(Field):
    """Counts along one, two or three axes, filled up with 1."""

    def check(self, value: Any, context: Context) -> tuple[int, ...]:
        """Fill up to three axes."""
        counts = ListOf(Whole(minimum=1), (1, 2, 3), "counts").check(value, context)
        return (*counts, 1, 1)[:3]

    def schema(self) -> dict[str, Any]:
        """An array of integers."""
        return ListOf(Whole(minimum=1), (1, 2, 3)).schema()


@dataclass(frozen=True)
class Settings(Field):
    """A mapping of paths to values; the values are checked with the scene that they are set in (timeline.py)."""

    optional: bool = False  # whether an empty mapping is allowed

    def check(self, value: Any, context: Context) -> dict[str, Any] | None:
        """Refuse a value that is no mapping, and an empty mapping where it is not allowed."""
        if self.optional and value in (None, {}):
            return None
        if not isinstance(value, dict) or not value:
            raise Wrong(f"must be a mapping of paths to values, not {shown(value) if value else 'nothing'}")
        return value

    def schema(self) -> dict[str, Any]:
        """Any mapping."""
        if self.optional:
            return {"anyOf": [{"type": "object"}, {"type": "null"}]}
        return {"type": "object", "minProperties": 1}


@dataclass(frozen=True)
class Reference(Field):
    """A particle given by index or name; references.py finds its index after all particles are counted."""

    def check(self, value: Any, context: Context) -> int | str:
        """Check the form."""
        if isinstance(value, bool) or not isinstance(value, (int, str)):
            raise Wrong(f"must be a particle's index or name, not {shown(value)}")
        return value

    def schema(self) -> dict[str, Any]:
        """An integer or a string."""
        return {"anyOf": [{"type": "integer", "minimum": 0}, {"type": "string"}]}


@dataclass(frozen=True)
class FileBeside(Field):
    """A file in the scene's folder or below it, links resolved; the value is its full path."""

    def check(self, value: Any, context: Context) -> str:
        """Find the file, and refuse a file outside the folder."""
        name = Text().check(value, context)
        try:
            root = context.folder.resolve()
            path = (root / name).resolve()
            inside, exists = path.is_relative_to(root), path.is_file()
        except (OSError, ValueError, RuntimeError):
            inside, exists = True, False
        if not inside:
            raise Wrong(f"{shown(name)} is outside the scene's folder, allowed: files in that folder and below")
        if not exists:
            raise Wrong(f"there is no file {shown(name)} beside the scene")
        return str(path)

    def schema(self) -> dict[str, Any]:
        """A string."""
        return {"type": "string"}


class OneOrMore:
    """A list whose only entry may be given without the list."""

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        """Make the list before it is checked."""
        return core_schema.no_info_before_validator_function(_as_list, handler(source))

    def __get_pydantic_json_schema__(self, core: Any, handler: Any) -> dict[str, Any]:
        """The schema of one entry, or of a list of entries."""
        many = handler(core)
        return {"anyOf": [many["items"], many]}


def _as_list(value: Any) -> Any:
    return value if isinstance(value, list) else [value]


@dataclass(frozen=True)
class PerParticle(Field):
    """A Formula: a number or an expression over constants and the names a generator offers."""

    names: tuple[str, ...]

    def check(self, value: Any, context: Context) -> Formula:
        """Check every name now; the values are computed when the particles are placed."""
        if not isinstance(value, str):
            value = repr(calculate(value, context))
        try:
            expression = parse(value)
            expression.check_names({*context.constants, *self.names})
        except ExpressionError as error:
            raise Wrong(str(error), offset=error.offset) from None
        if ambiguous := sorted(expression.names & set(self.names) & set(context.constants)):
            raise Wrong(f"{ambiguous[0]} is both a constant and a value of each particle here, rename the constant")
        values = {name: context.constants[name] for name in expression.names - set(self.names)}
        constants = {name: value for name, value in values.items() if value is not None}
        if len(constants) < len(values):
            raise Wrong("")  # reported where the constant is defined
        return Formula(expression, constants)

    def schema(self) -> dict[str, Any]:
        """A number or text."""
        description = f"an expression over {', '.join(self.names)}" if self.names else "an expression"
        return {"anyOf": [{"type": "number"}, {"type": "string", "description": description}]}


def is_zero(component: Any) -> bool:
    """Whether a number, or an expression, is written as 0."""
    return component == 0.0 if isinstance(component, float) else str(component.expression.text) in ("0", "0.0", "-0.0")


def _present(entries: dict[str, Any]) -> dict[str, Any]:
    return {key: value for key, value in entries.items() if value is not None}
