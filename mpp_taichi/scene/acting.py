"""The forces that act: a force whose strength is zero is not compiled, and changes no bit of a run."""

from typing import Any

from mpp_taichi import component
from mpp_taichi.scene.spec import ComponentSpec


def acting(forces: tuple[ComponentSpec, ...]) -> tuple[ComponentSpec, ...]:
    """The forces whose strength is not zero, or is moved by a slider."""
    return tuple(entry for entry in forces if entry.live or not is_switched_off(entry))


def is_switched_off(force: ComponentSpec) -> bool:
    """Whether a parameter that the force is proportional to is zero."""
    strengths = [each.name for each in component.declaration("forces", force.name).parameters if each.strength]
    return any(_is_zero(force.parameters[name]) for name in strengths)


def _is_zero(value: Any) -> bool:
    return not any(value) if isinstance(value, tuple) else value == 0.0
