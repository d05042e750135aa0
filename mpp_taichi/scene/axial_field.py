"""The check of a vector along the axis of a turn or of a magnetic field."""

from dataclasses import dataclass
from typing import Any

from mpp_taichi.scene.faults import shown
from mpp_taichi.scene.fields import Context, Field, ListOf, Wrong, is_zero


@dataclass(frozen=True)
class AlongAxis(Field):
    """A vector along the axis of a turn or a magnetic field: with `dimensions: 2` it is across the plane, or a number."""

    item: Field

    def check(self, value: Any, context: Context) -> tuple[Any, ...]:
        """Check the components, of which only the third may differ from 0 in the plane."""
        flat = context.dimensions == 2
        if flat and not isinstance(value, list):
            return (0.0, 0.0, self.item.check(value, context))
        vector = ListOf(self.item, (3,)).check(value, context)
        for axis in range(2) if flat else ():
            if not is_zero(vector[axis]):
                raise Wrong(f"must be 0 in a scene of dimensions: 2, not {shown(value[axis])}", path=(axis,))
        return vector

    def schema(self) -> dict[str, Any]:
        """An array of three, or a number in the plane."""
        return {"anyOf": [self.item.schema(), ListOf(self.item, (3,)).schema()]}
