"""Checks of the integrator against the forces of a scene, made without compiling anything."""

from collections.abc import Iterator

import numpy as np

from mpp_taichi import component
from mpp_taichi.scene.faults import Faults
from mpp_taichi.scene.layout import ParticleLayout
from mpp_taichi.scene.periodic_forces import check_periodic_forces
from mpp_taichi.scene.spec import Location, SceneSpec
from mpp_taichi.snapshot import Snapshot

HIGHEST_KICKS = 4
"""Highest order of a splitting whose kicks are solved to their order for every force of the velocity (_splitting_table.py)."""
OUTWEIGHS = 10.0
"""The least ratio of the central body's mass to the mass of all other bodies; the error is proportional to its inverse."""


def check_integrator(spec: SceneSpec, faults: Faults) -> None:
    """Refuse forces and springs that the integrator was not made for."""
    place, key = spec.integrator.location, f"integrator.{spec.integrator.name}"
    rule = refused_formulas(spec.integrator.name, spec)
    if rule:
        faults.add(place, key, rule)
    if spec.rigid_entries and not spec.integrator.flag("integrators", "takes_rods"):
        allowed = ", ".join(component.marked("integrators", "takes_rods"))
        faults.add(place, key, f"does not keep the lengths of {spec.rods_named}, allowed: {allowed}")
        return
    if spec.driven_entries and not spec.integrator.flag("integrators", "takes_paths"):
        allowed = ", ".join(component.marked("integrators", "takes_paths"))
        faults.add(place, key, f"does not move bodies on a path, allowed: {allowed}")
        return
    if spec.changing_entries and not spec.integrator.flag("integrators", "takes_paths"):
        allowed = ", ".join(component.marked("integrators", "takes_paths"))
        faults.add(place, key, f"does not know masses and charges that change, allowed: {allowed}")
        return
    if spec.limited_springs and not spec.integrator.flag("integrators", "takes_limits"):
        allowed = ", ".join(component.marked("integrators", "takes_limits"))
        rule = "sums forces at trial places too, so that it cannot tell when springs break or yield"
        faults.add(place, key, f"{rule}, allowed: {allowed}")
        return
    if solves_low_kicks(spec.integrator.name):
        curved = [force.label for force in spec.forces if not force.flag("forces", "linear_in_velocity")]
        if curved:
            others = [name for name in component.proposed("integrators", "friction") if not solves_low_kicks(name)]
            rule = f"would have the third order beside {', '.join(curved)}, not linear in the velocity"
            faults.add(place, key, f"{rule}, allowed: {', '.join(others)}, among others")
    made_for = spec.integrator.flag("integrators", "made_for")
    if not made_for:
        return
    known = [name for name in component.names("forces") if any(component.flag("forces", name, each) for each in made_for)]
    reason = spec.integrator.flag("integrators", "made_for_reason")
    unknown = [force.label for force in spec.forces if force.name not in known] + (["springs"] if spec.springs else [])
    attractions = spec.forces_with("gravitates")
    if unknown:
        faults.add(place, key, f"knows no forces but {', '.join(known)} ({reason}), not {', '.join(unknown)}")
    elif grouped := [force.label for force in spec.forces if force.parameters.get("between") is not None]:
        faults.add(place, key, f"takes forces between all bodies ({reason}), not {', '.join(grouped)} with between:")
    elif partial := [force.label for force in spec.forces if force.parameters.get("on") is not None]:
        faults.add(place, key, f"takes forces on all bodies ({reason}), not {', '.join(partial)} with on:")
    elif not spec.forces:
        faults.add(place, key, f"needs {', '.join(known)}: {reason}")
    elif len(attractions) > 1:
        faults.add(place, key, f"knows one {attractions[0].name}, not several")
    elif spec.integrator.flag("integrators", "orbits_central_body"):
        _check_orbits(spec, key, faults)


def solves_low_kicks(method: str) -> bool:
    """Whether a splitting has a higher order than its kicks by forces that are not linear in the velocity."""
    order = component.flag("integrators", method, "order")
    return bool(component.flag("integrators", method, "solves_kicks") and order > HIGHEST_KICKS)


