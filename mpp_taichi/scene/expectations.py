"""Expectations: the statements of physics that a scene makes about itself, and `check` asserts."""

from typing import Any

from mpp_taichi.scene.document import Node
from mpp_taichi.scene.spec import Expectation

# Quantities that every run measures, so that no diagnostic of their name is needed.
SUMMARY_QUANTITIES = {
    "relative_energy_error_max": "largest change of the total energy, relative to that at the start; friction and drives count",
    "total_energy_initial": "kinetic and potential energy at the start [energy]: a force of a wrong strength has another",
    "conserved_energy_error_max": "the same, of those phases of a timeline in which every force has a potential",
    "momentum_error_max": "largest change of the total momentum, relative to Σ of the sizes of m v",
    "angular_momentum_error_max": "largest change of the total angular momentum, relative to Σ of the sizes of r × m v",
    "center_of_mass_error_max": "largest distance of the centre of mass from uniform motion, relative to the system's size",
    "energy_balance_error_max": "largest change of energy + dissipated − work, relative to the energy turned over",
    "dissipated_energy": "energy that drag, the damping of springs and contacts took out",
    "work": "work of driving forces, and what merging changed of the potential energy",
    "steps": "steps done",
    "time": "time reached",
}
BALANCE_QUANTITIES = frozenset({"energy_balance_error_max", "dissipated_energy", "work"})
"""The quantities among them for which an energy balance is kept."""
BOUNDS = ("below", "above", "near", "within")


def build(validated: Any, node: Node | None) -> tuple[Expectation, ...]:
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
            found.append(Expectation(quantity, values, location=place.place, **bounds))
    return tuple(sorted(found, key=lambda expectation: (expectation.location.line, expectation.location.column)))
