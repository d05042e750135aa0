"""A field that is switched on and off, or says more than that."""

from dataclasses import dataclass
from typing import Any

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
