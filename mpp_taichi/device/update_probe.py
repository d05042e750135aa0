"""Whether the update of positions and velocities in f32c and ds keeps its rounding errors on the device that runs.

The probe runs the drift and the kick of the runs themselves (arithmetic/particle_update.py), over fields and in a loop over
particles and steps, as a step runs them.
"""

from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.arithmetic.low_parts import step_parts
from mpp_taichi.arithmetic.particle_update import drift_particle, kick_particle
from mpp_taichi.types import Template

STEPS = 1000
NUMBERS = (0.001, 1e-8 / 3)  # the factors of a kick and a drift: far below the rounding of an f32 of size 1


@ti.kernel
def _move(state: Template, steps: ti.i32):
    for i in range(state.total_count):
        for _ in range(steps):
            kick_particle(state, i, 0.0, 0, state.acceleration[i])
            drift_particle(state, i, 0.0, 1)


class _Particles:
    """The part of a State that the update reads and writes."""

    dimensions, total_count, carries_low = 3, 4, True

    def __init__(self, started: Any, *, guards_rounding: bool) -> None:
        self.guards_rounding = guards_rounding
        for name in ("position", "velocity", "position_low", "velocity_low", "acceleration"):
            setattr(self, name, started.Vector.field(3, started.f32, shape=4))
        self.step_parts = started.Vector.field(2, started.f32, shape=2)
        self.nothing = started.field(started.i32, shape=())


def keeps_low_parts(started: Any, *, guards_rounding: bool) -> bool:
    """Move particles of sizes 1 and 1000 by STEPS steps, and compare with exact arithmetic on the host.

    x grows by 3e-6 altogether. The growth in each step is below the rounding of x, so a plain f32 does not move. The bound
    allows for each step a rounding error of 2⁻²⁴ of its growth, and of 2⁻⁴⁸ of the number itself, which is beyond the low part.
    """
    state: Any = _Particles(started, guards_rounding=guards_rounding)
    start = np.outer([1.0, -1.0, 1000.0, 1.0 / 3.0], [1.0, 0.7, -0.3]).astype(np.float32)
    speed, pull = np.float32(np.abs(start)), np.float32(start * 1e-6)
    for field, values in ((state.position, start), (state.velocity, speed), (state.acceleration, pull)):
        field.from_numpy(values)
    state.step_parts.from_numpy(step_parts(list(NUMBERS)))
    _move(state, STEPS)
    kick, drift = NUMBERS
    number = np.arange(1, STEPS + 1)
    v = np.float64(speed) + kick * STEPS * np.float64(pull)
    x = np.float64(start) + drift * (STEPS * np.float64(speed) + kick * number.sum() * np.float64(pull))
    found_v = state.velocity.to_numpy().astype(np.float64) + state.velocity_low.to_numpy()
    found_x = state.position.to_numpy().astype(np.float64) + state.position_low.to_numpy()
    allowed_v = 2.0**-24 * kick * STEPS * np.abs(pull) + STEPS * 2.0**-48 * np.abs(v)
    allowed_x = 2.0**-24 * drift * STEPS * np.abs(v) + STEPS * 2.0**-48 * np.abs(x)
    return bool((np.abs(found_v - v) <= allowed_v).all() and (np.abs(found_x - x) <= allowed_x).all())
