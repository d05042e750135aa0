"""Heavy loops: parallel loops of few iterations with much work each.

Taichi gives a CPU thread no fewer than 512 iterations of a parallel loop, so that a loop of 16 chunks would run on one thread.
A heavy loop therefore has `grain` iterations for each piece of work, and only the first of them works:

    grain = ti.static(loop_grain())
    for q in range(pieces * grain):
        if is_heavy(q, grain):
            piece = q // grain
            ...

The test stands before the division, so that an iteration without work costs one branch: a reduction over 64 chunks took 1.4
times as long where each iteration first computed the index of its piece.
"""

import taichi as ti

from mpp_taichi.device.fast_taichi.serial_loops import SerialLoops, on_cpu
from mpp_taichi.types import Template

CPU_GRAIN = 512  # iterations of a parallel loop that Taichi gives a CPU thread at least


def loop_grain() -> int:
    """Iterations of a heavy loop for each piece of work; a kernel asks while it is compiled."""
    return CPU_GRAIN if on_cpu() and SerialLoops.depth == 0 else 1


@ti.func
def is_heavy(q, grain: Template):
    """Whether iteration q of a heavy loop works; its piece of work is q // grain."""
    return q % grain == 0
