"""Assembly: the entries of a scene → all its particles and springs, as one Snapshot."""

import bisect
import itertools
import logging
from dataclasses import replace
from typing import Any

import numpy as np

from mpp_taichi import component
from mpp_taichi.errors import PlacementError, SceneError
from mpp_taichi.generators._base import Center, GeneratorContext, Group
from mpp_taichi.networks._base import NetworkContext
from mpp_taichi.scene.contacts import merges
from mpp_taichi.scene.formulas.laws import is_formula
from mpp_taichi.scene.layout import ParticleLayout, build, layout_of
from mpp_taichi.scene.network_warnings import warn_of_networks
from mpp_taichi.scene.path_checks import warned_kinks
from mpp_taichi.scene.physics_checks import check_physics
from mpp_taichi.scene.spec import ComponentSpec, SceneSpec
from mpp_taichi.snapshot import PARTICLE_ARRAYS, ROD_ARRAYS, Rods, Snapshot, Springs
from mpp_taichi.start.overlaps import start_of_contacts
from mpp_taichi.start.rod_checks import check_rods

log = logging.getLogger(__name__)


def assemble(spec: SceneSpec, *, placed_as: SceneSpec | None = None) -> Snapshot:
    """Make every particle and spring; the same scene and seed give the same numbers.

    A later phase of a timeline is `placed_as` the scene of the first phase, whose forces determine the orbits. SceneError,
    located at the entry, where particles cannot be placed or the physics checks refuse them.
    """
    layout = layout_of(spec)
    groups = _place(spec if placed_as is None else replace(spec, forces=placed_as.forces), layout)
    arrays: dict[str, Any] = {key: np.concatenate([getattr(group, key) for group in groups]) for key in PARTICLE_ARRAYS}
    rest_position = np.concatenate([group.rest_position for group in groups])
    names = tuple(name for group in groups for name in group.name)
    driven = tuple(layout.starts[number] for number, _ in spec.driven_entries)
    changing = tuple(dict.fromkeys(layout.starts[number] for number, _, _ in spec.changing_entries))
    springs = _link(spec, layout, rest_position)
    merged_into = np.full(len(names), -1, np.int32) if merges(spec) else None
    rods = _rods(spec, arrays["position"])
    arrays |= {"driven": driven, "changing": changing}
    snapshot = Snapshot(**arrays, name=names, springs=springs, rods=rods, merged_into=merged_into)
    # Along a held axis a given velocity is ignored.
    snapshot = replace(snapshot, velocity=np.where(snapshot.moving, snapshot.velocity, 0.0))
    check_physics(spec, snapshot, layout, moved=placed_as is not None)
    check_rods(spec, snapshot, layout, moved=placed_as is not None)
    if placed_as is None:
        warn_of_networks(spec, snapshot, layout)
        _warn_of_formulas(spec)
        if spec.contacts is not None:
            snapshot = start_of_contacts(spec, snapshot, layout)
        for place, told in warned_kinks(spec):
            log.warning("%s: %s", place, told)
    return _centered(snapshot) if spec.move_to_center_of_mass else snapshot


def _warn_of_formulas(spec: SceneSpec) -> None:
    if any(is_formula(entry.name) for entry in spec.forces):
        from mpp_taichi.scene.formula_checks import warn_of_kinks, warn_of_unused  # with SymPy, only where there is a formula

        warn_of_kinks(spec)
        warn_of_unused(spec)


def springs_of(spec: SceneSpec) -> Springs:
    """Only the springs of a checked scene."""
    layout = layout_of(spec)
    return _link(spec, layout, np.concatenate([group.rest_position for group in _place(spec, layout)]))


def rest_positions(spec: SceneSpec) -> np.ndarray:
    """The positions of the particles of a checked scene without their displacements [length], shape (particle_count, 3)."""
    groups = _place(spec, layout_of(spec))
    rest = np.concatenate([group.rest_position for group in groups])
    if not spec.move_to_center_of_mass:
        return rest
    mass = np.concatenate([group.mass for group in groups])
    return rest - (mass / mass.sum()) @ rest


def _place(spec: SceneSpec, layout: ParticleLayout) -> list[Group]:
    """The groups of all entries; entries of the same component that need no context share a group."""
    gravity = next((entry.parameters for entry in spec.forces_with("gravitates")), {})
    groups: list[Group] = []
    first: list[int] = []  # index of the first particle of each group

    def find(index: int) -> Center:
        number = bisect.bisect_right(first, index) - 1
        if number < 0 or index - first[number] >= len(groups[number]):
            raise PlacementError(f"{layout.label(index)} is placed later, must come before in the list")
        group, row = groups[number], index - first[number]
        return Center(group.position[row], group.velocity[row], float(group.mass[row]), not group.free[row].any())

    number = 0
    for name, alike in itertools.groupby(spec.particles, key=lambda entry: entry.name):
        generator: Any = component.load("generators", name)
        entries, at = list(alike), 0
        while at < len(entries):
            group = generator.at_once(entries[i].parameters for i in range(at, len(entries)))
            together = 1 if group is None else len(group)
            if group is None:
                random = np.random.default_rng([spec.seed, number])
                context = GeneratorContext(
                    random, gravity.get("strength", 0.0), gravity.get("softening", 0.0), find, spec.dimensions, groups
                )
                group = _generated(entries[at], number, context)
            if spec.dimensions == 2 and np.any(out := (group.position[:, 2] != 0.0) | (group.velocity[:, 2] != 0.0)):
                row = int(np.flatnonzero(out)[0]) if together > 1 else 0
                where = f"{entries[at + row].location}: particles[{number + row}].{name}"
                raise SceneError(f"{where}: leaves the plane z = 0 of dimensions: 2")
            first.append(layout.starts[number])
            groups.append(group)
            number, at = number + together, at + together
    return groups


def _generated(entry: ComponentSpec, number: int, context: GeneratorContext) -> Group:
    try:
        made: Group = build("generators", entry).generate(context)
    except PlacementError as error:
        raise SceneError(f"{entry.location}: particles[{number}].{entry.name}: {error}") from None
    return made


def _link(spec: SceneSpec, layout: ParticleLayout, rest_position: np.ndarray) -> Springs:
    context = NetworkContext(rest_position, layout.lattice)
    made = []
    for number, entry in enumerate(spec.springs):
        try:
            made.append(build("networks", entry).generate(context))
        except PlacementError as error:
            raise SceneError(f"{entry.location}: springs[{number}].{entry.name}: {error}") from None
    return Springs.joined([Springs(), *made])


def _rods(spec: SceneSpec, position: np.ndarray) -> Rods:
    """The rods of a scene, as long as the positions say."""
    parts = [Rods(), *(build("networks", entry).rods(position) for _, entry in spec.rigid_entries)]
    return Rods(**{key: np.concatenate([getattr(part, key) for part in parts]) for key in ROD_ARRAYS})


def _centered(snapshot: Snapshot) -> Snapshot:
    """The particles shifted so that the centre of mass is at rest at the origin."""
    weight = snapshot.mass / snapshot.mass.sum()
    position = snapshot.position - weight @ snapshot.position
    return replace(snapshot, position=position, velocity=snapshot.velocity - weight @ snapshot.velocity)
