"""The check of `turning:` of a wall: the angle as a formula of the time, the point and the axis about which the wall turns."""

from dataclasses import dataclass
from typing import Any, NamedTuple

from mpp_taichi.scene.did_you_mean import choices
from mpp_taichi.scene.faults import shown
from mpp_taichi.scene.fields import Context, Field, InSpace, ListOf, Number, Wrong
from mpp_taichi.scene.formulas.fields import FormulaText, LawText

KEYS = ("angle", "about", "axis")


class Turning(NamedTuple):
    """A turning as a scene gives it.

    angle   formula of the time [rad]; counterclockwise where the axis points to the reader
    about   point of the axis, when the time is 0 [length]
    axis    direction of the axis, of any length
    """

    angle: FormulaText
    about: tuple[float, float, float]
    axis: tuple[float, float, float]


@dataclass(frozen=True)
class TurningField(Field):
    """A mapping with the keys `angle`, `about` and, in three dimensions, `axis`."""

    names: tuple[str, ...]

    def check(self, value: Any, context: Context) -> Turning | None:
        """Check every key, and fill in the absent ones."""
        if value is None:
            return None
        if not isinstance(value, dict):
            raise Wrong(f"must be a mapping with the keys angle, about and axis, not {shown(value)}")
        wrong, found = Wrong(""), {"about": (0.0, 0.0, 0.0), "axis": (0.0, 0.0, 1.0)}
        checks: dict[Any, Field] = {
            "angle": LawText(self.names),
            "about": InSpace(Number()),
            "axis": ListOf(Number(), (3,)),
        }
        for key, entry in value.items():
            try:
                if key not in checks:
                    raise Wrong(f"{shown(key)} is unknown{choices(key, KEYS)}", path=(key,))
                found[key] = checks[key].check(entry, context)
            except Wrong as inner:
                wrong.parts += [((key, *path) if key in checks else path, place, told) for path, place, told in inner.parts]
                wrong.parts += [] if inner.parts else [((), None, "")]
        if "angle" not in value:
            wrong.parts.append(((), None, "needs an angle, a formula of the time t, such as 2*t"))
        if "axis" in value and context.dimensions == 2:
            wrong.parts.append((("axis",), None, "is not needed in a scene of dimensions: 2, where walls turn in the plane"))
        elif not any(found["axis"]):
            wrong.parts.append((("axis",), None, "must not be [0, 0, 0]"))
        if wrong.parts:
            raise wrong
        return Turning(**found)  # type: ignore[arg-type]

    def schema(self) -> dict[str, Any]:
        """A mapping of the three keys, or nothing."""
        described = {
            "angle": LawText(self.names).schema() | {"description": "the angle as a formula of t [rad]"},
            "about": InSpace(Number()).schema() | {"description": "a point of the axis, when the time is 0 [length]"},
            "axis": ListOf(Number(), (3,)).schema() | {"description": "direction of the axis; absent: z"},
        }
        mapping = {"type": "object", "properties": described, "required": ["angle"], "additionalProperties": False}
        return {"anyOf": [mapping, {"type": "null"}]}
