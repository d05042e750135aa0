"""Expectations: the statements of physics that a scene makes about itself, and `check` asserts."""

from collections.abc import Iterator, Mapping
from typing import Annotated, Any

from pydantic import Field as Describe

from mpp_taichi import component
from mpp_taichi.scene.document import Node
from mpp_taichi.scene.faults import Faults
from mpp_taichi.scene.fields import Number, Text
from mpp_taichi.scene.spec import Expectation

# Quantities that every run measures, so that no diagnostic of their name is needed.
SUMMARY_QUANTITIES = {
    "relative_energy_error_max": "largest change of the total energy over the energy at the start; friction and drives count",
    "total_energy_initial": "kinetic and potential energy at the start [energy]; a wrong strength of a force changes it",
    "conserved_energy_error_max": "the same change in the phases of a timeline in which every force has a potential",
    "momentum_error_max": "largest change of the total momentum, relative to Σ of the sizes of m v",
    "angular_momentum_error_max": "largest change of the total angular momentum, relative to Σ of the sizes of r × m v",
    "center_of_mass_error_max": "largest distance of the centre of mass from uniform motion, relative to the system's size",
    "energy_balance_error_max": "largest change of energy + dissipated − work, relative to the energy turned over",
    "dissipated_energy": "energy dissipated by drag, the damping of springs, and contacts",
    "work": "work of driving forces, and the change of the potential energy by merging",
    "steps": "steps done",
    "time": "time reached",
}
BALANCE_QUANTITIES = frozenset({"energy_balance_error_max", "dissipated_energy", "work"})
"""The quantities among them for which an energy balance is kept."""
BOUNDS = ("below", "above", "near", "within")
REDUCTIONS = ("end", "largest", "smallest", "mean")
REDUCTION_DEFAULTS: Mapping[str, Any] = {"when": "end", "at": None, "after": None, "until": None}
_TIME = Number(minimum=0.0)
REDUCTION_FIELDS: Mapping[str, Any] = {
    "when": (
        Annotated[Any, Text(REDUCTIONS)],
        Describe(
            "end", description="value of the run that is compared: at the end, the largest, the smallest, or the mean over time"
        ),
    ),
    "at": (
        Annotated[Any, _TIME],
        Describe(
            None,
            description="the value at this time: between two samples on a cubic where the rate is known (position, distance, "
            "mode_amplitude), else of the first sample from this time on",
        ),
    ),
    "after": (
        Annotated[Any, _TIME],
        Describe(None, description="time from which the largest, smallest or mean value is taken"),
    ),
    "until": (
        Annotated[Any, _TIME],
        Describe(None, description="the first sample from this time on is the last; absent: the end of the run"),
    ),
}


def kind_of(name: str) -> str | None:
    """The kind of component that a key of `expect:` names; None where every run measures it, or there is none."""
    if name in SUMMARY_QUANTITIES:
        return None
    return next((kind for kind in ("diagnostics", "quantities") if component.find_file(kind, name) is not None), None)


def names() -> list[str]:
    """Every key that `expect:` may have."""
    return sorted({*SUMMARY_QUANTITIES, *component.names("diagnostics"), *component.names("quantities")})


def reduction_keys(quantity: str) -> dict[str, Any]:
    """The keys that say which value of a quantity along the run is meant, and their defaults.

    A parameter of the quantity takes the place of a key of the same name.
    """
    own = {parameter.name for parameter in component.declaration("quantities", quantity).parameters}
    return {key: default for key, default in REDUCTION_DEFAULTS.items() if key not in own}


def reduction_fields(quantity: str) -> dict[str, Any]:
    """The fields of these keys for a pydantic model."""
    return {key: REDUCTION_FIELDS[key] for key in reduction_keys(quantity)}


def build(validated: Any, node: Node | None, faults: Faults) -> tuple[Expectation, ...]:
    """Expectations from the checked `expect:` block; `node` gives their places."""
    found: list[Expectation] = []
    if validated is None or node is None:
        return ()
    for quantity in node.value:  # in the order of the scene
        for number, entry in enumerate(getattr(validated, quantity)):
            values = {name: getattr(entry, name) for name in type(entry).model_fields}
            bounds = {name: values.pop(name) for name in BOUNDS}
            place = node.value[quantity]
            if isinstance(place.value, list):
                place = place.value[number]
            for key, message in conflicts(quantity, values):
                key_node = place.get(key)
                faults.add((place if key_node is None else key_node).place, f"expect.{quantity}.{key}", message)
            found.append(Expectation(quantity, values, location=place.place, **bounds))
    return tuple(sorted(found, key=lambda expectation: (expectation.location.line, expectation.location.column)))


def conflicts(quantity: str, values: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """Keys of the reduction that cannot stand together, and why."""
    if kind_of(quantity) != "quantities":
        return
    keys = reduction_keys(quantity)
    given = {key: values[key] for key, default in keys.items() if values[key] != default}
    if "at" in given:
        for key in given.keys() - {"at"}:
            yield key, "cannot be beside at:, which names the one moment"
    elif "after" in given and values["when"] == "end":
        yield "after", "belongs to when: largest, smallest or mean; for the value at a time there is at:"
    if given.get("after") is not None and given.get("until") is not None and given["after"] >= given["until"]:
        yield "until", f"must be later than after:, {given['after']:g}"
