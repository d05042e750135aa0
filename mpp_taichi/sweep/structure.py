"""Structure: which members can share one compiled step and one launch, and which must be run one after the other."""

import hashlib
from collections.abc import Hashable, Iterator, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from mpp_taichi import component
from mpp_taichi.contacts.events.grid import Grid
from mpp_taichi.scene.formulas.fields import FormulaText
from mpp_taichi.scene.formulas.laws import movable
from mpp_taichi.scene.periodic_forces import acts_across_faces
from mpp_taichi.scene.spec import ComponentSpec, SceneSpec
from mpp_taichi.scene.tree_checks import tree_of
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.start.contact_setup import contact_setup

Own = frozenset[tuple[str, str]]
SHARED_ARRAYS = ("radius", "free", "color")
"""Arrays of particles that all replicas share; positions, velocities, masses, charges and springs are their own."""


def with_own(spec: SceneSpec, own: Own) -> SceneSpec:
    """The scene whose forces load the parameters in `own` from a field, so that each replica can have its own values."""
    names = {force: tuple(sorted(parameter for name, parameter in own if name == force)) for force, _ in own}
    return replace(spec, forces=tuple(replace(entry, live=names.get(entry.label, ())) for entry in spec.forces))


def own_of(specs: Sequence[SceneSpec]) -> Own:
    """The parameters of forces, (force, parameter), in which these scenes differ, and which a kernel can load from a field."""
    found = set()
    for entry in specs[0].forces if _takes_own(specs[0]) else ():
        for name in (each.name for each in movable(entry)):
            values = [_value(spec, entry.label, name) for spec in specs]
            if any(value is not None and value != values[0] for value in values):
                found.add((entry.label, name))
    return frozenset(found)


def _takes_own(spec: SceneSpec) -> bool:
    names = [entry.label for entry in spec.forces]
    takes = component.flag("integrators", spec.integrator.name, "takes_sliders", True)
    return bool(takes) and len(set(names)) == len(names)


def _value(spec: SceneSpec, force: str, parameter: str) -> Any:
    return next((entry.parameters.get(parameter) for entry in spec.forces if entry.label == force), None)


def key_of(spec: SceneSpec, start: Snapshot, own: Own = frozenset()) -> Hashable:
    """All that is compiled into a step or stored once for all replicas: members with the same key can share a launch.

    `own` are the parameters of forces of which each replica has its own value.
    """
    entries = []
    for kind, entry in _entries(spec):
        told = {name: value for name, value in entry.parameters.items() if kind != "forces" or (entry.label, name) not in own}
        entries.append((kind, entry.name, _told(told)))
    arrays = [getattr(start, name) for name in SHARED_ARRAYS]
    arrays += [start.springs.between, np.array([bool((start.springs.damping != 0.0).any())])]
    arrays += [start.rods.between, start.rods.length, start.mass > 0.0]
    measures = () if spec.sweep is None else tuple((each.quantity, _told(each.parameters)) for each in spec.sweep.measure)
    return (spec.dimensions, spec.spring_damping, _told(vars(spec.run)), tuple(entries), measures, _digest(arrays))


def _digest(arrays: Sequence[np.ndarray]) -> str:
    digest = hashlib.sha256()
    for array in arrays:
        digest.update(str(array.shape).encode())
        digest.update(np.ascontiguousarray(array).tobytes())
    return digest.hexdigest()


def key_alone(spec: SceneSpec, start: Snapshot) -> Hashable | None:
    """All but places, velocities, and restitutions that a solver takes: members with this key use one simulation in turn.

    None where what is compiled follows from more than that, and each member is compiled by itself.
    """
    if spec.timeline or tree_of(spec) is not None or acts_across_faces(spec):
        return None
    arrays = [start.mass, start.charge, *(getattr(start.springs, name) for name in ("stiffness", "damping", "rest_length"))]
    contacts = spec.contacts
    bounces: tuple[Any, ...] = ()
    if contacts is not None:
        pairs, parameters = contacts.pairs, contacts.solver.parameters
        own = component.flag("contacts", contacts.solver.name, "takes_restitution")
        told = {name: value for name, value in parameters.items() if not (own and name == "restitution")}
        between = tuple((pair.between, None if own else pair.restitution) for pair in pairs)
        bounces = (contacts.solver.name, _told(told), between)
        if component.flag("contacts", contacts.solver.name, "flies"):  # contacts are searched from cell to cell of a grid
            grid = Grid.around(contact_setup(spec, start), start.position[:, : spec.dimensions])
            bounces += (grid.low, grid.edge, grid.cells, tuple(grid.big.tolist()))
    return ("alone", key_of(spec, start), bounces, _digest(arrays))


def why_alone(spec: SceneSpec) -> str:
    """Why members of this scene are run one after the other, in processes; empty where they run side by side as replicas."""
    if spec.contacts is not None:
        return "collisions are resolved for one copy at a time"
    if spec.timeline:
        return "a timeline changes the step while it runs"
    if tree_of(spec) is not None:
        return "a tree is built by all threads for one copy"
    if acts_across_faces(spec):
        return "lists of neighbours are made by all threads for one copy"
    if spec.driven_entries:
        return "bodies on a path are moved for one copy at a time"
    if spec.changing_entries:
        return "masses and charges that change are set for one copy at a time"
    if spec.rigid_entries:
        return "rods are solved for one copy at a time"
    if spec.forces_with("gathers"):
        return "a force that first sums over all particles, such as the area inside a skin, sums over one copy"
    if spec.limited_springs:
        return "springs break and yield in one copy at a time"
    return ""


def _entries(spec: SceneSpec) -> Iterator[tuple[str, ComponentSpec]]:
    yield "integrator", spec.integrator
    for kind in ("forces", "walls"):
        for entry in getattr(spec, kind):
            yield kind, entry
    for number, entry in spec.driven_entries:  # the path, with its constants, is compiled into the step
        yield "path", replace(entry, parameters={"number": number, "path": entry.parameters["path"]})
    for number, entry, quantity in spec.changing_entries:
        kept = {key: entry.parameters[key] for key in (quantity, f"{quantity}_factor")}
        yield quantity, replace(entry, parameters={"number": number, **kept})


def _told(parameters: dict[str, Any]) -> str:
    return repr(sorted((name, _with_constants(value)) for name, value in parameters.items()))


def _with_constants(value: Any) -> Any:
    """A parameter, of which formulas tell the constants of the scene that are compiled into the step with them."""
    if isinstance(value, FormulaText):
        return str(value), tuple(sorted(value.constants.items()))
    return tuple(map(_with_constants, value)) if isinstance(value, (tuple, list)) else value
