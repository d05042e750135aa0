"""Half-springs: each spring as two entries, at either end, in the order in which a kernel gathers their forces."""

import numpy as np

from mpp_taichi.snapshot import Snapshot


def half_springs(snapshot: Snapshot) -> dict[str, np.ndarray]:
    """The half-springs of all springs, sorted by the particle that each pulls at: compressed sparse rows.

    Row i goes from spring_start[i] to spring_start[i+1]. Within a row the order is the order of the scene, so that sums are
    repeatable.
    """
    springs = snapshot.springs
    ends = np.concatenate([springs.between[:, 0], springs.between[:, 1]])
    others = np.concatenate([springs.between[:, 1], springs.between[:, 0]])
    number = np.tile(np.arange(len(springs)), 2)
    order = np.lexsort((number, ends))
    counts = np.bincount(ends, minlength=snapshot.particle_count)
    return {
        "spring_start": np.concatenate([[0], np.cumsum(counts)]).astype(np.int32),
        "spring_neighbor": others[order].astype(np.int32),
        "spring_stiffness": springs.stiffness[number[order]],
        "spring_rest_length": springs.rest_length[number[order]],
        "spring_damping": springs.damping[number[order]],
    }
