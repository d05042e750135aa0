"""Checks of formulas where particles are at the start: values that are no numbers, and derivatives that are no slopes.

The derivative of each formula is compared with a difference of the formula, of fourth order in the width h. With h = ε^(1/5) r
the error of truncation is some ε^(4/5) of the size of V/r; SLOPE_ERROR allows for large fifth derivatives. The rounding errors
of V come from a running error analysis. Where the difference over 2 h differs by more, the formula has a kink or a pole nearby.
"""

import logging
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np

from mpp_taichi.scene.formulas.grammar import kinks
from mpp_taichi.scene.formulas.laws import PREFIX, is_formula, live_names, texts_of
from mpp_taichi.scene.groups import acts, is_in
from mpp_taichi.scene.layout import ParticleLayout
from mpp_taichi.scene.spec import Location, SceneSpec
from mpp_taichi.snapshot import Snapshot

log = logging.getLogger(__name__)
PARTICLES_TRIED = 600  # of more, an even selection
DISTANCES_TRIED = 64
SPAN = 3.0  # distances from a third of the smallest to three times the largest of the start
WIDTH = np.finfo(float).eps ** 0.2
SLOPE_ERROR = 1e-7
LEAST_SHARE = 1e-3  # of the largest force at the start: smaller forces may be lost
LARGEST_LOSS = 0.01  # of a force; terms that cancel may lose as much, as they lose some digits in f64
ROUNDINGS_AROUND = 10.0  # of V at six places, the largest of which may be a few times that in the middle
Fault = tuple[Location, str]


def formula_faults(spec: SceneSpec, snapshot: Snapshot, layout: ParticleLayout) -> Iterator[Fault]:
    """The first place at which each formula of a scene is no number, or has a derivative that is not its slope."""
    for entry in spec.forces:
        if is_formula(entry.name):
            check = {"pair": _pair_faults, "field": _field_faults, "bond": _bond_faults}[entry.law.kind]
            with np.errstate(all="ignore"):  # what is no number is looked for
                found = next(check(entry, snapshot, layout), None)
            if found is not None:
                yield found


def warn_of_kinks(spec: SceneSpec) -> None:
    """Log a warning for each formula with a function that has a kink, where a step loses accuracy."""
    for entry in spec.forces:
        for text in texts_of(entry) if is_formula(entry.name) else ():
            for name, character in kinks(text.expression):
                place = replace(text.place, column=text.place.column + character) if text.place.column else text.place
                log.warning("%s: %s: %s has a kink, at which a step loses its order", place, entry.label, name)


def warn_of_unused(spec: SceneSpec) -> None:
    """Log a warning for each number under `parameters:` of a formula whose name stands in no text of its force."""
    for entry in spec.forces:
        given = [name.removeprefix(PREFIX) for name in entry.parameters if name.startswith(PREFIX)]
        if given:
            cutoff = entry.parameters.get("cutoff")
            texts = [*texts_of(entry), *([] if cutoff is None else [cutoff])]
            used = frozenset().union(*(text.expression.names for text in texts))
            unused = ", ".join(name for name in given if name not in used)
            if unused:
                log.warning("%s: %s: no formula of it uses %s of its parameters", entry.location, entry.label, unused)


def chosen(count: int) -> np.ndarray:
    """The particles whose pairs are tried."""
    if count <= PARTICLES_TRIED:
        return np.arange(count)
    return np.unique(np.linspace(0, count - 1, PARTICLES_TRIED).astype(int))


def distances(entry: Any, snapshot: Snapshot) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """First and second particle of pairs at the start, and the distances ρ of these pairs that the formula sees."""
    which = chosen(snapshot.particle_count)
    first, second = (which[each] for each in np.triu_indices(len(which), 1))
    apart = snapshot.position[second] - snapshot.position[first]
    squared = np.sum(apart * apart, axis=1) + entry.parameters.get("softening", 0.0) ** 2
    seen = np.flatnonzero((squared > 0.0) & acts(entry, first, second))
    return first[seen], second[seen], np.sqrt(squared[seen])


def values_of(entry: Any) -> dict[str, float]:
    """The numbers that a formula takes for its live names at the start."""
    return {name: entry.parameters[at] for name, at in live_names(entry).items() if name in entry.law.live}


