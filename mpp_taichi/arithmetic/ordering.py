"""An order of the particles in which springs join near particles: the narrower the band, the cheaper its factors."""

import numpy as np


def narrow_order(particle_count: int, between: np.ndarray) -> np.ndarray:
    """Place of each particle in the order, (particle_count,): reverse Cuthill–McKee, from an end of each connected part.

    Source: Cuthill & McKee, Proc. 24th Nat. Conf. ACM (1969) 157; George & Liu's pseudo-peripheral start.
    """
    ends = np.concatenate([between[:, 0], between[:, 1]]).astype(np.int64)
    others = np.concatenate([between[:, 1], between[:, 0]]).astype(np.int64)
    by_end = np.argsort(ends, kind="stable")
    neighbors = others[by_end]
    start = np.concatenate([[0], np.cumsum(np.bincount(ends, minlength=particle_count))])
    degree = np.diff(start)
    order: list[int] = []
    seen = np.zeros(particle_count, dtype=bool)
    for seed in np.argsort(degree, kind="stable"):
        if seen[seed]:
            continue
        part = _levels(int(seed), start, neighbors, degree)
        part = _levels(part[-1], start, neighbors, degree)  # from the far end of the first sweep: longer, hence narrower
        order += part
        seen[part] = True
    place = np.empty(particle_count, dtype=np.int32)
    place[np.array(order[::-1], dtype=np.int64)] = np.arange(particle_count)
    return place


def _levels(seed: int, start: np.ndarray, neighbors: np.ndarray, degree: np.ndarray) -> list[int]:
    """All particles connected with the seed, by distance and then by the number of neighbours."""
    found, known, at = [seed], {seed}, 0
    while at < len(found):
        i = found[at]
        at += 1
        near = {int(j) for j in neighbors[start[i] : start[i + 1]]} - known
        found += sorted(near, key=lambda j: (degree[j], j))
        known |= near
    return found


def bandwidth(place: np.ndarray, between: np.ndarray) -> int:
    """Largest distance of two linked particles in the order."""
    return int(np.abs(place[between[:, 0]] - place[between[:, 1]]).max(initial=0))
