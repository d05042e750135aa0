"""Sums over particles in a fixed order, so that the bits do not depend on the threads."""

import taichi as ti

from mpp_taichi.types import Template

CHUNK = 256  # terms that one thread adds up


def sum_fields(particle_count: int) -> dict[str, tuple[str, int]]:
    """Kind and count of the fields that the sums need."""
    chunks = -(-particle_count // CHUNK)
    return {
        "terms": ("wide_vector2", particle_count),
        "term_chunks": ("wide_vector2", chunks),
        "term_total": ("wide_vector2", 1),
    }


@ti.func
def zero_pair(state: Template):
    """Two sums of zero."""
    return ti.Vector([ti.cast(0.0, state.wide), ti.cast(0.0, state.wide)])


@ti.func
def dot(state: Template, a, b):
    """a·b in the widest float of the device."""
    result = ti.cast(0.0, state.wide)
    for k in ti.static(range(state.dimensions)):
        result += ti.cast(a[k], state.wide) * ti.cast(b[k], state.wide)
    return result


@ti.func
def reduce_terms(state: Template):
    """Two sums at once over `state.terms`: over chunks, then over the chunks. For the top of a kernel."""
    for c in range((state.particle_count + CHUNK - 1) // CHUNK):
        total = zero_pair(state)
        for i in range(c * CHUNK, ti.min((c + 1) * CHUNK, state.particle_count)):
            total += state.terms[i]
        state.term_chunks[c] = total
    for one in range(1):
        total = zero_pair(state)
        for c in range((state.particle_count + CHUNK - 1) // CHUNK):
            total += state.term_chunks[c]
        state.term_total[one] = total


def read_total(state) -> tuple[float, float]:
    """The two sums, on the host, which waits for the device."""
    total = state.term_total[0]
    return float(total[0]), float(total[1])
