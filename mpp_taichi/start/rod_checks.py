"""Rod checks: rods whose forces cannot be determined at the start; each message names the entry and the particles."""

from collections.abc import Iterator

import numpy as np

from mpp_taichi.errors import SceneError
from mpp_taichi.scene.faults import FAULTS_SHOWN
from mpp_taichi.scene.layout import ParticleLayout, build
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.state.rod_band import first_dependent, rod_band, rod_matrix

SMALLEST_PIVOT = 1e-9
"""Ratio of pivot and diagonal below which other rods fix the length of a rod; the pivot goes as the square of an angle."""
ALONG = 1e-6
"""Speed along a rod, as a part of the speed of its ends, above which it is no rounding of numbers in a scene."""


def check_rods(spec: SceneSpec, snapshot: Snapshot, layout: ParticleLayout, *, moved: bool) -> None:
    """Raise SceneError for rods that cannot be kept; once particles have `moved`, only their ends are checked."""
    if not len(snapshot.rods):
        return
    entries = [each for each in spec.rigid_entries for _ in range(len(build("networks", each[1]).rods(snapshot.position)))]
    found = list(_ends(snapshot, layout)) or ([] if moved else list(_motion(snapshot, spec.dimensions)))
    lines = []
    for rod, rule in found[:FAULTS_SHOWN]:
        number, entry = entries[rod]
        first, second = (layout.label(int(end)) for end in snapshot.rods.between[rod])
        lines.append(f"{entry.location}: springs[{number}].{entry.name}: between {first} and {second}: {rule}")
    if len(found) > len(lines):
        lines.append(f"{spec.source}: … and {len(found) - len(lines)} more faults")
    if lines:
        raise SceneError(*lines)


def _ends(snapshot: Snapshot, layout: ParticleLayout) -> Iterator[tuple[int, str]]:
    """Number of a rod, and the fault of its ends."""
    moves = [any(axes) for axes in snapshot.free.tolist()]
    seen: set[tuple[int, int]] = set()
    for rod, (first, second) in enumerate(snapshot.rods.between.tolist()):
        pair = (min(first, second), max(first, second))
        light = [end for end in pair if moves[end] and not snapshot.mass[end] > 0.0]
        if not (moves[first] or moves[second]):
            yield rod, "both ends are held fixed, so that a rod has nothing to do; remove it"
        elif light:
            yield rod, f"{layout.label(light[0])} has no mass, must have a mass above 0 or be held fixed"
        elif pair in seen:
            yield rod, "there is a rod between these two already, so that the force of each is not determined; remove one"
        elif not snapshot.rods.length[rod] > 0.0:
            yield rod, "both ends are at the same place, must be apart: a rod of length 0 has no direction"
        seen.add(pair)


def _motion(snapshot: Snapshot, dimensions: int) -> Iterator[tuple[int, str]]:
    """The first rod that others make superfluous; or the rods whose ends part at the start."""
    band = rod_band(snapshot)
    dependent = first_dependent(rod_matrix(snapshot, band, dimensions), SMALLEST_PIVOT)
    if dependent is not None:
        yield (
            int(band.number[dependent]),
            "other rods and held ends fix its length already, at least for small motions, so that the forces of these rods are "
            "not determined; remove it, or make it a spring",
        )
        return
    first, second = snapshot.rods.between.T
    direction = (snapshot.position[second] - snapshot.position[first]) / snapshot.rods.length[:, None]
    along = np.einsum("rk,rk->r", snapshot.velocity[second] - snapshot.velocity[first], direction)
    speed = np.linalg.norm(snapshot.velocity[second], axis=1) + np.linalg.norm(snapshot.velocity[first], axis=1)
    for rod in np.flatnonzero(np.abs(along) > ALONG * speed):
        yield int(rod), f"the ends part with the velocity {along[rod]:.3g} along the rod at the start, must be 0"
