"""Whether the update of positions and velocities in f32c and ds keeps its rounding errors on the device that runs.

The probe runs the drift and the kick of the runs themselves (arithmetic/particle_update.py), over fields and in a loop over
particles and steps, as a step runs them.
"""

from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.arithmetic.low_parts import split, step_parts
from mpp_taichi.arithmetic.particle_update import drift_particle, kick_particle
from mpp_taichi.types import Template

STEPS = 1000
NUMBERS = (0.001, 0.01 / 3)  # the factors of a kick and a drift; a kick is far below the rounding of an f32 of size 1
ROUNDING = 4 * 2.0**-48  # of an update, relative to the number and to its change (low_parts.py)


@ti.kernel
def _move(state: Template, steps: ti.i32):
    for i in range(state.total_count):
        for _ in range(steps):
            kick_particle(state, i, 0.0, 0, state.acceleration[i])
            drift_particle(state, i, 0.0, 1)


class _Particles:
    """The part of a State that the update reads and writes."""

    dimensions, total_count, carries_low, carries_rest = 3, 4, True, False

    def __init__(self, started: Any, *, guards_rounding: bool) -> None:
        self.guards_rounding = guards_rounding
        for name in ("position", "velocity", "position_low", "velocity_low", "acceleration"):
            setattr(self, name, started.Vector.field(3, started.f32, shape=4))
        self.step_parts = started.Vector.field(2, started.f32, shape=2)
        self.nothing = started.field(started.i32, shape=())


def keeps_low_parts(started: Any, *, guards_rounding: bool) -> bool:
    """Move particles of sizes 1 and 1000 by STEPS steps, and compare with exact arithmetic on the host.

    The velocities have low parts, and each change in a kick is below the rounding of a velocity: in f32 no velocity
    changes. Where a product is rounded to f32, a particle is off by 10³ of the bounds.
    """
    state: Any = _Particles(started, guards_rounding=guards_rounding)
    start = np.outer([1.0, -1.0, 1000.0, 1.0 / 3.0], [1.0, 0.7, -0.3])
    parts = {"position": split(start), "velocity": split(np.abs(start)), "acceleration": split(start * 1e-6)}
    for name, (high, low) in parts.items():
        getattr(state, name).from_numpy(high)
        if name != "acceleration":
            getattr(state, f"{name}_low").from_numpy(low)
    numbers = step_parts(list(NUMBERS))
    state.step_parts.from_numpy(numbers)
    _move(state, STEPS)
    kick, drift = numbers.astype(np.float64).sum(axis=1)
    x, speed = (_sum(*parts[name]) for name in ("position", "velocity"))
    pull, number = parts["acceleration"][0].astype(np.float64), np.arange(1, STEPS + 1)
    v = speed + kick * STEPS * pull
    x = x + drift * (STEPS * speed + kick * number.sum() * pull)
    # An error of the velocity moves a particle by its product with the time, and time and number of steps are the same here.
    allowed_v = ROUNDING * STEPS * np.maximum(np.abs(v), np.abs(speed))
    allowed_x = ROUNDING * STEPS * np.maximum(np.abs(x), np.abs(start)) + drift * STEPS * allowed_v
    fields = ((state.position, state.position_low), (state.velocity, state.velocity_low))
    found_x, found_v = (_sum(high.to_numpy(), low.to_numpy()) for high, low in fields)
    return bool((np.abs(found_v - v) <= allowed_v).all() and (np.abs(found_x - x) <= allowed_x).all())


def _sum(high: np.ndarray, low: np.ndarray) -> np.ndarray:
    return high.astype(np.float64) + low
