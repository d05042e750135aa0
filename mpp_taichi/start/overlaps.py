"""Overlaps of spheres with each other and with walls at the start: found, refused or removed. Host side."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from mpp_taichi.errors import SceneError
from mpp_taichi.scene.layout import ParticleLayout
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.start.contact_setup import ContactSetup, contact_setup
from mpp_taichi.start.wall_steps import check_wall_steps
from mpp_taichi.walls._base import Surface
from mpp_taichi.wording.told_apart import told_apart

ALLOWED = 1e-9
"""The largest overlap, in units of the smaller radius, that rounding can cause: spheres with such an overlap touch."""
PAIRS_SHOWN = 20  # of entries whose spheres overlap
LARGE = 4.0  # times the median radius: larger spheres are compared with all others, so that cells may stay small
MOST_ROUNDS = 10_000  # rounds of pushing pairs apart


def overlapping_pairs(setup: ContactSetup, position: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pairs (m, 2) with i < j that overlap, and the depth of each overlap [length], (m,).

    Small spheres are sorted by cells as wide as the largest diameter among them; the few large spheres are compared with all
    spheres. Two spheres held fixed are left out, since they cannot be moved.
    """
    radius = setup.radius
    large = radius > LARGE * np.median(radius)
    candidates = [_of_cells(setup, position, np.flatnonzero(~large & (radius > 0.0)))]
    numbers = np.arange(len(radius))
    for i in np.flatnonzero(large):
        others = numbers[~large | (numbers > i)]
        candidates.append(np.stack([np.full(len(others), i), others], axis=1))
    pairs = np.sort(np.concatenate(candidates), axis=1)
    depth = _depth(setup, position, pairs)
    held = ~np.any(setup.inverse_mass, axis=1)
    found = (depth > 0.0) & ~(held[pairs[:, 0]] & held[pairs[:, 1]])
    pairs, depth = pairs[found], depth[found]
    order = np.lexsort((pairs[:, 1], pairs[:, 0]))
    return pairs[order], depth[order]


