"""Physics checks: initial states that cannot be computed; each message names the particles."""

from collections.abc import Iterator

import numpy as np

from mpp_taichi import component
from mpp_taichi.arithmetic.closed_skin import divisions_of, enclosed_volume
from mpp_taichi.arithmetic.polygon_area import signed_area
from mpp_taichi.errors import SceneError
from mpp_taichi.scene.acting import is_switched_off
from mpp_taichi.scene.dihedral_checks import line_faults
from mpp_taichi.scene.faults import FAULTS_SHOWN
from mpp_taichi.scene.formulas.laws import is_formula
from mpp_taichi.scene.groups import acts
from mpp_taichi.scene.integrator_checks import bath_faults, planetary_faults
from mpp_taichi.scene.layout import ParticleLayout
from mpp_taichi.scene.relativity_checks import relativity_faults
from mpp_taichi.scene.spec import Location, SceneSpec
from mpp_taichi.snapshot import Snapshot

LARGEST_COORDINATE = 1e100
"""Positions, velocities: their squares and cubes must stay finite."""
LARGEST_RATE = 1e60
"""Stiffness and damping over mass: their fourth powers, in the matrix of a step of fourth order, must stay finite."""
Fault = tuple[Location, str]


def check_physics(spec: SceneSpec, snapshot: Snapshot, layout: ParticleLayout, *, moved: bool = False) -> None:
    """Raise SceneError for a state that cannot be run; once particles have `moved`, their positions are not checked."""
    found: list[Fault] = []
    always = (_numbers, _masses, _rates, _friction, planetary_faults, bath_faults, _formulas, _hinges, _skins)
    at_start = (line_faults, _coincidences, _center_of_mass, relativity_faults)
    for check in always if moved else (*always, *at_start):
        found += check(spec, snapshot, layout)
    lines = [f"{location}: {message}" for location, message in found[:FAULTS_SHOWN]]
    if len(found) > len(lines):
        lines.append(f"{spec.source}: … and {len(found) - len(lines)} more faults")
    if lines:
        raise SceneError(*lines)


def _at(layout: ParticleLayout, index: int, message: str) -> Fault:
    number = layout.entry_of(index)
    entry = layout.entries[number]
    return entry.location, f"particles[{number}].{entry.name}: {layout.label(index)} {message}"


def _first_of_each_entry(layout: ParticleLayout, bad: np.ndarray) -> Iterator[int]:
    """The first `bad` particle of every entry that has one."""
    indices = np.flatnonzero(bad)
    starts = np.asarray(layout.starts)
    _, first = np.unique(np.searchsorted(starts, indices, side="right"), return_index=True)
    yield from (int(indices[position]) for position in first)


def _hinges(spec: SceneSpec, snapshot: Snapshot, layout: ParticleLayout) -> Iterator[Fault]:
    """Hinges beside forces and limits of springs that would act on the springs of which a hinge is made."""
    bent = [(number, entry) for number, entry in enumerate(spec.springs) if entry.flag("networks", "bends")]
    bonds = [entry.label for entry in spec.bonds]
    for number, entry in bent[:1]:
        where = f"springs[{number}].{entry.name}"
        if bonds:
            yield entry.location, f"{where}: cannot be beside {bonds[0]}, which acts along every spring, those of hinges too"
        if spec.limited_springs:
            yield entry.location, f"{where}: cannot be beside springs that break or yield: a hinge needs whole links"


def _skins(spec: SceneSpec, snapshot: Snapshot, layout: ParticleLayout) -> Iterator[Fault]:
    """Closed skins that are none: of other dimensions than the scene, of too few corners, or with nothing inside."""
    for number, entry in enumerate(spec.forces):
        for flag, reason in (("encloses", _why_no_curve), ("encloses_volume", _why_no_surface)):
            if entry.flag("forces", flag):
                first, count = entry.parameters["of"]
                told = reason(spec.dimensions, snapshot.position[first : first + count])
                if told:
                    yield entry.location, f"forces[{number}].{entry.name}{told}"


