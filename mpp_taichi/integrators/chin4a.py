"""Chin's forward method 4A, with a force gradient taken by displacement."""

from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.arithmetic.force_numbers import zero_vector
from mpp_taichi.arithmetic.particle_update import drift_particle, kick_particle, push_particle
from mpp_taichi.component import component, param
from mpp_taichi.device.fast_taichi.vector_fields import put_vector, vector_at
from mpp_taichi.integrators._base import Integrator, SumForces
from mpp_taichi.integrators._launchers import Launchers
from mpp_taichi.types import Template

GRADIENT = 1 / 24


@component
class Chin4a(Integrator):
    """Kick ⅙, drift ½, kick ⅔ by a + (h²/24) ∇a·a, drift ½, kick ⅙: fourth order, all steps forward, three forces per step.

    The gradient needs no derivatives: a(x + (h²/24) a(x)), with every particle displaced, equals the gradient kick up to h⁴.
    Every kick is undone by the opposite kick, so that the method is time-reversible; it is symplectic up to fifth order in the
    step, and energy errors of regular motion stay bounded. Forces that depend on velocity are refused: kicks must commute.
    Source: Chin, Phys. Lett. A 226 (1997) 344, 4A; the displacement: Wisdom, Holman & Touma, Fields Inst. Commun. 10 (1996)
    217, Omelyan, Phys. Rev. E 74 (2006) 036703.
    """

    dt: float = param(above=0.0, unit="time", help="time step")
    order = 4
    symplectic = True  # up to fifth order in the step: see above
    time_reversible = True
    takes_velocity = False
    takes_low_parts = True
    takes_any_numbers = True
    launchers = Launchers(vectors=True)
    nodes = (0.5, 0.5, 1.0)

    def prepare(self, state: Any, total_force: Any, time: float, sum_forces: SumForces) -> None:
        """The opening kick uses the force that the step before ended with."""
        sum_forces(total_force, time)

    def scratch_count(self, velocity_dependent: bool) -> int:
        """One: the positions before they are displaced."""
        return 1

    def low_scratch_count(self) -> int:
        """One: the low parts of these positions."""
        return 1

    def step_numbers(self, dt: float) -> list[float]:
        """Factors of the outer kick, the drift, the displacement and the inner kick."""
        return [dt / 6, dt / 2, GRADIENT * dt * dt, dt * 2 / 3]

    def amplification(self, frequency: float, damping: float = 0.0) -> np.ndarray:
        """Product of the kicks and drifts; ValueError with damping, which the method does not take."""
        if damping != 0.0:
            raise ValueError("chin4a takes no forces that depend on velocity")
        w = frequency**2
        outer = np.array([[1.0, 0.0], [-w / 6, 1.0]])
        middle = np.array([[1.0, 0.0], [-2 / 3 * w * (1.0 - GRADIENT * w), 1.0]])
        drift = np.array([[1.0, 0.5], [0.0, 1.0]])
        return outer @ drift @ middle @ drift @ outer

    def loops(self, k: int, total_force: Any) -> int:
        """Every stage is one loop."""
        return 1

    @ti.func
    def stage(self, state: Template, total_force: Template, first, time: Template, dt: Template, k: Template):
        """Opening kick and drift; displacement; kick by the displaced force, back and drift; closing kick."""
        for i in range(first, first + total_force.particle_count):
            acceleration = zero_vector(state)
            if ti.static(total_force.has_velocity_independent):
                acceleration = vector_at(state.acceleration, i)
            if ti.static(k == 0):
                kick_particle(state, i, dt / 6, 0, acceleration)
                drift_particle(state, i, 0.5 * dt, 1)
            elif ti.static(k == 1):
                put_vector(state.scratch_0, i, state.position[i])
                if ti.static(state.carries_low):
                    state.scratch_1[i] = state.position_low[i]
                if ti.static(state.carries_rest):
                    state.scratch_2[i] = state.position_rest[i]
                push_particle(state, i, GRADIENT * dt * dt, 2, acceleration)
            elif ti.static(k == 2):
                kick_particle(state, i, dt * 2 / 3, 3, acceleration)
                put_vector(state.position, i, state.scratch_0[i])
                if ti.static(state.carries_low):
                    state.position_low[i] = state.scratch_1[i]
                if ti.static(state.carries_rest):
                    state.position_rest[i] = state.scratch_2[i]
                drift_particle(state, i, 0.5 * dt, 1)
            else:
                kick_particle(state, i, dt / 6, 0, acceleration)
