"""Contact solvers as methods of a study: on the drifts of a leapfrog, or in event-driven flight, which needs no step."""

from dataclasses import replace
from typing import Any

from mpp_taichi import component
from mpp_taichi.component import REQUIRED
from mpp_taichi.scene.contacts import DRIFTING
from mpp_taichi.scene.spec import ComponentSpec, SceneSpec

EXACT = "event_driven"
# Order in dt, by which steps are spaced: the kicks around a drift are those of a leapfrog, and an impact is met exactly by the
# first two; the others are at best right to within a step.
ORDERS = {"swept": 2, "simultaneous": 2, "pairwise": 1, "resting": 1}


def flies_exactly(spec: SceneSpec) -> bool:
    """Whether the scene can be run without steps: spheres under uniform gravity at most."""
    return spec.contacts is not None and not spec.springs and all(force.name == "uniform_gravity" for force in spec.forces)


def solvers(spec: SceneSpec) -> list[str]:
    """Those that can run a scene with contacts, its own first."""
    assert spec.contacts is not None
    others = [*ORDERS, *([EXACT] if flies_exactly(spec) else [])]
    return list(dict.fromkeys((spec.contacts.solver.name, *others)))


def with_solver(spec: SceneSpec, name: str, dt: float) -> SceneSpec:
    """The scene with a contact solver and a step; what solvers have in common is taken from the scene's own."""
    assert spec.contacts is not None
    own, integrator = spec.contacts.solver, spec.integrator
    if own.name != name:
        declared = component.declaration("contacts", name).parameters
        parameters: dict[str, Any] = {}
        for parameter in declared:
            if parameter.name in own.parameters or parameter.default is not REQUIRED:
                parameters[parameter.name] = own.parameters.get(parameter.name, parameter.default)
        own = ComponentSpec(name, parameters, own.location)
    stepped = integrator.name if integrator.name in DRIFTING else "leapfrog"
    made = ComponentSpec(EXACT if name == EXACT else stepped, {"dt": dt}, integrator.location)
    return replace(spec, contacts=replace(spec.contacts, solver=own), integrator=made)