def _why_no_curve(dimensions: int, corners: np.ndarray) -> str:
    """Why these are no corners of a closed curve in the plane; empty where they are."""
    if dimensions != 2:
        return ": a skin is a curve in the plane, must be in a scene with dimensions: 2"
    if len(corners) < 3:
        return f".of: has {len(corners)} particles, must have three or more, the corners of a closed skin"
    return "" if signed_area(corners[:, :2]) else ".of: its corners enclose no area at the start"


def _why_no_surface(dimensions: int, corners: np.ndarray) -> str:
    """Why these are no corners of a closed surface of triangles; empty where they are."""
    if dimensions != 3:
        return ": a closed skin of triangles is in space, must be in a scene with three dimensions"
    if divisions_of(len(corners)) is None:
        return f".of: has {len(corners)} particles, must be a shell, of 10 ν² + 2 particles, or four particles"
    return "" if enclosed_volume(corners) else ".of: its corners enclose no volume at the start"


def _numbers(spec: SceneSpec, snapshot: Snapshot, layout: ParticleLayout) -> Iterator[Fault]:
    for key in ("position", "velocity"):
        large = ~np.all(np.abs(getattr(snapshot, key)) <= LARGEST_COORDINATE, axis=1)
        for index in _first_of_each_entry(layout, large):
            yield _at(layout, index, f"has a {key} beyond {LARGEST_COORDINATE:g}, whose cube is no number any more")
    for index in _first_of_each_entry(layout, snapshot.radius < 0.0):
        yield _at(layout, index, f"has the radius {snapshot.radius[index]:g}, must be 0 or more")


def _masses(spec: SceneSpec, snapshot: Snapshot, layout: ParticleLayout) -> Iterator[Fault]:
    """No negative masses; massless particles only where every force is proportional to mass."""
    for index in _first_of_each_entry(layout, snapshot.mass < 0.0):
        yield _at(layout, index, f"has the mass {snapshot.mass[index]:g}, must be 0 or more")
    massless = (snapshot.mass == 0.0) & np.any(snapshot.free, axis=1)
    linked = np.zeros(snapshot.particle_count, dtype=bool)
    linked[snapshot.springs.between.ravel()] = True
    for index in _first_of_each_entry(layout, massless & linked):
        yield _at(layout, index, "has no mass but a spring, must have a mass above 0 or be held fixed")
    for entry in spec.forces_with("proportional_to_charge"):
        for index in _first_of_each_entry(layout, massless & (snapshot.charge != 0.0)):
            yield _at(layout, index, f"has a charge but no mass, must have a mass above 0 where {entry.name} acts")
    if spec.contacts is not None:
        for index in _first_of_each_entry(layout, massless):
            yield _at(layout, index, "has no mass, must have one above 0 where particles touch")
        return
    need_no_mass = (*spec.forces_with("proportional_to_mass"), *spec.forces_with("proportional_to_charge"))
    others = sorted({entry.name for entry in spec.forces} - {entry.name for entry in need_no_mass})
    for index in _first_of_each_entry(layout, massless & bool(others)):
        yield _at(layout, index, f"has no mass, must have one above 0 where {', '.join(others)} acts")


def _rates(spec: SceneSpec, snapshot: Snapshot, layout: ParticleLayout) -> Iterator[Fault]:
    """Particles too light for their springs or their drag: no step resolves their motion, and its rate overflows."""
    drag = sum(entry.parameters["coefficient"] for entry in spec.forces_with("is_linear_drag"))
    moves = np.any(snapshot.free, axis=1) & (snapshot.mass > 0.0)
    for what, each, coefficient in (
        ("a spring of the stiffness", snapshot.springs.between, np.abs(snapshot.springs.stiffness)),
        ("a spring of the damping", snapshot.springs.between, snapshot.springs.damping),
        ("a drag of the coefficient", np.arange(snapshot.particle_count)[:, None], np.full(snapshot.particle_count, drag)),
    ):
        largest = np.zeros(snapshot.particle_count)
        np.maximum.at(largest, each.astype(np.int64), coefficient[:, None])
        too_light = moves & ~(largest / LARGEST_RATE <= snapshot.mass)
        for index in _first_of_each_entry(layout, too_light):
            masses = f"has the mass {snapshot.mass[index]:g} under {what} {largest[index]:g}"
            yield _at(layout, index, f"{masses}, their ratio must be at most {LARGEST_RATE:g}")


