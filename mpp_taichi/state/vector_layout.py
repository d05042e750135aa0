"""Vector layout: how the vectors of all particles (positions, velocities, stages) lie in memory. Host side; no Taichi."""

from enum import Enum


class VectorLayout(Enum):
    """Three ways to place the vectors.

    BY_COMPONENT   each component of each vector is an array: a sum over pairs streams through all x, all y and all z
    BY_PARTICLE    each vector is an array of particles: a sum over springs reaches for single particles
    SIDE_BY_SIDE   all vectors of a particle lie side by side: a thread of the CPU works on one copy of a small system, whose
                   numbers are then in few lines of its cache. As arrays of 256 or 2048 copies, the numbers of a copy are a
                   multiple of 2048 bytes apart, and share so few places of the cache that each step loads them anew: three
                   bodies took twice (`implicit_midpoint`) to 4.5 times (`dop853`) as long, 128 bodies up to 1.5 times
    """

    BY_COMPONENT = 1
    BY_PARTICLE = 2
    SIDE_BY_SIDE = 3


def layout_of(streams: bool, replica_count: int, *, on_cpu: bool) -> VectorLayout:
    """The layout where a sum over pairs `streams` over the particles, or not.

    On a GPU neighbouring threads work on neighbouring copies, and read neighbouring entries of each array.
    """
    if on_cpu and replica_count > 1:
        return VectorLayout.SIDE_BY_SIDE
    return VectorLayout.BY_COMPONENT if streams else VectorLayout.BY_PARTICLE
