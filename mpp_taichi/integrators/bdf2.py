"""Backward differentiation formula of second order."""

from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.component import component, param
from mpp_taichi.integrators._implicit import Implicit, oscillator
from mpp_taichi.types import Template


@component
class Bdf2(Implicit):
    """Two-step formula y₁ = (4 y − y₋₁)/3 + (2h/3) y₁′ for x and v: second order. It damps motions that a step cannot resolve.

    A slow oscillation loses about π(ωh)³ of its energy per period; a fast oscillation vanishes in a few steps. The first step,
    and the first step of another length, are steps of implicit Euler.
    Source: Curtiss & Hirschfelder, PNAS 38 (1952) 235; Hairer & Wanner, §V.1.
    """

    dt: float = param(above=0.0, unit="time", help="time step")
    solver: str = param("auto", choices=("auto", "conjugate_gradients", "direct"), help="solver of Newton's linear systems")
    tolerance: float = param(
        None, optional=True, above=0.0, maximum=0.01, help="relative error of a step's displacement; absent: by precision"
    )
    order = 2
    extra_vectors = ("earlier_shift", "earlier_velocity")

    def amplification(self, frequency: float, damping: float = 0.0) -> np.ndarray:
        """Matrix of two states, the newer first."""
        newer = np.linalg.inv(np.eye(2) - 2.0 / 3.0 * oscillator(frequency, damping))
        return np.block([[4.0 / 3.0 * newer, -newer / 3.0], [np.eye(2), np.zeros((2, 2))]])

    @ti.func
    def coefficients(self, state: Template, first, dt):
        """(b, g); the values of implicit Euler where the step before had another length, or there was no step before."""
        part = ti.cast(1.0, float)
        if state.history_dt[first // self.newton.particle_count] == dt:
            part = 2.0 / 3.0
        return part * part * dt * dt, part * dt

    def host_coefficients(self, state: Any, dt: float) -> tuple[float, float]:
        """`coefficients`, on the host."""
        part = 2.0 / 3.0 if state.history_dt[0] == state.rounded(dt) else 1.0
        return part * part * dt * dt, part * dt

    @ti.func
    def begin(self, state: Template, i, dt, b):
        """Set the bases from the two earlier states, y₁ = y + (y − y₋₁)/3 + …; keep the velocity as the earlier velocity."""
        v = state.velocity[i]
        if b < dt * dt:
            state.base_velocity[i] = v + (v - state.earlier_velocity[i]) / 3.0
            state.base_shift[i] = state.earlier_shift[i] / 3.0 + 2.0 / 3.0 * dt * state.base_velocity[i]
        else:
            state.base_velocity[i] = v
            state.base_shift[i] = dt * v
        state.earlier_velocity[i] = v

    @ti.func
    def finish(self, state: Template, i, dt, b, g):
        """The stage is the end of the step; its displacement is kept unrounded for the next step."""
        state.earlier_shift[i] = state.base_shift[i] + state.shift[i]
        state.position[i] = state.piece_start[i] + state.earlier_shift[i]
        state.velocity[i] = state.base_velocity[i] + (g / b) * state.shift[i]
