"""Half-springs: each spring as two entries, at either end, in the order in which a kernel gathers their forces."""

from collections.abc import Sequence

import numpy as np
import taichi as ti

from mpp_taichi.snapshot import Snapshot, Springs
from mpp_taichi.types import Template

VALUES = ("spring_stiffness", "spring_rest_length", "spring_damping")
"""The arrays of numbers, of which replicas may have rows of their own; the links are the same in all replicas."""


@ti.func
def own_entry(state: Template, first, h):
    """The entry of half-spring h in the arrays of numbers, for the replica whose first particle is `first`."""
    result = h
    if ti.static(state.own_springs):
        result += first // state.particle_count * state.half_spring_count
    return result


def values_of_replicas(starts: Sequence[Snapshot]) -> dict[str, np.ndarray]:
    """The numbers of the half-springs of each replica, one replica after the other."""
    hosts = [half_springs(start) for start in starts]
    return {name: np.concatenate([host[name] for host in hosts]) for name in VALUES}


def half_springs(snapshot: Snapshot) -> dict[str, np.ndarray]:
    """The half-springs of all springs, sorted by the particle that each pulls at: compressed sparse rows.

    Row i goes from spring_start[i] to spring_start[i+1]. Within a row the order is the order of the scene, so that sums are
    repeatable. `spring_number` is the number of the spring to which each half-spring belongs.
    """
    springs = snapshot.springs
    ends = np.concatenate([springs.between[:, 0], springs.between[:, 1]])
    others = np.concatenate([springs.between[:, 1], springs.between[:, 0]])
    order, number = _order(springs)
    counts = np.bincount(ends, minlength=snapshot.particle_count)
    return {
        "spring_start": np.concatenate([[0], np.cumsum(counts)]).astype(np.int32),
        "spring_neighbor": others[order].astype(np.int32),
        "spring_stiffness": springs.stiffness[number],
        "spring_rest_length": springs.rest_length[number],
        "spring_damping": springs.damping[number],
        "spring_number": number,
    }


def numbers_of_halves(snapshot: Snapshot) -> np.ndarray:
    """The number of the spring to which each half-spring belongs, (2 spring_count,)."""
    return _order(snapshot.springs)[1]


def _order(springs: Springs) -> tuple[np.ndarray, np.ndarray]:
    """The order of the half-springs among first and second ends of all springs, and the number of the spring of each."""
    ends = np.concatenate([springs.between[:, 0], springs.between[:, 1]])
    number = np.tile(np.arange(len(springs)), 2)
    order = np.lexsort((number, ends))
    return order, number[order]
