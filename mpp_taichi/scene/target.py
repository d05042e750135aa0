"""Target: the error that a scene may have, from which its integrator, step and precision are chosen."""

from dataclasses import dataclass
from typing import Any

from mpp_taichi.scene.fields import Context, Field, Number, Text, Wrong

LARGEST = 0.1
QUANTITIES = ("position", "energy")
FORMS = "must be a number, {position: number}, {energy: number} or {of: quantity, below: number}"


@dataclass(frozen=True)
class TargetSpec:
    """`accuracy: 1e-6`, an error of one of QUANTITIES; None means positions at the end, where chaos has left them a meaning.

    Errors are relative: of positions to the size of the system, of the energy to |E₀|; the largest over particles and times.

    of   the name of a quantity as `expect:` has it, in place of one of QUANTITIES; see `scene.wanted`
    """

    error: float
    quantity: str | None = None
    of: str | None = None

    @property
    def asked(self) -> str | None:
        """The quantity that the scene names, or None."""
        return self.of or self.quantity


class QuantityName(Field):
    """The name of a quantity, without its parameters."""

    text = Text()

    def check(self, value: Any, context: Context) -> str:
        """Refuse a quantity with its parameters, which stand elsewhere."""
        if isinstance(value, dict) and value:
            name = next(iter(value))
            raise Wrong(f"must be a name: write of: {name}, and the parameters into expect:, as in expect: {{{name}: {{…}}}}")
        return self.text.check(value, context)

    def schema(self) -> dict[str, Any]:
        """A string."""
        return self.text.schema()


class Target(Field):
    """A number, {position: number}, {energy: number}, or {of: name of a quantity, below: number}."""

    number = Number(above=0.0, maximum=LARGEST)
    name = QuantityName()

    def check(self, value: Any, context: Context) -> TargetSpec:
        """Check the number and the quantity; the name of a quantity of `expect:` is checked together with `expect:`."""
        if not isinstance(value, dict):
            return TargetSpec(self.number.check(value, context))
        if set(value) == {"of", "below"}:
            name = self._part("of", self.name, value, context)
            return TargetSpec(self._part("below", self.number, value, context), of=name)
        if len(value) != 1 or next(iter(value)) not in QUANTITIES:
            raise Wrong(FORMS)
        ((quantity, _),) = value.items()
        return TargetSpec(self._part(quantity, self.number, value, context), quantity)

    @staticmethod
    def _part(key: str, field: Field, value: dict[str, Any], context: Context) -> Any:
        """The checked value of a key, whose fault is placed at the key."""
        try:
            return field.check(value[key], context)
        except Wrong as wrong:
            located = Wrong("")
            located.parts += [((key, *path), offset, message) for path, offset, message in wrong.parts]
            raise located from None

    def schema(self) -> dict[str, Any]:
        """A number, or a mapping with one."""
        number = self.number.schema()
        each = [
            {"type": "object", "properties": {name: number}, "required": [name], "additionalProperties": False}
            for name in QUANTITIES
        ]
        parts = {"of": self.name.schema(), "below": number}
        each.append({"type": "object", "properties": parts, "required": list(parts), "additionalProperties": False})
        return {"anyOf": [*number["anyOf"], *each]}
