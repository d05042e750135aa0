"""A field that is switched on and off, or says more than that."""

from dataclasses import dataclass
from typing import Any

from pydantic_core import PydanticCustomError, core_schema

from mpp_taichi.scene.faults import shown
from mpp_taichi.scene.fields import Context, Field


@dataclass(frozen=True)
class FlagOr(Field):
    """True, false, or a value of another field."""

    other: Field

    def check(self, value: Any, context: Context) -> Any:
        """Take true and false as they are."""
        return value if isinstance(value, bool) else self.other.check(value, context)

    def schema(self) -> dict[str, Any]:
        """A boolean, or the other value."""
        return {"anyOf": [{"type": "boolean"}, self.other.schema()]}


class FlagOrMapping:
    """A mapping of keys, or true for the mapping with all defaults; false and nothing are None."""

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        """Turn true and false into what they stand for before the mapping is checked."""
        return core_schema.no_info_before_validator_function(_as_mapping, handler(source))

    def __get_pydantic_json_schema__(self, core: Any, handler: Any) -> dict[str, Any]:
        """A boolean, or the schema of the mapping."""
        return {"anyOf": [{"type": "boolean"}, *handler(core)["anyOf"]]}


def _as_mapping(value: Any) -> Any:
    if isinstance(value, bool):
        return {} if value else None
    if value is not None and not isinstance(value, dict):
        reason = f"must be true, false or a mapping of keys, not {shown(value)}"
        raise PydanticCustomError("wrong", "{reason}", {"reason": reason, "parts": [((), None, reason)]})
    return value
