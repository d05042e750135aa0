"""Neighbors: a course followed by a backend itself, where NumPy cannot follow it or not for long.

The backend, in f64, its forces found right, runs from the start and from COPIES starts beside it: every place off by a
rounding, every velocity by one and by what the roundings of a force make of it in a step. How far the neighbors have come
away shows what the motion makes of one step's roundings; each of n steps adds as much, amplified no more than the most that
was seen until then. So σ is n times that, times the updates of a step. What it finds is whether two backends differ by more
than rounding, not which of them is wrong.

Where spheres meet, rounding may decide whether they do, or in which step; then two sound runs differ by much. With δ for what
rounding has moved, that has a chance of about δ over the radius or the way of a step, whichever is shorter, for each contact.
Looks are judged as long as the chance is below CHANCE. Where contacts are resolved in groups, a scene may have them touch, and
rounding is to leave them closer than what counts as touching, too.
"""

from collections.abc import Sequence

import numpy as np

from mpp_taichi.compare.course import AMPLITUDE, CHANCE, COPIES, ReferenceCourse
from mpp_taichi.compare.numpy_reference import kept, norm
from mpp_taichi.contacts._base import TOUCHING_POWER
from mpp_taichi.snapshot import Snapshot

SEED = 2


def starts(start: Snapshot, precisions: Sequence[str], free: np.ndarray, push: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions and velocities, (starts, N, 3): as each precision keeps them, in f64, and COPIES beside the last.

    `push` is what one rounding of every term of its force, in units of that rounding, adds to a velocity in a step, (N, 3).
    """
    position, velocity = start.position, start.velocity * start.free
    signs = np.random.default_rng(SEED).choice((-1.0, 1.0), (2, COPIES, *position.shape)) * AMPLITUDE * free
    places = [*(kept(position, precision) for precision in precisions), position]
    speeds = [*(kept(velocity, precision) for precision in precisions), velocity]
    places += [position + sign * np.abs(position) for sign in signs[0]]
    speeds += [velocity + sign * (np.abs(velocity) + push) for sign in signs[1]]
    return np.stack(places), np.stack(speeds)


def course(
    precisions: Sequence[str],
    looks: Sequence[int],
    places: np.ndarray,
    speeds: np.ndarray,
    *,
    updates: int,
    size: float,
    given_by: str,
    limits: np.ndarray | None = None,
) -> ReferenceCourse:
    """Of what the backend did from the starts, (starts, looks, N, 3) each; `updates` of a position or velocity in a step."""
    count = len(precisions)
    steps = np.asarray(looks, int)
    growth = []
    for values in (places, speeds):
        apart = norm(values[-COPIES:] - values[count]).max(axis=0) / AMPLITUDE
        growth.append(np.maximum.accumulate(apart, axis=0) * (updates * steps)[:, None])
    typical = float(np.sqrt(np.mean(np.sum(speeds[:count] ** 2, axis=3)))) or 1.0
    return ReferenceCourse(
        tuple(precisions), steps, places[:count], speeds[:count], growth[0], growth[1], size, typical, given_by, limits
    )


def limits_of_contacts(start: Snapshot, dt: float, looks: Sequence[int], *, in_groups: bool = False) -> np.ndarray:
    """Displacements by rounding [length] up to which spheres are sure enough to meet all the same, for each look.

    `in_groups`: and to be still of the group that they touch.
    """
    radius = float(start.radius[start.radius > 0.0].min(initial=np.inf))
    way = dt * float(norm(start.velocity).max())
    contacts = start.particle_count * np.maximum(1.0, np.asarray(looks) * way / radius)
    limits = CHANCE * min(radius, way) / contacts
    return np.minimum(limits, np.finfo(float).eps ** TOUCHING_POWER * radius) if in_groups else limits
