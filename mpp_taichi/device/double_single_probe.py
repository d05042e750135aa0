"""Whether double-single arithmetic, by which df64 computes its forces, is right on the device that runs.

The probe sums pulls of a few bodies with the functions of the runs themselves (arithmetic/), over fields and in a loop over
bodies, as a pair sum does, and takes a quotient and a root of each distance, as springs do.
"""

from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.arithmetic.force_numbers import root, zero_vector
from mpp_taichi.arithmetic.inverse_distance import inverse_distance
from mpp_taichi.arithmetic.low_parts import split
from mpp_taichi.arithmetic.particle_update import separation
from mpp_taichi.types import Template

COUNT = 24
SOFTENING = 0.1
OFFSET = 100.0  # of all bodies from the origin, so that separations need the low parts
ROUNDING = 32 * 2.0**-48
"""Relative error of a pull: 3 u² of a sum, 7 u² of each of five products, 10 u² of a quotient and 4 u² of each root, u = 2⁻²⁴,
less what errors in both directions cancel."""


@ti.kernel
def _pull(state: Template):
    for i in range(state.total_count):
        total = zero_vector(state)
        for j in range(state.total_count):
            if i != j:
                d = separation(state, i, j)
                squared = d.dot(d)
                inverse = inverse_distance(squared, SOFTENING)
                total += (inverse * inverse * inverse - 0.5 / root(squared)) * d
        for k in ti.static(range(state.dimensions)):
            state.acceleration[i][k], state.acceleration_low[i][k] = total[k].high, total[k].low


class _Bodies:
    """The part of a State that the sum reads and writes."""

    dimensions, total_count = 3, COUNT
    forces_see_low, forces_have_low, number_kind = True, True, None

    def __init__(self, started: Any, *, guards_rounding: bool) -> None:
        self.guards_rounding = guards_rounding
        for name in ("position", "position_low", "acceleration", "acceleration_low"):
            setattr(self, name, started.Vector.field(3, started.f32, shape=COUNT))
        self.nothing = started.field(started.i32, shape=())


def is_double_single_right(started: Any, *, guards_rounding: bool) -> bool:
    """Compare the pulls with those in float64 on the host."""
    state: Any = _Bodies(started, guards_rounding=guards_rounding)
    high, low = split(np.random.default_rng(1).uniform(-1.0, 1.0, (COUNT, 3)) + OFFSET)
    state.position.from_numpy(high)
    state.position_low.from_numpy(low)
    _pull(state)
    position = high.astype(np.float64) + low
    d = position[None] - position[:, None]
    squared = np.sum(d * d, axis=2) + np.eye(COUNT)
    terms = ((squared + SOFTENING) ** -1.5 - 0.5 / np.sqrt(squared))[:, :, None] * d
    sizes = ((squared + SOFTENING) ** -1.5 + 0.5 / np.sqrt(squared))[:, :, None] * np.abs(d)
    found = state.acceleration.to_numpy().astype(np.float64) + state.acceleration_low.to_numpy()
    return bool((np.abs(found - terms.sum(axis=1)) <= ROUNDING * sizes.sum(axis=1)).all())
