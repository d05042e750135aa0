"""Neighbors: a reference course computed by a backend itself, where NumPy cannot compute it or only a short part of it.

The backend, in f64 and with forces that have been confirmed, runs from the start and from COPIES neighboring starts: every
position is off by one rounding, every velocity by one rounding and by the effect of the roundings of a force in a step. The
distance of the neighbors shows how the motion amplifies the roundings of one step; each of n steps adds as much, amplified at
most by the largest factor seen until then. So σ is n times this distance, times the updates of a step. The comparison shows
whether two backends differ by more than rounding, not which of them is wrong.

Where spheres collide, rounding may decide whether they touch, or in which step; then two correct runs differ by much. If
rounding has moved spheres by δ, the probability of this for each contact is about δ over the radius or the way of a step,
whichever is shorter. Samples are judged as long as the probability is below CHANCE. Where contacts are resolved in groups,
spheres may touch at the start, and δ must also be smaller than the gap that counts as touching.
"""

from collections.abc import Sequence

import numpy as np

from mpp_taichi.compare.course import AMPLITUDE, CHANCE, COPIES, ReferenceCourse
from mpp_taichi.compare.numpy_reference import kept, norm
from mpp_taichi.contacts._base import TOUCHING_POWER
from mpp_taichi.snapshot import Snapshot

SEED = 2


def starts(start: Snapshot, precisions: Sequence[str], free: np.ndarray, push: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions and velocities, (starts, N, 3): as each precision stores them, in f64, and COPIES neighbors of the last.

    `push` is the change of a velocity in a step by one rounding of every term of its force, per rounding, (N, 3).
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
    """The course from the backend's runs, (starts, looks, N, 3) each, with `updates` of a position or velocity in a step."""
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
    """For each sample the displacement by rounding [length] up to which the contacts almost certainly stay the same.

    `in_groups`: and up to which spheres that touch are still found in one group.
    """
    radius = float(start.radius[start.radius > 0.0].min(initial=np.inf))
    way = dt * float(norm(start.velocity).max())
    contacts = start.particle_count * np.maximum(1.0, np.asarray(looks) * way / radius)
    limits = CHANCE * min(radius, way) / contacts
    return np.minimum(limits, np.finfo(float).eps ** TOUCHING_POWER * radius) if in_groups else limits