def _separation(setup: ContactSetup, position: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    """x_j − x_i, between the nearest copies in a periodic box."""
    separation = position[pairs[:, 1]] - position[pairs[:, 0]]
    for axis, period in enumerate(setup.enclosure.period):
        if period > 0.0:
            separation[:, axis] -= period * np.round(separation[:, axis] / period)
    return separation


def _depth(setup: ContactSetup, position: np.ndarray, pairs: np.ndarray) -> np.ndarray:
    distance = np.linalg.norm(_separation(setup, position, pairs), axis=1)
    return setup.radius[pairs[:, 0]] + setup.radius[pairs[:, 1]] - distance


def _of_cells(setup: ContactSetup, position: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Pairs of the chosen spheres in the same cell or in neighbouring cells, each pair once."""
    if len(chosen) < 2:
        return np.zeros((0, 2), dtype=np.int64)
    edge = 2.0 * setup.radius[chosen].max()
    period = np.asarray(setup.enclosure.period)
    places = position[chosen] - np.where(period > 0.0, setup.enclosure.origin, 0.0)
    # A cell must not be narrower than the edge, and a whole number of them must fill a period.
    whole = np.where(period > 0.0, np.maximum(np.floor(period / edge), 1.0), 0.0)
    size = np.where(whole > 0.0, period / np.maximum(whole, 1.0), edge)
    cells = np.floor(places / size).astype(np.int64)
    cells = np.where(whole > 0.0, np.mod(cells, np.maximum(whole, 1.0).astype(np.int64)), cells - cells.min(axis=0))
    counts = np.where(whole > 0.0, whole, cells.max(axis=0) + 1.0).astype(np.int64)

    def key(of: np.ndarray) -> np.ndarray:
        return (of[:, 0] * (counts[1] + 2) + of[:, 1]) * (counts[2] + 2) + of[:, 2]

    keys = key(cells)
    order = np.argsort(keys, kind="stable")
    ordered = keys[order]
    found = []
    reach = [(-1, 0, 1) if count > 1 else (0,) for count in counts]
    for offset in np.stack(np.meshgrid(*reach, indexing="ij"), axis=-1).reshape(-1, 3):
        target = cells + offset
        target = np.where(whole > 0.0, np.mod(target, counts), target)
        inside = np.all((target >= 0) & (target < counts), axis=1)
        first = np.searchsorted(ordered, key(target), side="left")
        length = np.where(inside, np.searchsorted(ordered, key(target), side="right") - first, 0)
        one = np.repeat(np.arange(len(chosen)), length)
        other = order[np.repeat(first - np.cumsum(length) + length, length) + np.arange(length.sum())]
        once = one < other
        found.append(np.stack([chosen[one[once]], chosen[other[once]]], axis=1))
    return np.unique(np.concatenate(found), axis=0)


def surface_depth(
    surface: Surface, position: np.ndarray, radius: np.ndarray, time: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """The depth of spheres in a wall [length], (n,), negative for spheres outside it, and the direction out of it (n, 3)."""
    if surface.turning is not None:
        at_rest = replace(surface, turning=None, motion=None, velocity=(0.0, 0.0, 0.0))
        depth, outward = surface_depth(at_rest, surface.brought_back(position, time), radius)
        return depth, outward @ surface.turning.matrix(time).T
    point = np.asarray(surface.point) + surface.shift_at(time)
    direction = np.asarray(surface.direction)
    offset = position - point
    if surface.kind == "plane":
        return radius - offset @ direction, np.broadcast_to(direction, offset.shape)
    if surface.kind == "segment":
        return _segment_depth(surface, offset, radius)
    if surface.kind == "cylinder":
        offset = offset - np.outer(offset @ direction, direction)
    distance = np.linalg.norm(offset, axis=1)
    outward = offset / np.maximum(distance, 1e-300)[:, None]
    return (distance + radius - surface.radius, -outward) if surface.inside else (surface.radius + radius - distance, outward)


def bounced(surfaces: Sequence[Surface], snapshot: Snapshot, since: float) -> Snapshot:
    """The particles with the ways mirrored on which they flew into a wall within the time `since`, as they bounce there.

    Particles that were in the wall before, such as balls that rest in it by a rounding error, stay.
    """
    position, speed = snapshot.position, np.linalg.norm(snapshot.velocity, axis=1)
    for surface in surfaces:
        depth, outward = surface_depth(surface, position, snapshot.radius, snapshot.time)
        into = (speed + surface.speed_at(snapshot.time, position)) * since
        went_in = (depth > 0.0) & (depth <= into) & snapshot.free.any(axis=1)
        position = np.where(went_in[:, None], position + 2.0 * depth[:, None] * outward, position)
    return replace(snapshot, position=position)


def _segment_depth(surface: Surface, offset: np.ndarray, radius: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The depth in a segment, and the direction out of it, for places relative to its begin."""
    across = np.array([-surface.direction[1], surface.direction[0], 0.0])
    way = np.subtract(surface.end, surface.point)
    share = np.clip((offset @ way) / (way @ way), 0.0, 1.0)
    apart = offset * (1.0, 1.0, 0.0) - np.outer(share, way)
    distance = np.linalg.norm(apart, axis=1)
    outward = np.where(distance[:, None] > 0.0, apart, across) / np.where(distance > 0.0, distance, 1.0)[:, None]
    return radius - distance, outward


def pushed_apart(setup: ContactSetup, position: np.ndarray) -> np.ndarray:
    """Positions without overlaps: in each round every pair is moved apart along its line, in proportion to the inverse masses.

    ValueError where MOST_ROUNDS rounds do not suffice, since the box has too little room.
    """
    position = position.copy()
    weight = setup.inverse_mass.max(axis=1)
    for _ in range(MOST_ROUNDS):
        pairs, depth = overlapping_pairs(setup, position)
        change = np.zeros_like(position)
        smaller = np.minimum(setup.radius[pairs[:, 0]], setup.radius[pairs[:, 1]])
        deep = depth > ALLOWED * smaller
        clear = not deep.any()
        separation = _separation(setup, position, pairs)
        distance = np.linalg.norm(separation, axis=1)
        # Coincident centres have no direction: each pair gets a different one, so that a heap of spheres opens on all sides.
        turned = np.random.default_rng(len(pairs)).normal(size=separation.shape) * (np.arange(3) < setup.dimensions)
        separation = np.where(distance[:, None] > 0.0, separation, turned)
        normal = separation / np.linalg.norm(separation, axis=1)[:, None]
        share = weight[pairs] / weight[pairs].sum(axis=1, keepdims=True)
        for end, sign in ((0, -1.0), (1, 1.0)):
            move = sign * (share[:, end] * depth)[:, None] * normal
            np.add.at(change, pairs[:, end], move)
        position += 0.5 * change * (setup.inverse_mass > 0.0)
        for surface in setup.enclosure.surfaces:
            into, out = surface_depth(surface, position, setup.radius)
            clear &= not (into > ALLOWED * setup.radius).any()
            position += np.maximum(into, 0.0)[:, None] * out * (setup.inverse_mass > 0.0)
        if clear:
            return position
    raise ValueError("there is no room to push all spheres apart")


def start_of_contacts(spec: SceneSpec, particles: Snapshot, layout: ParticleLayout) -> Snapshot:
    """The particles of a scene with contacts at the start: overlaps are refused, with the pair named, or pushed apart.

    The scene chooses by `overlap`. Velocities are unchanged. Raises SceneError, located at the contacts.
    """
    assert spec.contacts is not None
    setup = contact_setup(spec, particles)
    place = f"{spec.contacts.solver.location}: contacts.hard_spheres"
    _check_size(setup, layout)
    _check_radius(setup, layout)
    check_wall_steps(spec, setup)
    faults = _overlaps(setup, particles.position, layout)
    if faults and spec.contacts.overlap == "separate":
        try:
            return replace(particles, position=pushed_apart(setup, particles.position))
        except ValueError as error:
            raise SceneError(f"{place}.overlap: {error}: {faults[0]}") from None
    if faults:
        raise SceneError(*(f"{place}: {fault}" for fault in faults))
    return particles


def _check_size(setup: ContactSetup, layout: ParticleLayout) -> None:
    """Refuse spheres so large that two of them could touch at two places of a periodic box."""
    periods = [period for period in setup.enclosure.period if period > 0.0]
    largest = int(np.argmax(setup.radius))
    if periods and 4.0 * setup.radius[largest] > min(periods):
        radius, quarter = told_apart(setup.radius[largest], min(periods) / 4.0)
        size = f"has the radius {radius}, must be at most {quarter}, a quarter of the shortest period {min(periods):g}"
        raise SceneError(f"{layout.entries[layout.entry_of(largest)].location}: {layout.label(largest)} {size}")


def _check_radius(setup: ContactSetup, layout: ParticleLayout) -> None:
    """Refuse particles without a radius beside a segment: of a point on a segment nothing tells on which side it is."""
    points = np.flatnonzero((setup.radius <= 0.0) & setup.inverse_mass.any(axis=1))
    if setup.enclosure.segments and len(points):
        i = int(points[0])
        rule = f"has no radius, and {setup.enclosure.segments[0].label} has particles on both sides: give it a radius above 0"
        raise SceneError(f"{layout.entries[layout.entry_of(i)].location}: {layout.label(i)} {rule}")


def _overlaps(setup: ContactSetup, position: np.ndarray, layout: ParticleLayout) -> list[str]:
    """A line for every two entries whose spheres overlap, and for every wall that spheres reach into: the deepest overlap."""
    pairs, depth = overlapping_pairs(setup, position)
    real = depth > ALLOWED * np.minimum(setup.radius[pairs[:, 0]], setup.radius[pairs[:, 1]])
    deepest: dict[tuple[int, int], tuple[float, int, int, int]] = {}  # entries → depth, spheres, number of overlaps
    for (i, j), deep in zip(pairs[real].tolist(), depth[real].tolist()):
        key = (layout.entry_of(i), layout.entry_of(j))
        known, first, second, count = deepest.get(key, (0.0, i, j, 0))
        deepest[key] = (deep, i, j, count + 1) if deep > known else (known, first, second, count + 1)
    faults = []
    for deep, i, j, count in list(deepest.values())[:PAIRS_SHOWN]:
        more = f"; of their entries {count - 1} more pairs overlap, no deeper" if count > 1 else ""
        faults.append(
            f"{layout.label(i)} and {layout.label(j)} overlap by {deep:.3g}, move them or say overlap: separate{more}"
        )
    if len(deepest) > PAIRS_SHOWN:
        faults.append(f"… and {len(deepest) - PAIRS_SHOWN} more overlaps")
    for surface in setup.enclosure.surfaces:
        into, _ = surface_depth(surface, position, setup.radius)
        inside = np.flatnonzero((into > ALLOWED * setup.radius) & np.any(setup.inverse_mass, axis=1))
        if len(inside):
            i = int(inside[np.argmax(into[inside])])
            more = f"; {len(inside) - 1} more spheres reach into it, no deeper" if len(inside) > 1 else ""
            faults.append(
                f"{layout.label(i)} reaches {into[i]:.3g} into {surface.label}, move it or say overlap: separate{more}"
            )
    return faults
