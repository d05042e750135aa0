"""Contacts: the model of `contacts: {hard_spheres: {solver: …}}`, and its checks against the other parts of a scene."""

from collections.abc import Sequence
from typing import Annotated, Any, Literal, Union

from pydantic import BaseModel, ConfigDict, create_model
from pydantic import Field as Describe

from mpp_taichi import component
from mpp_taichi.scene.document import Node
from mpp_taichi.scene.faults import Faults
from mpp_taichi.scene.fields import Field, Text
from mpp_taichi.scene.parameters import STRICT, parameter_fields
from mpp_taichi.scene.periodic_forces import acts_across_faces
from mpp_taichi.scene.spec import ComponentSpec, ContactsSpec, Location, PairSpec, SceneSpec

LOOKS = 1000  # in an event-driven run for which the scene gives no time between samples
COMMON_KEYS = ("solver", "pairs", "overlap")


def contacts_model(names: Sequence[str]) -> type[BaseModel]:
    """The model of `contacts:` for the selected solvers; without any, a model whose message lists the solvers."""
    bodies = [_solver_model(name) for name in names]
    if not bodies:
        solver: Any = (Annotated[Any, Text(tuple(component.names("contacts")))], Describe(description="the method"))
        bodies = [create_model("HardSpheres", __config__=ConfigDict(extra="ignore"), solver=solver)]
    spheres: Any = bodies[0] if len(bodies) == 1 else Annotated[Union[tuple(bodies)], Describe(discriminator="solver")]
    description = "spheres that do not overlap, by the particles' radii"
    return create_model(
        "Contacts",
        __config__=STRICT,
        __doc__="What happens where particles touch.",
        hard_spheres=(spheres, Describe(description=description)),
    )


def _solver_model(name: str) -> type[BaseModel]:
    declared = component.declaration("contacts", name)
    overlap = _word(("refuse", "separate"), "refuse", "a start with spheres in each other: refuse it, or push them apart")
    keys: dict[str, Any] = {"solver": (Literal[name], Describe(description="the method")), "overlap": overlap}
    if any(parameter.name == "restitution" for parameter in declared.parameters):
        pairs: Any = Describe([], description="pairs of particles or groups with a restitution of their own")
        keys["pairs"] = (list[PairSpec], pairs)
    summary = declared.summary.split("\n\n")[0]
    return create_model(
        f"{declared.class_name}Contacts", __config__=STRICT, __doc__=summary, **keys, **parameter_fields(declared.parameters)
    )


def _word(words: tuple[str, ...], default: str, description: str) -> Any:
    check: Field = Text(words)
    return (Annotated[Any, check], Describe(default, description=description))


def merges(spec: SceneSpec) -> bool:
    """Whether two spheres of a scene become one sphere where they touch."""
    return spec.contacts is not None and bool(spec.contacts.solver.flag("contacts", "merges"))


def fly(validated: Any) -> bool:
    """Whether validated contacts, or None, have a solver that moves the spheres itself, so that no integrator is needed."""
    return validated is not None and bool(component.flag("contacts", validated.hard_spheres.solver, "flies"))


def specification(validated: Any, node: Any) -> ContactsSpec | None:
    """The validated contacts as a specification; `node` is the node of `contacts:`."""
    if validated is None:
        return None
    spheres = validated.hard_spheres
    parameters = {key: getattr(spheres, key) for key in type(spheres).model_fields if key not in COMMON_KEYS}
    solver = ComponentSpec(spheres.solver, parameters, node.value["hard_spheres"].place)
    return ContactsSpec(solver, tuple(getattr(spheres, "pairs", ())), spheres.overlap)


