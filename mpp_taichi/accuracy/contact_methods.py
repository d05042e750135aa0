"""Contact solvers as methods of a study: on the drifts of a leapfrog, or in event-driven flight, which needs no step."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from mpp_taichi import component
from mpp_taichi.component import REQUIRED
from mpp_taichi.scene.spec import ComponentSpec, SceneSpec, default_integrator


def exact_solvers() -> list[str]:
    """The contact solvers that take no steps: their error is round-off, and they are the reference of all others."""
    return component.marked("contacts", "flies")


def orders() -> dict[str, int]:
    """The contact solvers that a study compares, each with the order of its error in dt; 0 for solvers that take no steps.

    The kicks before and after a drift are the kicks of a leapfrog. A solver that finds the time of an impact exactly keeps the
    order 2; a solver that finds it to within a step has the order 1. The highest order comes first.
    """
    found = {name: component.flag("contacts", name, "order") for name in component.names("contacts")}
    known = [name for name, order in found.items() if order is not None]
    return {name: found[name] for name in sorted(known, key=lambda name: -found[name])}


def flies_exactly(spec: SceneSpec) -> bool:
    """Whether the scene can be run without steps: no effect but contacts and uniform gravity, which a leapfrog solves too."""
    return not spec.springs and all(force.flag("forces", "is_uniform") for force in spec.forces)


def solvers(scenes: Sequence[SceneSpec], own: str) -> list[str]:
    """The contact solvers that can run a scene with contacts in all its phases, the scene's `own` solver first."""
    exact = exact_solvers()
    others = [name for name in orders() if name not in exact]
    return list(dict.fromkeys((own, *others, *(exact if all(map(flies_exactly, scenes)) else []))))


def with_solver(spec: SceneSpec, name: str, dt: float) -> SceneSpec:
    """The scene with a contact solver and a step; parameters that both solvers have are taken from the scene's own solver.

    A phase without contacts has the steps of the leapfrog on whose drifts the contacts of other phases are resolved.
    """
    integrator = spec.integrator
    forward = integrator.name if integrator.flag("integrators", "moves_forward_alone") else default_integrator()
    if spec.contacts is None:
        return replace(spec, integrator=ComponentSpec(forward, {"dt": dt}, integrator.location))
    own = spec.contacts.solver
    if own.name != name:
        declared = component.declaration("contacts", name).parameters
        parameters: dict[str, Any] = {}
        for parameter in declared:
            if parameter.name in own.parameters or parameter.default is not REQUIRED:
                parameters[parameter.name] = own.parameters.get(parameter.name, parameter.default)
        own = ComponentSpec(name, parameters, own.location)
    made = ComponentSpec(name if name in exact_solvers() else forward, {"dt": dt}, integrator.location)
    return replace(spec, contacts=replace(spec.contacts, solver=own), integrator=made)