def _pair_faults(entry: Any, snapshot: Snapshot, layout: ParticleLayout) -> Iterator[Fault]:
    first, second, distance = distances(entry, snapshot)
    if not len(distance):
        return
    law, values, place = entry.law, values_of(entry), place_of(entry)
    given = {"m": snapshot.mass, "q": snapshot.charge, "R": snapshot.radius, **values}
    source, response = (law.of_particles(each, given) + 0.0 * snapshot.mass for each in (law.source, law.response))
    wrong = ~(np.isfinite(source) & (np.isfinite(response) | (snapshot.mass == 0.0)))
    if wrong.any():
        yield place, f"{entry.label}: the factor of {layout.label(int(np.argmax(wrong)))} in the formula is no number"
        return
    energy, shape = law.energy_at(distance, values), law.shape_at(distance, values)
    bad = np.flatnonzero(~(np.isfinite(energy) & np.isfinite(shape) & np.ones(len(distance), bool)))
    if len(bad):
        k = int(bad[0])
        ends = f"{layout.label(int(first[k]))} and {layout.label(int(second[k]))}"
        what = "V" if not np.isfinite(np.broadcast_to(energy, distance.shape)[k]) else "the force"
        yield place, f"{entry.label}: {what} is no number at r = {distance[k]:.6g}, the distance of {ends} at the start"
        return
    tried = np.geomspace(distance.min() / SPAN, distance.max() * SPAN, DISTANCES_TRIED)
    rounding = law.energy_errors_at(tried, values)
    wrong = _wrong_slopes(lambda r: law.energy_at(r, values), law.shape_at(tried, values) * tried, rounding, tried, tried)
    if len(wrong):
        yield place, f"{entry.label}: the force at r = {tried[wrong[0]]:.6g} is not the slope of V there; please report it"


def beyond_single(entry: Any, snapshot: Snapshot) -> str:
    """What is lost of a pair formula in single precision where particles are at the start; empty where nothing is.

    The distance 1 is tried too, which the lanes of a vector unit take for the distance of a particle from itself.
    """
    if not is_formula(entry.name) or entry.law.kind != "pair":
        return ""
    distance, values = np.append(distances(entry, snapshot)[2], 1.0), values_of(entry)
    with np.errstate(all="ignore"):
        force = entry.law.shape_at(distance, values) * distance + 0.0 * distance
        found = entry.law.shape_at(distance.astype(np.float32), values) * distance + 0.0 * distance
        matters = np.abs(force) > LEAST_SHARE * np.max(np.abs(force[:-1]), initial=0.0)
        wrong = ~np.isfinite(found) | (matters & ~(np.abs(found - force) <= LARGEST_LOSS * np.abs(force)))
        wrong[-1] = ~np.isfinite(found[-1])
    if not wrong.any():
        return ""
    k = int(np.argmax(wrong))
    return f"the force at r = {distance[k]:.6g} is {found[k]:.3g}, not {force[k]:.3g}"


def _field_faults(entry: Any, snapshot: Snapshot, layout: ParticleLayout) -> Iterator[Fault]:
    which, law = chosen(snapshot.particle_count), entry.law
    which = which[np.any(snapshot.free[which], axis=1)]
    if entry.parameters.get("on") is not None:
        which = which[is_in(entry.parameters["on"], which)]
    if not len(which):
        return
    given = field_values(entry, snapshot, which)
    rates, energy = law.numbers(law.acceleration, given), law.numbers(law.energy, given)[0]
    bad = np.flatnonzero(~np.logical_and.reduce([np.isfinite(each) & np.ones(len(which), bool) for each in (*rates, energy)]))
    if len(bad):
        yield place_of(entry), f"{entry.label}: the formula gives no number for {layout.label(int(which[bad[0]]))} at the start"
        return
    still = given | dict.fromkeys(("vx", "vy", "vz"), np.zeros(len(which)))  # where only the potential is felt
    for axis, rate in zip("xyz", law.numbers(law.acceleration, still)) if law.flags["conserves_energy"] else ():

        def energy_at(x: Any, axis: str = axis) -> Any:
            return law.numbers(law.energy, {**still, axis: x})[0]

        size = np.maximum(np.abs(given[axis]), float(np.abs(snapshot.position).max()) or 1.0)
        slope, rounding = -np.broadcast_to(rate * given["m"], which.shape), law.errors(law.energy, given)[0]
        wrong = _wrong_slopes(energy_at, slope, rounding, given[axis], size)
        if len(wrong):
            label = layout.label(int(which[wrong[0]]))
            yield place_of(entry), f"{entry.label}: the force on {label} along {axis} is not the slope of V; please report it"
            return


