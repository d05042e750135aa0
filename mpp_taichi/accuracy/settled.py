"""Settled: a scene with a chosen method and step in place of its target, as a specification and as plain data."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from mpp_taichi import component
from mpp_taichi.accuracy.contact_methods import exact_solvers
from mpp_taichi.accuracy.problem import Problem, with_integrator
from mpp_taichi.accuracy.stretches import legs
from mpp_taichi.scene import overrides
from mpp_taichi.scene.contacts import COMMON_KEYS
from mpp_taichi.scene.spec import ComponentSpec, Event, SceneSpec
from mpp_taichi.scene.tree_checks import tree_of
from mpp_taichi.simulation.course import phases_of

METHOD_KEYS = ("integrator", "contacts")
"""Keys of a scene that hold its methods; events of a timeline may set them, and the choice replaces what they set."""


def settled(spec: SceneSpec, method: str, dt: float, span: float, asked: Mapping[str, Any]) -> SceneSpec:
    """The scene with a method and the parameters `asked` of it, without a target; `dt` is the mean step of a run of `span`.

    In every phase of a timeline the step is the length of the phase over a whole number of steps, as in the pilot runs.
    """
    if not spec.timeline:
        made = with_integrator(spec, method, dt, **asked)
        return replace(made, resolved=_resolved(spec, made, _entries(made)))
    phases = phases_of(spec)
    problem = Problem(spec, phases[0].particles, span, phases)
    steps = {phase: dt for phase in range(len(phases))}
    if not asked and not _flies(problem, method):
        steps |= {leg.stretch.number: leg.dt for leg in legs(problem.stretches, round(span / dt))}
    parts = [
        with_integrator(phase.spec, method, steps[number], by_contacts=problem.compares_solvers, **asked)
        for number, phase in enumerate(phases)
    ]
    events = []
    for event, part in zip(spec.timeline, parts[1:], strict=True):
        kept = {path: value for path, value in event.changes.items() if _key(path) not in METHOD_KEYS}
        gone = {"contacts": None} if problem.has_contacts else {}
        events.append(replace(event, scene=part, changes={**kept, **gone, **_entries(part)}))
    made = replace(parts[0], timeline=tuple(events))
    return replace(made, resolved=_resolved(spec, made, _entries(made)))


def _flies(problem: Problem, method: str) -> bool:
    return problem.has_contacts and method in exact_solvers()


def _key(path: str) -> str:
    """The first key of a path of an event."""
    return str(overrides.steps(path.removeprefix("+").strip())[0])


def _entries(made: SceneSpec) -> dict[str, Any]:
    """The methods of a phase as the scene says them."""
    parameters = {key: value for key, value in made.integrator.parameters.items() if value is not None}
    found: dict[str, Any] = {"integrator": {made.integrator.name: parameters}}
    if made.contacts is not None:
        found["contacts"] = {"hard_spheres": _spheres(made)}
    return found


def _spheres(made: SceneSpec) -> dict[str, Any]:
    """The contacts of a phase, with the references to bodies that the scene has written."""
    assert made.contacts is not None
    solver, said = made.contacts.solver, made.resolved["contacts"]["hard_spheres"]
    common = {key: said[key] for key in COMMON_KEYS if key in said and key != "solver"}
    declared = component.declaration("contacts", solver.name).parameters
    given = {each.name: said[each.name] for each in declared if each.name in said}
    return {"solver": solver.name, **given, **common}


def _resolved(spec: SceneSpec, made: SceneSpec, entries: Mapping[str, Any]) -> dict[str, Any]:
    """The scene as plain data."""
    resolved = {key: value for key, value in spec.resolved.items() if key != "accuracy"} | dict(entries)
    if tree_of(made) is not None or tree_of(spec) is not None:
        resolved["forces"] = [_with_solver(entry, made.forces) for entry in resolved["forces"]]
    if made.timeline:
        resolved["timeline"] = [_written(event) for event in made.timeline]
    return resolved


def _written(event: Event) -> dict[str, Any]:
    return {"at": event.at, "set": event.changes}


def _with_solver(entry: Any, forces: Sequence[ComponentSpec]) -> Any:
    """The entry of a force in the scene, with the solver that was chosen for gravity."""
    name = next(iter(entry)) if isinstance(entry, Mapping) else entry
    force = next((force for force in forces if force.name == name), None)
    if force is None or not force.flag("forces", "can_use_tree"):
        return entry
    said = (entry.get(force.name) or {}) if isinstance(entry, Mapping) else {}
    given = {key: value for key, value in said.items() if key not in ("solver", "accuracy")}
    chosen = {key: force.parameters[key] for key in ("solver", "accuracy") if force.parameters.get(key) is not None}
    return {force.name: {**given, **chosen}}
