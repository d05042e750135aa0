"""Contacts: the model of `contacts: {hard_spheres: {solver: …}}`, and what must hold between it and the rest of a scene."""

from collections.abc import Sequence
from typing import Annotated, Any, Literal, Union

from pydantic import BaseModel, ConfigDict, create_model
from pydantic import Field as Describe

from mpp_taichi import component
from mpp_taichi.scene.document import Node
from mpp_taichi.scene.faults import Faults
from mpp_taichi.scene.fields import Field, Text
from mpp_taichi.scene.parameters import STRICT, parameter_fields
from mpp_taichi.scene.spec import ComponentSpec, ContactsSpec, Location, PairSpec, SceneSpec

LOOKS = 1000  # of an event-driven run, where the scene does not say how often
COMMON_KEYS = ("solver", "pairs", "overlap")
MERGING = "merging"  # the solver after which there are fewer spheres


def contacts_model(names: Sequence[str]) -> type[BaseModel]:
    """The model of `contacts:` for the solvers selected; with none, one that says which solvers there are."""
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
    """Whether spheres of a scene become one where they meet."""
    return spec.contacts is not None and spec.contacts.solver.name == MERGING


def is_event_driven(validated: Any) -> bool:
    """Whether validated contacts, or None, are those that need no integrator."""
    return validated is not None and bool(validated.hard_spheres.solver == "event_driven")


def specification(validated: Any, node: Any) -> ContactsSpec | None:
    """The validated contacts as a specification; `node` is that of `contacts:`."""
    if validated is None:
        return None
    spheres = validated.hard_spheres
    parameters = {key: getattr(spheres, key) for key in type(spheres).model_fields if key not in COMMON_KEYS}
    solver = ComponentSpec(spheres.solver, parameters, node.value["hard_spheres"].place)
    return ContactsSpec(solver, tuple(getattr(spheres, "pairs", ())), spheres.overlap)


# Methods whose drifts lead forward in time alone: contacts on the way would be undone by one that leads back.
DRIFTING = ("leapfrog", "symplectic_euler", "velocity_verlet")
# Methods that choose a step by what they find, so that they can begin anew at any time; adaptive_leapfrog carries its along.
CUT_AT_CONTACTS = ("ias15", "taylor", "adaptive_dop853", "adaptive_bogacki_shampine")


def check_contacts(spec: SceneSpec, tree: Node, faults: Faults) -> None:
    """Refuse walls without contacts, and solvers beside forces or integrators that they cannot go with."""
    if spec.contacts is None:
        for number, wall in enumerate(spec.walls):
            faults.add(wall.location, f"walls[{number}].{wall.name}", "acts on contacts only, so the scene must have contacts:")
        if spec.integrator.name == "event_driven":
            faults.add(spec.integrator.location, "integrator.event_driven", "needs contacts with solver: event_driven")
        return
    solver = spec.contacts.solver
    place, key = tree.value["contacts"].value["hard_spheres"].value["solver"].location, "contacts.hard_spheres.solver"
    if solver.name == "event_driven":
        _check_free_flight(spec, place, key, faults)
    elif solver.name == "located":
        _check_located(spec, place, key, faults)
    elif spec.integrator.name not in DRIFTING:
        goes = f"goes with the integrators {', '.join(DRIFTING)}, not {spec.integrator.name}"
        other = ", which goes with solver: located" if spec.integrator.name in CUT_AT_CONTACTS else ""
        faults.add(place, key, f"{solver.name} resolves contacts on straight ways between kicks: it {goes}{other}")
    if solver.name == MERGING:
        _check_merging(spec, faults)
    if solver.parameters.get("compliance") and spec.integrator.name in DRIFTING and spec.integrator.name != "symplectic_euler":
        rule = "contacts that yield go with the integrator symplectic_euler, where each drift follows the kick it bears"
        given = tree.value["contacts"].value["hard_spheres"].value["compliance"].place
        faults.add(given, "contacts.hard_spheres.compliance", f"{rule}, not {spec.integrator.name}")


def _check_free_flight(spec: SceneSpec, place: Location, key: str, faults: Faults) -> None:
    if spec.integrator.name != "event_driven":
        faults.add(place, key, f"event_driven needs no integrator, or integrator: event_driven, not {spec.integrator.name}")
    for number, force in enumerate(spec.forces):
        if force.name != "uniform_gravity":
            rule = "cannot act here: between collisions event_driven knows no force but uniform_gravity"
            faults.add(force.location, f"forces[{number}].{force.name}", rule)
    if spec.springs:
        rule = "cannot act here: between collisions event_driven knows no springs"
        faults.add(spec.springs[0].location, "springs", rule)


def _check_located(spec: SceneSpec, place: Location, key: str, faults: Faults) -> None:
    if spec.integrator.name not in CUT_AT_CONTACTS:
        goes = f"goes with the integrators {', '.join(CUT_AT_CONTACTS)}, not {spec.integrator.name}"
        faults.add(place, key, f"located cuts the steps of a method that chooses them at contacts: it {goes}")
    for number, wall in enumerate(spec.walls):
        if wall.name == "periodic_box":
            rule = "cannot be where contacts are located: a step may lead through more than one copy of the box"
            faults.add(wall.location, f"walls[{number}].{wall.name}", rule)


def _check_merging(spec: SceneSpec, faults: Faults) -> None:
    if spec.springs:
        faults.add(spec.springs[0].location, "springs", "cannot be where spheres merge: a spring would lose its end")
    for number, wall in enumerate(spec.walls):
        if wall.name == "periodic_box":
            rule = "cannot be where spheres merge: they may grow beyond what a box that repeats has room for"
            faults.add(wall.location, f"walls[{number}].{wall.name}", rule)
