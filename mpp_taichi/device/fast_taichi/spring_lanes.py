"""Sums of spring forces with a particle in each lane of a vector register, which Taichi's own loops do not give.

Taichi leaves it to LLVM to find vectors in a loop, and LLVM 15 finds four half-springs of one particle at a time. Functions in
spring_lanes.c sum the rows of 16 particles (f32) or 8 particles (f64) side by side. They are called for slices: as many
particles, in their order, with the entries of their rows in turn.
"""

from pathlib import Path
from typing import Any

import taichi as ti

from mpp_taichi.device.fast_taichi import bitcode, switch
from mpp_taichi.types import Template

SOURCE = Path(__file__).with_suffix(".c")
VECTOR_BYTES = 64  # a register of AVX-512


def lanes(precision: str) -> int:
    """Particles of a slice: as many as numbers fit into a register."""
    return VECTOR_BYTES // (4 if precision == "f32" else 8)


def can_sum(precision: str) -> bool:
    """Whether the functions are for this processor and for numbers of this precision."""
    on = switch.is_on("spring_lanes") and bitcode.on_linux_x64() and bitcode.has_avx512()
    return on and precision in ("f32", "f64")


@ti.func
def sum_slice(elastic: Template, friction: Template, state: Template, velocity: Template, count, number):
    """Put the elastic forces, the friction or both of the half-springs of slice `number` into state.slice_pull, [force].

    `velocity` are the velocities that the friction reads, and `count` is the number of particles.
    """
    position = ti.get_addr(ti.static(state.position.get_scalar_field(0)), 0)
    moving = ti.get_addr(ti.static(velocity.get_scalar_field(0)), 0)
    start, neighbor = ti.get_addr(state.slice_start, 0), ti.get_addr(state.slice_neighbor, 0)
    stiffness, rest_length = ti.get_addr(state.slice_stiffness, 0), ti.get_addr(state.slice_rest_length, 0)
    damping, pull = stiffness, ti.get_addr(state.slice_pull, 0)
    if ti.static(friction):
        damping = ti.get_addr(state.slice_damping, 0)
    own, particles = number, count
    ti.static(
        _call(
            state, elastic, friction, position, moving, start, neighbor, stiffness, rest_length, damping, pull, own, particles
        )
    )


def _call(state: Any, elastic: bool, friction: bool, *variables: Any) -> Any:
    """Make the kernel that is compiled call the function for these forces, numbers and dimensions."""
    kind = "damped" if elastic and friction else "elastic" if elastic else "friction"
    name = f"{kind}_{'f32' if state.position.dtype == ti.f32 else 'f64'}_{state.dimensions}"
    return bitcode.call(SOURCE, name, *variables)