def _bond_faults(entry: Any, snapshot: Snapshot, layout: ParticleLayout) -> Iterator[Fault]:
    if not len(snapshot.springs):
        yield entry.location, f"{entry.label}: acts along springs, and this scene has none; list them under springs:"
        return
    group, between = entry.parameters["of"], snapshot.springs.between
    if group is not None and not (is_in(group, between[:, 0]) & is_in(group, between[:, 1])).any():
        yield entry.location, f"{entry.label}: no spring is between two particles of its group, so that it would act on none"
        return
    rest, length, which = bonds(entry, snapshot)
    law, values = entry.law, values_of(entry)
    energy, shape = (law.at(name, length, rest, values) for name in ("energy", "shape"))
    bad = np.flatnonzero(~(np.isfinite(energy) & np.isfinite(shape)))
    if len(bad):
        first, second = (layout.label(int(end)) for end in snapshot.springs.between[which[bad[0]]])
        place = f"the length {length[bad[0]]:.6g} of the spring between {first} and {second} at the start"
        yield place_of(entry), f"{entry.label}: the formula gives no number at {place}"
        return
    tried = [scale * length[:: max(1, len(length) // DISTANCES_TRIED)] for scale in (1.0 / SPAN, 1.0, SPAN)]
    lengths, rests = np.concatenate(tried), np.tile(rest[:: max(1, len(length) // DISTANCES_TRIED)], 3)
    slope, rounding = law.at("shape", lengths, rests, values) * lengths, law.energy_errors_at(lengths, rests, values)
    wrong = _wrong_slopes(lambda at: law.at("energy", at, rests, values), slope, rounding, lengths, lengths)
    if len(wrong):
        at = lengths[wrong[0]]
        yield place_of(entry), f"{entry.label}: the force at the length {at:.6g} is not the slope of V; please report it"


def bonds(entry: Any, snapshot: Snapshot) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rest lengths, lengths at the start and numbers of the springs with a bond, without those whose ends coincide."""
    between = snapshot.springs.between
    length = np.linalg.norm(snapshot.position[between[:, 1]] - snapshot.position[between[:, 0]], axis=1)
    group = entry.parameters["of"]
    there = length > 0.0
    if group is not None:
        there &= is_in(group, between[:, 0]) & is_in(group, between[:, 1])
    which = np.flatnonzero(there)
    return snapshot.springs.rest_length[which], length[which], which


def with_bonds(spec: SceneSpec, snapshot: Snapshot) -> Snapshot:
    """The snapshot with springs that have the force and the stiffness of springs and bonds together, where they are.

    A spring of tension T = D (l − L) beside a bond V gets D + V″, and the rest length that gives it the tension T + V′.
    """
    springs = snapshot.springs
    stiffness, rest = springs.stiffness.copy(), springs.rest_length.copy()
    for entry in spec.bonds:
        own, length, which = bonds(entry, snapshot)
        values = values_of(entry)
        tension = stiffness[which] * (length - rest[which]) + entry.law.at("shape", length, own, values) * length
        total = stiffness[which] + entry.law.at("along", length, own, values)
        stiffness[which] = total
        rest[which] = np.where(total != 0.0, length - tension / np.where(total != 0.0, total, 1.0), rest[which])
    return replace(snapshot, springs=replace(springs, stiffness=stiffness, rest_length=rest))


def field_values(entry: Any, snapshot: Snapshot, which: np.ndarray) -> dict[str, Any]:
    """The numbers of a field's formula for some particles at the start."""
    given: dict[str, Any] = {name: snapshot.position[which, k] for k, name in enumerate("xyz")}
    given |= {f"v{name}": snapshot.velocity[which, k] for k, name in enumerate("xyz")}
    given |= {"m": snapshot.mass[which], "q": snapshot.charge[which], "R": snapshot.radius[which]}
    return given | {"t": np.zeros(len(which))} | {name: np.float64(value) for name, value in values_of(entry).items()}


def _wrong_slopes(energy: Any, slope: np.ndarray, rounding: Any, at: np.ndarray, size: np.ndarray) -> np.ndarray:
    """The places at which a slope is not the difference quotient of an energy, though two such quotients agree there."""
    h = WIDTH * size
    sides = {k: np.broadcast_to(energy(at + k * h), at.shape) for k in (-4, -2, -1, 1, 2, 4)}
    near = (8.0 * (sides[1] - sides[-1]) - (sides[2] - sides[-2])) / (12.0 * h)
    far = (8.0 * (sides[2] - sides[-2]) - (sides[4] - sides[-4])) / (24.0 * h)
    allowed = SLOPE_ERROR * (np.abs(slope) + np.max([np.abs(each) for each in sides.values()], axis=0) / size)
    allowed += ROUNDINGS_AROUND * np.finfo(float).eps * rounding / h
    return np.flatnonzero((np.abs(near - far) < allowed) & (np.abs(near - slope) > 2.0 * allowed))


def place_of(entry: Any) -> Location:
    """The place of a formula in its file; of its force where the formula is not in the scene."""
    found: Location = next((each.place for each in texts_of(entry) if hasattr(each, "place")), entry.location)
    return found
