"""What of a scene there are kernels for, and a named refusal of the rest."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mpp_taichi.scene.formulas.laws import is_formula, live_names
from mpp_taichi.scene.formulas.program import with_numbers
from mpp_taichi.scene.groups import between_groups
from mpp_taichi.scene.spec import ComponentSpec, SceneSpec
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.start.contact_setup import ContactSetup, contact_setup, enclosure_of

from .bonds import Bond
from .devices import Device, Refused
from .fields import Field
from .formula import MOST, steps_text
from .n_body import PairForce
from .program import REALS

INTEGRATORS = ("leapfrog", "velocity_verlet", "rk4")
SOLVERS = ("pairwise",)
# Parameters of the forces that the kernels know; another one, or another value of `solver`, asks for something else.
FORCES = {
    "newtonian_gravity": {"strength", "softening", "between"},
    "coulomb": {"coulomb_constant", "softening", "between"},
    "uniform_gravity": {"acceleration"},
    "linear_drag": {"coefficient"},
}
FORMULAS = ("pair", "bond", "field")  # kinds of laws
PLAIN = {None, "direct", "all_pairs", "auto"}


@dataclass(frozen=True, eq=False)
class Problem:
    """A scene as the kernels take it."""

    dimensions: int
    precision: str
    integrator: str
    dt: float
    gravity: tuple[float, float, float]
    drag: float
    pairs: tuple[PairForce, ...]
    bonds: tuple[Bond, ...]
    fields: tuple[Field, ...]
    spring_damping: str  # "none", "axial" or "full"
    has_springs: bool
    held: bool  # whether an axis of a particle is
    contacts: ContactSetup | None

    @property
    def has_forces(self) -> bool:
        """Whether anything is to be summed."""
        return bool(self.pairs or self.fields) or self.has_springs or any(self.gravity) or self.drag > 0.0


def problem_of(spec: SceneSpec, snapshot: Snapshot, device: Device, precision: str) -> Problem:
    """The scene for the kernels.

    Raises:
        Refused: there is none for something that it names.
    """
    _refuse(_reason(spec, snapshot, device, precision))
    gravity, drag, pairs, along, acting = np.zeros(3), 0.0, [], [], []
    for force in spec.forces:
        known = force.parameters
        if force.name == "uniform_gravity":
            gravity[: spec.dimensions] += np.asarray(known["acceleration"], float)[: spec.dimensions]
        elif force.name == "linear_drag":
            drag += float(known["coefficient"])
        elif is_formula(force.name) and force.law.kind == "bond":
            along.append(_bond(force, snapshot, precision))
        elif is_formula(force.name) and force.law.kind == "field":
            acting.append(_field(force, snapshot, precision))
        elif is_formula(force.name):
            pairs += between_groups(_formula(force, snapshot, precision), known["between"])
        else:
            pairs += between_groups(_pair_force(force.name, known, snapshot), known["between"])
    damped = len(snapshot.springs) > 0 and bool((snapshot.springs.damping != 0).any())
    return Problem(
        dimensions=spec.dimensions,
        precision=precision,
        integrator=spec.integrator.name,
        dt=float(spec.integrator.parameters["dt"]),
        gravity=(float(gravity[0]), float(gravity[1]), float(gravity[2])),
        drag=drag,
        pairs=tuple(pairs) if snapshot.particle_count > 1 else (),
        bonds=tuple(along) if len(snapshot.springs) > 0 else (),
        fields=tuple(acting),
        spring_damping=spec.spring_damping if damped else "none",
        has_springs=len(snapshot.springs) > 0,
        held=not bool(snapshot.free[:, : spec.dimensions].all()),
        contacts=_contacts(spec, snapshot),
    )


def _contacts(spec: SceneSpec, snapshot: Snapshot) -> ContactSetup | None:
    """The spheres with the restitution and the contact time of the solver; None for a scene without contacts."""
    if spec.contacts is None:
        return None
    given = spec.contacts.solver.parameters
    return contact_setup(spec, snapshot).with_bounces(given["restitution"], given["contact_time"])


def _refuse(reason: str) -> None:
    if reason:
        raise Refused(f"no OpenCL kernel for {reason}")


def _reason(spec: SceneSpec, snapshot: Snapshot, device: Device, precision: str) -> str:
    """What is missing, first things first; nothing where all is there."""
    if precision not in REALS:
        return f"precision {precision}, there are {', '.join(REALS)}"
    if precision == "f64" and not device.handle.double_fp_config:
        return f"f64 on {device.id}, which has none; there is f32"
    if spec.timeline:
        return "a timeline"
    if spec.accuracy is not None:
        return "an accuracy whose method is still to be chosen"
    if snapshot.merged_into is not None:
        return "spheres that merge"
    if snapshot.springs.have_limits:
        return "springs that break or yield"
    if spec.integrator.name not in INTEGRATORS:
        offer = _offer(spec, snapshot, device, precision)
        return f"the integrator {spec.integrator.name}, there are {', '.join(INTEGRATORS)}{offer}"
    forces = next((reason for force in spec.forces if (reason := _force_reason(force))), "")
    return forces or _most_reason(spec) or _contact_reason(spec)


def _offer(spec: SceneSpec, snapshot: Snapshot, device: Device, precision: str) -> str:
    """The option with which the scene has all kernels, at its own step; nothing where more is missing."""
    name, dt = INTEGRATORS[0], float(spec.integrator.parameters["dt"])
    other = replace(spec, integrator=ComponentSpec(name, {"dt": dt}, spec.integrator.location))
    if _reason(other, snapshot, device, precision):
        return ""
    return f'; --set "integrator={{{name}: {{dt: {dt:.6g}}}}}" has one'


def _force_reason(force: ComponentSpec) -> str:
    if is_formula(force.name) and force.law.kind in FORMULAS:
        return ""
    if force.name not in FORCES:
        return f"the force {force.name}, there are {', '.join(FORCES)}"
    others = {key: value for key, value in force.parameters.items() if key not in FORCES[force.name]}
    return next((f"{force.name} with {key}: {value}" for key, value in others.items() if not _is_plain(key, value)), "")


def _most_reason(spec: SceneSpec) -> str:
    kinds = [force.law.kind for force in spec.forces if is_formula(force.name)]
    found = ((kinds.count(kind), kind) for kind in ("bond", "field"))
    return next((f"{count} {kind}s, there are up to {MOST}" for count, kind in found if count > MOST), "")


def _is_plain(key: str, value: Any) -> bool:
    """Whether a parameter that is not known here asks for nothing: it is off, or names the direct sum."""
    return value is None or (key == "solver" and value in PLAIN)


def _contact_reason(spec: SceneSpec) -> str:
    """Of contacts and walls."""
    if spec.contacts is None:
        return f"walls without contacts ({spec.walls[0].name})" if spec.walls else ""
    if spec.contacts.solver.name not in SOLVERS:
        return f"the contact solver {spec.contacts.solver.name}, there is {', '.join(SOLVERS)}"
    if moved := [surface for surface in enclosure_of(spec).surfaces if surface.motion is not None]:
        return f"{moved[0].label} with a motion"
    if turned := [surface for surface in enclosure_of(spec).surfaces if surface.turning is not None]:
        return f"{turned[0].label} with a turning"
    if rough := [surface for surface in enclosure_of(spec).surfaces if surface.friction > 0.0]:
        return f"{rough[0].label} with a friction"
    if segments := enclosure_of(spec).segments:
        return f"{segments[0].label}, there are planes, cylinders and spheres"
    return "contacts under rk4, whose drifts are no straight ways" if spec.integrator.name == "rk4" else ""


def _law(force: ComponentSpec) -> Any:
    """The law of a formula, with numbers for what sliders may move."""
    live = live_names(force)
    return with_numbers(force.law, [(name, float(force.parameters[live[name]])) for name in force.law.live], ())


def _bond(force: ComponentSpec, snapshot: Snapshot, precision: str) -> Bond:
    """A bond by its formula."""
    try:
        return Bond.of(_law(force), force.parameters["of"], snapshot.springs.between, precision)
    except ValueError as error:
        raise Refused(f"no OpenCL kernel for {force.label}: {error}") from None


def _field(force: ComponentSpec, snapshot: Snapshot, precision: str) -> Field:
    """A field by its formula."""
    try:
        return Field.of(_law(force), force.parameters["on"], snapshot.particle_count, precision)
    except ValueError as error:
        raise Refused(f"no OpenCL kernel for {force.label}: {error}") from None


def _formula(force: ComponentSpec, snapshot: Snapshot, precision: str) -> PairForce:
    """A pair force by its formula."""
    law = _law(force)
    values = {"m": snapshot.mass, "q": snapshot.charge, "R": snapshot.radius}
    with np.errstate(divide="ignore", invalid="ignore"):
        found = [np.broadcast_to(law.of_particles(each, values), snapshot.mass.shape) for each in (law.source, law.response)]
    if law.flags["proportional_to_charge"]:
        found = [np.where(snapshot.charge != 0.0, each, 0.0) for each in found]
    try:
        text = steps_text(law.shape, precision)
    except ValueError as error:
        raise Refused(f"no OpenCL kernel for {force.label}: {error}") from None
    return PairForce(found[0], found[1], float(force.parameters["softening"]), text)


def _pair_force(name: str, known: Mapping[str, Any], snapshot: Snapshot) -> PairForce:
    """Source and response of each particle."""
    softening = float(known["softening"])
    if name == "newtonian_gravity":
        strength = 1.0 if known["strength"] is None else float(known["strength"])
        return PairForce(snapshot.mass, np.full(snapshot.particle_count, strength), softening)
    charge, mass = snapshot.charge, snapshot.mass
    with np.errstate(divide="ignore", invalid="ignore"):
        response = np.where(charge != 0.0, -float(known["coulomb_constant"]) * charge / mass, 0.0)
    return PairForce(charge, response, softening)