def refused_friction(integrator: str, spec: SceneSpec, snapshot: Snapshot) -> list[str]:
    """The forces that depend on velocity, if the integrator would lose its order with them; otherwise an empty list."""
    if component.declaration("integrators", integrator).flags.get("takes_velocity", True):
        return []
    forces = [force.name for force in spec.forces_with("depends_on_velocity")]
    return [*forces, "damped springs"] if spec.damping_is_live or snapshot.springs.damping.any() else forces


def _friction(spec: SceneSpec, snapshot: Snapshot, layout: ParticleLayout) -> Iterator[Fault]:
    """Forces that depend on velocity, beside an integrator that does not support them."""
    name = spec.integrator.name
    forces = refused_friction(name, spec, snapshot)
    if forces:
        rule = f"would lose its order beside {', '.join(forces)}, for it takes no forces that depend on velocity"
        allowed = ", ".join(component.proposed("integrators", "friction"))
        yield spec.integrator.location, f"integrator.{name}: {rule}, allowed: {allowed}, among others"


def _coincidences(spec: SceneSpec, snapshot: Snapshot, layout: ParticleLayout) -> Iterator[Fault]:
    """Two particles at one place, between which an unsoftened force has no value."""
    for entry in spec.forces_with("singular_at_zero_distance"):
        if entry.parameters.get("softening", 0.0) != 0.0 or is_switched_off(entry):
            continue
        charged = entry.flag("forces", "proportional_to_charge")
        interacting = np.flatnonzero(snapshot.charge) if charged else np.arange(snapshot.particle_count)
        order = interacting[np.lexsort(snapshot.position[interacting].T)]
        same = np.all(snapshot.position[order[1:]] == snapshot.position[order[:-1]], axis=1)
        same &= acts(entry, order[1:], order[:-1])
        if entry.flag("forces", "proportional_to_mass"):  # one of the two masses is enough
            same &= (snapshot.mass[order[1:]] != 0.0) | (snapshot.mass[order[:-1]] != 0.0)
        for row in np.flatnonzero(same):
            first, second = sorted((int(order[row]), int(order[row + 1])))
            cure = (
                f" or {entry.name} needs a softening"
                if "softening" in entry.parameters
                else f": {entry.name} is infinite there"
            )
            yield _at(layout, second, f"is where {layout.label(first)} is, must be elsewhere{cure}")


def _formulas(spec: SceneSpec, snapshot: Snapshot, layout: ParticleLayout) -> Iterator[Fault]:
    """Formulas that have no value where particles are."""
    if any(is_formula(entry.name) for entry in spec.forces):
        from mpp_taichi.scene.formula_checks import formula_faults  # only where a formula stands in the scene

        yield from formula_faults(spec, snapshot, layout)


def _center_of_mass(spec: SceneSpec, snapshot: Snapshot, layout: ParticleLayout) -> Iterator[Fault]:
    if not spec.move_to_center_of_mass:
        return
    place = Location(spec.source, 0, 0)
    if snapshot.mass.sum() <= 0.0:
        yield place, "move_to_center_of_mass: the total mass must be above 0"
    # Along an axis on which all particles are held, nothing moves.
    if np.any(snapshot.free.any(axis=0) & ~snapshot.free.all(axis=0)):
        yield place, "move_to_center_of_mass: not allowed where some particles are held fixed and others are not"
