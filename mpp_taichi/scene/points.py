"""A field that is a list of points."""

from dataclasses import dataclass
from typing import Any

from mpp_taichi.scene.faults import shown
from mpp_taichi.scene.fields import Context, Field, InSpace, ListOf, Wrong


@dataclass(frozen=True)
class Points(Field):
    """Any number of vectors in the scene's space."""

    item: Field

    def check(self, value: Any, context: Context) -> tuple[Any, ...]:
        """Check every vector."""
        if not isinstance(value, list):
            raise Wrong(f"must be a list of points, not {shown(value)}")
        return ListOf(InSpace(self.item), (len(value),), "points").check(value, context)

    def schema(self) -> dict[str, Any]:
        """An array of arrays."""
        return {"type": "array", "items": InSpace(self.item).schema()}


@dataclass(frozen=True)
class Pairs(Field):
    """Any number of pairs of numbers."""

    item: Field

    def check(self, value: Any, context: Context) -> tuple[Any, ...]:
        """Check every pair."""
        if not isinstance(value, list):
            raise Wrong(f"must be a list of points [x, y], not {shown(value)}")
        return ListOf(ListOf(self.item, (2,)), (len(value),), "points").check(value, context)

    def schema(self) -> dict[str, Any]:
        """An array of arrays of two."""
        return {"type": "array", "items": ListOf(self.item, (2,)).schema()}
