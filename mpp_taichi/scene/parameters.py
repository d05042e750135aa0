"""Parameters: the fields of a pydantic model, made from the parameters that a component declares."""

from collections.abc import Iterable
from typing import Annotated, Any

from pydantic import ConfigDict
from pydantic import Field as Describe

from mpp_taichi.component import REQUIRED, Parameter
from mpp_taichi.scene import fields
from mpp_taichi.scene.axial_field import AlongAxis
from mpp_taichi.scene.colors import Color
from mpp_taichi.scene.fields import Field, Number, Text, Whole
from mpp_taichi.scene.formulas.fields import LawText, LawVector, Numbers
from mpp_taichi.scene.four_in_row import FourInRow
from mpp_taichi.scene.points import Points
from mpp_taichi.scene.turning_field import TurningField

STRICT = ConfigDict(defer_build=True, extra="forbid", frozen=True, arbitrary_types_allowed=True, protected_namespaces=())


def field_of(parameter: Parameter) -> Field:
    """The check of a parameter, by its declared type."""
    span = {"minimum": parameter.minimum, "maximum": parameter.maximum, "above": parameter.above}
    makers = {
        "float": lambda: Number(**span),
        "int": lambda: Whole(**span, choices=tuple(parameter.choices)),
        "bool": fields.Flag,
        "str": lambda: Text(tuple(parameter.choices)),
        "Vector": lambda: fields.InSpace(Number(**span)),
        "AxialVector": lambda: AlongAxis(Number(**span)),
        "Color": Color,
        "Axes": fields.Axes,
        "Shape": fields.Counts,
        "Formula": lambda: fields.PerParticle(tuple(parameter.names)),
        "FormulaVector": lambda: fields.InSpace(fields.PerParticle(tuple(parameter.names))),
        "Law": lambda: LawText(tuple(parameter.names), parameter.optional),
        "LawVector": lambda: LawVector(tuple(parameter.names)),
        "Numbers": Numbers,
        "Particle": fields.Reference,
        "Particles": fields.Reference,
        "Groups": lambda: fields.ListOf(fields.Reference(), (2,), "particles or groups"),
        "Pair": lambda: fields.ListOf(fields.Reference(), (2,), "particles"),
        "FourInRow": FourInRow,
        "Path": fields.FileBeside,
        "Lattice": Text,
        "ModeNumbers": fields.Counts,
        "Points": lambda: Points(Number(**span)),
        "Turning": lambda: TurningField(tuple(parameter.names)),
    }
    return makers[parameter.type]()


def parameter_fields(parameters: Iterable[Parameter]) -> dict[str, Any]:
    """Name → (type, description and default) for `create_model`."""
    found: dict[str, Any] = {}
    for parameter in parameters:
        description = " ".join(part for part in (parameter.help, f"[{parameter.unit}]" if parameter.unit else "") if part)
        options: dict[str, Any] = {"description": description or None}
        if parameter.default is REQUIRED:
            options["default"] = None if parameter.optional else ...
        else:
            options["default"] = _lists(parameter.default)
            options["validate_default"] = parameter.default is not None
        found[parameter.name] = (Annotated[Any, field_of(parameter)], Describe(**options))
    return found


def _lists(value: Any) -> Any:
    return [_lists(item) for item in value] if isinstance(value, (list, tuple)) else value