def refused_formulas(integrator: str, spec: SceneSpec) -> str:
    """The reason why an integrator cannot use the formulas of these forces, or an empty text.

    A method that sums jerks needs the derivatives of every force; forces that depend on velocity are refused in check_physics.
    A method that can be run backwards to the bit needs forces that do not depend on time: on the way back a time is a sum of
    other steps, and differs by rounding.
    """
    wants = component.declaration("integrators", integrator).flags
    if wants.get("needs_derivatives"):
        jerks = ("has_derivatives", "depends_on_velocity")
        without = [force.label for force in spec.forces if not any(force.flag("forces", key) for key in jerks)]
        if without:
            on_springs = component.marked("forces", "acts_on_springs")
            allowed = [name for name in component.marked("forces", "has_derivatives") if name not in on_springs]
            return (
                f"needs the derivative of every force, which {', '.join(without)} lacks, allowed: {', '.join(allowed)}, springs"
            )
    if not wants.get("takes_time", True):
        timed = [force.label for force in spec.forces_with("depends_on_time")]
        if timed:
            return f"goes back bit for bit only with forces of positions, not with {', '.join(timed)}, which depends on time"
    return ""


def suits(spec: SceneSpec, snapshot: Snapshot, layout: ParticleLayout) -> bool:
    """Whether the integrator of a scene was made for the forces and bodies of the scene."""
    faults = Faults()
    check_integrator(spec, faults)
    check_periodic_forces(spec, faults)
    return not faults.found and not list(planetary_faults(spec, snapshot, layout))


def _check_orbits(spec: SceneSpec, key: str, faults: Faults) -> None:
    """Refuse gravity that is softened or does not attract, since Kepler's orbits need a force of −1/r² at every distance."""
    corrector, gravity, name = spec.integrator.parameters["corrector"], spec.forces[0], spec.integrator.name
    correctors = spec.integrator.flag("integrators", "correctors")
    if corrector not in correctors:
        allowed = ", ".join(map(str, correctors))
        faults.add(spec.integrator.location, f"{key}.corrector", f"{corrector} is no order of a corrector, allowed: {allowed}")
    if gravity.parameters["softening"] != 0.0:
        found, rule = gravity.parameters["softening"], f"must be 0 for {name}: softened orbits are not Kepler's"
        faults.add(gravity.location, gravity.name, f"softening is {found:g}, {rule}")
    if not gravity.parameters["strength"] > 0.0:
        found, rule = gravity.parameters["strength"], f"must be above 0 for {name}: nothing orbits"
        faults.add(gravity.location, gravity.name, f"strength is {found:g}, {rule}")


def planetary_faults(spec: SceneSpec, snapshot: Snapshot, layout: ParticleLayout) -> Iterator[tuple[Location, str]]:
    """The reason why the bodies do not suit a planetary method: no body that all others orbit, or bodies that are held."""
    if not spec.integrator.flag("integrators", "orbits_central_body"):
        return
    place, key = spec.integrator.location, f"integrator.{spec.integrator.name}"
    mass, given = snapshot.mass, spec.integrator.parameters["central"]
    center = int(np.argmax(mass)) if given is None else given
    others = float(np.delete(mass, center).sum())
    if not mass[center] > 0.0:
        yield place, f"{key}: {layout.label(center)} has no mass, must have one to be orbited"
    elif np.count_nonzero(mass) > 2 and mass[center] < OUTWEIGHS * others:
        rule = f"must outweigh all others together, {others:g}, by a factor of {OUTWEIGHS:g}"
        yield place, f"{key}: the central body, {layout.label(center)}, has the mass {mass[center]:g}, {rule}"
    axes = range(spec.dimensions)
    held = [axis for axis in axes if not snapshot.free[:, axis].all() and not _in_plane(snapshot, axis)]
    if held:
        index = int(np.argmax(~snapshot.free[:, held[0]]))
        yield place, f"{key}: {layout.label(index)} is held on the axis {'xyz'[held[0]]}, must be free: orbits cannot be held"


def _in_plane(snapshot: Snapshot, axis: int) -> bool:
    """Whether all particles are held at one place on this axis, as orbits in a plane are without being held."""
    return not snapshot.free[:, axis].any() and np.ptp(snapshot.position[:, axis]) == 0.0


def bath_faults(spec: SceneSpec, snapshot: Snapshot, layout: ParticleLayout) -> Iterator[tuple[Location, str]]:
    """The free particles without mass beside a method with a bath of heat, which would give them an infinite speed."""
    if spec.integrator.flag("integrators", "draws_random"):
        light = np.flatnonzero((snapshot.mass == 0.0) & snapshot.free.any(axis=1))
        if len(light):
            rule = "has no mass, must have one above 0: a bath gives it an infinite speed"
            yield spec.integrator.location, f"integrator.{spec.integrator.name}: {layout.label(int(light[0]))} {rule}"
