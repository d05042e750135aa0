"""Warnings for spring networks whose motion may surprise their author; one line each, logged when a scene is assembled."""

import logging
from collections.abc import Iterator

import numpy as np

from mpp_taichi.scene.layout import ParticleLayout, build
from mpp_taichi.scene.spec import ComponentSpec, SceneSpec
from mpp_taichi.snapshot import Snapshot

log = logging.getLogger(__name__)
_FLAT = 1e-9  # of the lattice's size: smaller distances from its plane are rounding
_HELD_ALL_ROUND = ("rim", "ends")


def warn_of_networks(spec: SceneSpec, snapshot: Snapshot, layout: ParticleLayout) -> None:
    """Log a warning for springs without a direction and for lattices without linear modes."""
    for line in (*_without_direction(spec, snapshot, layout), *_without_linear_modes(spec, snapshot, layout)):
        log.warning("%s", line)


def _without_direction(spec: SceneSpec, snapshot: Snapshot, layout: ParticleLayout) -> Iterator[str]:
    """The first spring whose ends coincide although its rest length is not 0, so that its force has no direction."""
    springs = snapshot.springs
    ends = snapshot.position[springs.between]
    together = np.all(ends[:, 0] == ends[:, 1], axis=1)
    if not together.any():
        return
    entry_of = np.repeat(np.arange(len(spec.springs)), [_count(entry, layout) for entry in spec.springs])
    linear = np.array([entry.parameters.get("rest_length") == 0.0 or entry.flag("networks", "bends") for entry in spec.springs])
    found = np.flatnonzero(together & ~linear[entry_of])
    if len(found):
        number = int(entry_of[found[0]])
        entry = spec.springs[number]
        first, second = (layout.label(int(end)) for end in springs.between[found[0]])
        others = f" ({len(found) - 1} more such springs)" if len(found) > 1 else ""
        yield (
            f"{entry.location}: springs[{number}].{entry.name}: the ends of the spring between {first} and {second} are at the "
            f"same place: it has no direction and exerts no elastic force until they part{others}"
        )


def _without_linear_modes(spec: SceneSpec, snapshot: Snapshot, layout: ParticleLayout) -> Iterator[str]:
    """Flat lattices, held along all edges, without prestretch and hinges, whose start is displaced across their plane."""
    pulled = bool(spec.forces_with("is_uniform"))  # a lattice that hangs under its weight is taut
    for number, entry in enumerate(spec.springs):
        if not entry.flag("networks", "links_lattice") or entry.parameters["prestretch"] != 1.0 or pulled:
            continue
        name = entry.parameters["of"]
        others = [other for other in spec.springs if other.parameters.get("of") == name]
        taut = any(other.flag("networks", "bends") or other.parameters["prestretch"] > 1.0 for other in others)
        start, counts = layout.lattice(name)
        lattice = spec.particles[layout.entry_of(start)].parameters
        rows = slice(start, start + counts[0] * counts[1] * counts[2])
        if not taut and lattice["fixed"] in _HELD_ALL_ROUND and _is_displaced_across(lattice, snapshot, rows):
            yield (
                f"{entry.location}: springs[{number}].{entry.name}: {name} has no prestretch, so that there is no linear mode "
                "across it: the frequency goes as the amplitude; prestretch: 1.5, say, makes a membrane of it"
            )
            return


def _is_displaced_across(lattice: dict, snapshot: Snapshot, rows: slice) -> bool:
    """Whether particles are outside the line or plane in which the lattice is at rest, or have a velocity out of it."""
    lower, upper = np.array(lattice["lower"]), np.array(lattice["upper"])
    across = (np.array(lattice["shape"]) == 1) | (lower == upper)
    size = np.abs(upper - lower).max()
    off = np.abs(snapshot.position[rows] - lower)[:, across]
    return bool((off > _FLAT * size).any() or snapshot.velocity[rows][:, across].any())


def _count(entry: ComponentSpec, layout: ParticleLayout) -> int:
    return build("networks", entry).spring_count(layout.lattice)
