"""Checks of corrections to Newton's gravity between bodies that all move: what must stand beside them, and where they fail."""

from collections.abc import Iterator

import numpy as np

from mpp_taichi import component
from mpp_taichi.scene.contacts import merges
from mpp_taichi.scene.faults import Faults
from mpp_taichi.scene.layout import ParticleLayout
from mpp_taichi.scene.spec import ComponentSpec, Location, SceneSpec
from mpp_taichi.snapshot import Snapshot

MOST_BODIES = 128
"""Each sum over pairs runs in one thread, four times a step."""
LARGEST_ORDER = 0.1
"""Largest v²/c² and φ/c² at the start: the next terms of the series are of the order of its square, beside 1."""


def check_relativity(spec: SceneSpec, faults: Faults) -> None:
    """Refuse a correction without the whole of Newton's gravity beside it, and bodies that merge, are driven or change."""
    for number, entry in enumerate(spec.forces):
        if not entry.flag("forces", "needs_gravity"):
            continue
        key = f"forces[{number}].{entry.name}"
        told = _what_is_wrong(spec)
        if told:
            faults.add(entry.location, key, told)


def _what_is_wrong(spec: SceneSpec) -> str:
    gravity = spec.forces_with("gravitates")
    if not gravity:
        return f"corrects Newton's gravity, must stand beside {component.marked('forces', 'gravitates')[0]}"
    beside: ComponentSpec = gravity[0]
    solver = beside.parameters["solver"]
    if solver != "direct":
        return f"is a sum over all pairs, must stand beside {beside.name} with solver: direct, not {solver}"
    if beside.parameters["softening"] != 0.0:
        return f"is for points, must stand beside {beside.name} without softening"
    if beside.parameters["between"] is not None:
        return f"is for bodies that all attract each other, must stand beside {beside.name} without between:"
    if merges(spec):
        return "cannot be where spheres merge"
    if spec.driven_entries:
        return "is for bodies that move freely, cannot be beside bodies on a path"
    if spec.changing_entries:
        return "is for bodies of constant mass, cannot be beside masses or charges that change"
    if any(wall.flag("walls", "repeats") for wall in spec.walls):
        return "cannot be in a box that repeats"
    return ""


def relativity_faults(spec: SceneSpec, snapshot: Snapshot, layout: ParticleLayout) -> Iterator[tuple[Location, str]]:
    """Too many bodies, bodies that are held, and bodies so fast or near that the first order says nothing."""
    for number, entry in enumerate(spec.forces):
        if not entry.flag("forces", "needs_gravity"):
            continue
        where = f"forces[{number}].{entry.name}"
        first, count = entry.parameters["of"] or (0, snapshot.particle_count)
        bodies = slice(first, first + count)
        if count > MOST_BODIES:
            yield entry.location, f"{where}: sums over {count:,} bodies, allowed: up to {MOST_BODIES}; name a group with of:"
            continue
        held = ~snapshot.free[bodies, : spec.dimensions].all(axis=1)
        if held.any():
            told = "is held, must be free: the equations are those of bodies that all move"
            yield entry.location, f"{where}: {layout.label(first + int(np.argmax(held)))} {told}"
        order = _order(entry, snapshot, bodies)
        if order.max(initial=0.0) > LARGEST_ORDER:
            k = int(np.argmax(order))
            told = f"has v² or φ of {order[k]:.3g} c², must be below {LARGEST_ORDER:g} c² for an expansion in 1/c²"
            yield entry.location, f"{where}: {layout.label(first + k)} {told}"


def _order(entry: ComponentSpec, snapshot: Snapshot, bodies: slice) -> np.ndarray:
    """The larger of v²/c² and φ/c² of each body."""
    place, speed, mass = snapshot.position[bodies], snapshot.velocity[bodies], snapshot.mass[bodies]
    apart = np.linalg.norm(place[:, None] - place[None], axis=2)
    with np.errstate(divide="ignore", invalid="ignore"):
        potential = abs(entry.parameters["strength"]) * np.where(apart > 0.0, mass / apart, 0.0).sum(axis=1)
    return np.asarray(np.maximum((speed**2).sum(axis=1), potential) / entry.parameters["speed_of_light"] ** 2)
