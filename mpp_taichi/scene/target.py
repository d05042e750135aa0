"""Target: the error that a scene may have, from which its integrator, step and precision are chosen."""

from dataclasses import dataclass
from typing import Any

from mpp_taichi.scene.fields import Context, Field, Number, Wrong

LARGEST = 0.1
QUANTITIES = ("position", "energy")


@dataclass(frozen=True)
class TargetSpec:
    """`accuracy: 1e-6`, an error of one of QUANTITIES; None means positions at the end, where chaos has left them a meaning.

    Errors are relative: of positions to the size of the system, of the energy to |E₀|; the largest over particles and times.
    """

    error: float
    quantity: str | None = None


class Target(Field):
    """A number, or {position: number}, or {energy: number}."""

    number = Number(above=0.0, maximum=LARGEST)

    def check(self, value: Any, context: Context) -> TargetSpec:
        """Check the number and the quantity."""
        if not isinstance(value, dict):
            return TargetSpec(self.number.check(value, context))
        if len(value) != 1 or next(iter(value)) not in QUANTITIES:
            raise Wrong("must be a number, {position: number} or {energy: number}")
        ((quantity, error),) = value.items()
        return TargetSpec(self.number.check(error, context), quantity)

    def schema(self) -> dict[str, Any]:
        """A number, or a mapping with one."""
        number = self.number.schema()
        each = [
            {"type": "object", "properties": {name: number}, "required": [name], "additionalProperties": False}
            for name in QUANTITIES
        ]
        return {"anyOf": [*number["anyOf"], *each]}