def check_contacts(spec: SceneSpec, tree: Node, faults: Faults) -> None:
    """Refuse walls without contacts, and contact solvers beside forces or integrators that they do not support.

    A solver that resolves contacts during drifts needs an integrator whose drifts all lead forward in time: a drift that
    leads back would undo the contacts. A solver that leads the integrator needs an integrator that can begin anew at each
    contact.
    """
    if spec.contacts is None:
        across = acts_across_faces(spec)
        for number, wall in enumerate(spec.walls):
            if not (across and wall.flag("walls", "repeats")):
                rule = "acts on contacts only, so the scene must have contacts:"
                faults.add(wall.location, f"walls[{number}].{wall.name}", rule)
        name = spec.integrator.name
        if spec.integrator.flag("integrators", "flies"):
            faults.add(spec.integrator.location, f"integrator.{name}", f"needs contacts with solver: {name}")
        return
    for number, entry in spec.rigid_entries:
        rule = "cannot be beside contacts: a bounce would need impulses along the rods; make it a spring"
        faults.add(entry.location, f"springs[{number}].{entry.name}", rule)
    solver = spec.contacts.solver
    _check_heat(spec, faults)
    place, key = tree.value["contacts"].value["hard_spheres"].value["solver"].location, "contacts.hard_spheres.solver"
    forward = bool(spec.integrator.flag("integrators", "moves_forward_alone"))
    if solver.flag("contacts", "flies"):
        _check_free_flight(spec, place, key, faults)
    elif solver.flag("contacts", "leads"):
        _check_located(spec, place, key, faults)
    elif not forward:
        allowed = ", ".join(component.marked("integrators", "moves_forward_alone"))
        goes = f"goes with the integrators {allowed}, not {spec.integrator.name}"
        leading = ", ".join(component.marked("contacts", "leads"))
        other = f", which goes with solver: {leading}" if spec.integrator.flag("integrators", "begins_anew") else ""
        faults.add(place, key, f"{solver.name} resolves contacts on straight ways between kicks: it {goes}{other}")
    if merges(spec):
        _check_merging(spec, faults)
    if solver.parameters.get("compliance") and forward and not spec.integrator.flag("integrators", "drifts_after_kick"):
        allowed = ", ".join(component.marked("integrators", "drifts_after_kick"))
        rule = f"contacts that yield go with the integrator {allowed}, whose drifts each follow the kick that they carry"
        given = tree.value["contacts"].value["hard_spheres"].value["compliance"].place
        faults.add(given, "contacts.hard_spheres.compliance", f"{rule}, not {spec.integrator.name}")


def _check_heat(spec: SceneSpec, faults: Faults) -> None:
    """Refuse walls with a temperature beside a solver that does not know them."""
    assert spec.contacts is not None
    solver = spec.contacts.solver
    if solver.flag("contacts", "takes_heat"):
        return
    for number, wall in enumerate(spec.walls):
        if wall in spec.thermal_walls:
            allowed = ", ".join(component.marked("contacts", "takes_heat"))
            rule = f"a wall with a temperature goes with the solvers {allowed}, not {solver.name}"
            faults.add(wall.location, f"walls[{number}].{wall.name}.temperature", rule)


def _check_free_flight(spec: SceneSpec, place: Location, key: str, faults: Faults) -> None:
    assert spec.contacts is not None
    solver = spec.contacts.solver.name
    if not spec.integrator.flag("integrators", "flies"):
        faults.add(place, key, f"{solver} needs no integrator, or integrator: {solver}, not {spec.integrator.name}")
    for number, force in enumerate(spec.forces):
        if not force.flag("forces", "is_uniform"):
            known = ", ".join(component.marked("forces", "is_uniform"))
            rule = f"cannot act here: between collisions {solver} knows no force but {known}, of every particle"
            faults.add(force.location, f"forces[{number}].{force.name}", rule)
    if spec.springs:
        rule = f"cannot act here: between collisions {solver} knows no springs"
        faults.add(spec.springs[0].location, "springs", rule)


def _check_located(spec: SceneSpec, place: Location, key: str, faults: Faults) -> None:
    assert spec.contacts is not None
    if not spec.integrator.flag("integrators", "begins_anew"):
        allowed, solver = ", ".join(component.marked("integrators", "begins_anew")), spec.contacts.solver.name
        goes = f"goes with the integrators {allowed}, not {spec.integrator.name}"
        faults.add(place, key, f"{solver} cuts the steps of a method that chooses them at contacts: it {goes}")
    for number, wall in enumerate(spec.walls):
        if wall.flag("walls", "repeats"):
            rule = "cannot be where contacts are located: a step may lead through more than one copy of the box"
            faults.add(wall.location, f"walls[{number}].{wall.name}", rule)


def _check_merging(spec: SceneSpec, faults: Faults) -> None:
    if spec.integrator.flag("integrators", "draws_random"):
        rule = "cannot be where spheres merge: the bath would have to push spheres that are no longer there"
        faults.add(spec.integrator.location, f"integrator.{spec.integrator.name}", rule)
    if spec.springs:
        faults.add(spec.springs[0].location, "springs", "cannot be where spheres merge: a spring would lose its end")
    for number, wall in enumerate(spec.walls):
        if wall.flag("walls", "repeats"):
            rule = "cannot be where spheres merge: they may grow larger than a box that repeats has room for"
            faults.add(wall.location, f"walls[{number}].{wall.name}", rule)
