"""Four particles in a row, between which a dihedral angle is measured, as a scene names them."""

from dataclasses import dataclass
from typing import Any

from mpp_taichi.errors import PlacementError
from mpp_taichi.scene.fields import Context, Field, ListOf, Reference

Group = tuple[int, int]
"""First index and count."""


@dataclass(frozen=True)
class FourInRow(Field):
    """A list of four particles, or of four groups of one size; or a group, whose particles are a chain in their order."""

    def check(self, value: Any, context: Context) -> Any:
        """Check the form."""
        return self._four.check(value, context) if isinstance(value, list) else Reference().check(value, context)

    def schema(self) -> dict[str, Any]:
        """An integer, a string, or an array of four of them."""
        return {"anyOf": [*Reference().schema()["anyOf"], self._four.schema()]}

    @property
    def _four(self) -> ListOf:
        return ListOf(Reference(), (4,), "particles or groups")


def four_of_chain(chain: Group) -> tuple[Group, ...]:
    """The groups of all four in a row of a chain.

    Raises:
        PlacementError: the chain has fewer than four particles.
    """
    first, count = chain
    if count < 4:
        what = "is one particle" if count == 1 else f"has {count} particles"
        raise PlacementError(f"{what}, must be a chain of four or more, or a list of four")
    return tuple((first + place, count - 3) for place in range(4))


def checked_four(groups: tuple[Group, ...]) -> tuple[Group, ...]:
    """The same four groups.

    Raises:
        PlacementError: they have different sizes, or one particle is twice among four in a row.
    """
    counts = [count for _, count in groups]
    if len(set(counts)) > 1:
        raise PlacementError(f"the four have {', '.join(map(str, counts))} particles, must have equally many")
    if len({first for first, _ in groups}) < 4:
        raise PlacementError("one particle is twice among the four, must be four different particles")
    return groups
