"""Leapfrog whose step follows the motion, and that can be run backwards."""

from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.arithmetic.particle_update import drifted, kicked
from mpp_taichi.component import component, param
from mpp_taichi.integrators._adaptive import Adaptive
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.types import Template


@component
@ti.data_oriented
class AdaptiveLeapfrog(Adaptive):
    """Kick–drift–kick of length h = η/ρ, its density ρ carried along: ρ_n+½ = ρ_n−½ + η G_n, G = (3/2) U̇/U.

    So ρ follows |U|^(3/2), U the potential energy of gravity: for two bodies h goes with r^(3/2), the local period. At
    the start ρ₀² = Σ m |a|² / |U|. G follows from quantities that a step has anyway, U̇ = −Σ m a·v and U = E − K with the energy
    E of the start, so the control costs no evaluation. G is odd in v, so that a run backwards takes the same steps, and the
    energy error of an orbit stays bounded as with a fixed step. Between two steps the state is on cubics through both ends.
    Second order: the error of an orbit is 0.5 η² to 10 η² of the system's size at any eccentricity up to 0.99, and grows with
    the number of orbits, not with its square. For Newtonian gravity only, whose potential has one sign. A close pair of light
    bodies among heavy bodies hardly changes U, and does not shorten the step.
    Source: Hairer & Söderlind, SIAM J. Sci. Comput. 26 (2005) 1838.
    """

    dt: float = param(None, optional=True, above=0.0, unit="time", help="time between samples; absent: run.duration / 1000")
    step: float = param(0.02, above=0.0, maximum=1.0, help="η, the step in units of 1/ρ; a circular orbit has 2π/η steps")

    order = 2
    time_reversible = True
    controlled_by = "step"
    made_for = ("gravitates",)
    made_for_reason = "its step follows a potential that has one sign"
    VECTORS = ("start_position", "start_velocity", "start_acceleration", "end_position", "end_velocity", "end_acceleration")
    memory = ("clock", "tally", "density", *VECTORS)

    def work_fields(self, total_force: Any, start: Snapshot, *, plan: str, on_cpu: bool) -> dict[str, tuple[str, int]]:
        """Both ends of the last step, the clock, and for each replica ρ and the energy E."""
        vectors = {name: ("vector", start.particle_count) for name in self.VECTORS}
        return {
            "clock": ("wide", self.CLOCK),
            "tally": ("index", self.TALLY),
            "control": ("wide", self.CONTROL),
            "density": ("wide", 2),
            **vectors,
        }

    def iterations_of_step(self, particles: int, per_evaluation: int) -> int:
        """The force, both halves of the step, the control of its length, and the state that is shown."""
        return per_evaluation + 4 * particles + 1

    def first_lengths(self, state: Any) -> np.ndarray:
        """η/ρ, of each replica [time]."""
        return self.step / np.abs(state.density.to_numpy()[::2])

    @ti.func
    def begin(self, state: Template, total_force: Template, first, time: Template, dt: Template, shape: Template):
        """Take the state as it is at `time`; the first half step of the density is an Euler step."""
        r = first // total_force.particle_count
        self.start_clock(state, r, time)
        self.evaluate(state, total_force, first, time, shape)
        kinetic, potential, pull = ti.cast(0.0, state.wide), ti.cast(0.0, state.wide), ti.cast(0.0, state.wide)
        for i in range(first, first + total_force.particle_count):
            state.end_position[i] = state.position[i]
            state.end_velocity[i] = state.velocity[i]
            state.end_acceleration[i] = state.acceleration[i]
            state.start_position[i] = state.position[i]
            state.start_velocity[i] = state.velocity[i]
            state.start_acceleration[i] = state.acceleration[i]
            m = ti.cast(state.mass[i], state.wide)
            kinetic += 0.5 * m * ti.cast(state.velocity[i].norm_sqr(), state.wide)
            pull += m * ti.cast(state.acceleration[i].norm_sqr(), state.wide)
            potential += total_force.potential_energy_of(state, first, i, ti.cast(time, float))
        state.density[2 * r + 1] = kinetic + potential
        density = ti.cast(1.0, state.wide)
        if pull > 0.0 and potential < 0.0:
            density = ti.sqrt(pull / -potential)
        state.density[2 * r] = density - 0.5 * state.control[self.CONTROL * r] * self._growth(state, total_force, first)

    @ti.func
    def advance_to(self, state: Template, total_force: Template, first, end: Template, most, shape: Template):
        """Take steps until a step ends at `end` or later, but no more than `most` steps."""
        r = first // total_force.particle_count
        eta = state.control[self.CONTROL * r]
        left = most
        while left > 0 and self.is_short_of(state, r, end):
            left -= 1
            begin = state.clock[self.CLOCK * r] + state.clock[self.CLOCK * r + 1]
            density = state.density[2 * r] + eta * self._growth(state, total_force, first)
            h = eta / density
            if not (density > 0.0 and begin + 1e-3 * h > begin):
                state.tally[self.TALLY * r + self.STALLED] = 1
            else:
                state.density[2 * r] = density
                state.clock[self.CLOCK * r], state.clock[self.CLOCK * r + 1] = begin, h
                self.count(state, r, self.STEPS, 1)
                self._take_step(state, total_force, first, begin, ti.cast(h, float), shape)

    @ti.func
    def show(self, state: Template, total_force: Template, first, time: Template):
        """Set the state on cubics through both ends of the last step: positions with velocities, velocities with accelerations.

        There are two cubics, as the velocities of a leapfrog differ from the slopes of its positions by an error of second
        order: the slope of the cubic of positions would deviate between two steps by more than the error of the run.
        """
        r = first // total_force.particle_count
        s, h = self.share_of_step(state, r, time), ti.cast(state.clock[self.CLOCK * r + 1], float)
        for i in range(first, first + total_force.particle_count):
            v, end_v = state.start_velocity[i], state.end_velocity[i]
            state.position[i] = self._cubic(state.start_position[i], state.end_position[i], h * v, h * end_v, s)
            a, end_a = state.start_acceleration[i], state.end_acceleration[i]
            state.velocity[i] = self._cubic(v, end_v, h * a, h * end_a, s)

    @ti.func
    def _cubic(self, start, end, slope, end_slope, s):
        """Hermite's cubic at s, 0 … 1."""
        way = end - start
        return start + s * (slope + s * ((3.0 * way - 2.0 * slope - end_slope) + s * (slope + end_slope - 2.0 * way)))

    @ti.func
    def _take_step(self, state: Template, total_force: Template, first, begin, h, shape: Template):
        for i in range(first, first + total_force.particle_count):
            state.start_position[i] = state.end_position[i]
            state.start_velocity[i] = state.end_velocity[i]
            state.start_acceleration[i] = state.end_acceleration[i]
            state.velocity[i] = kicked(state.end_velocity[i], state.end_acceleration[i], 0.5 * h)
            state.position[i] = drifted(state.end_position[i], state.velocity[i], h)
        self.evaluate(state, total_force, first, begin + h, shape)
        for i in range(first, first + total_force.particle_count):
            state.end_position[i] = state.position[i]
            state.end_acceleration[i] = state.acceleration[i]
            state.end_velocity[i] = kicked(state.velocity[i], state.acceleration[i], 0.5 * h)

    @ti.func
    def _growth(self, state: Template, total_force: Template, first):
        """The growth G of the density at the end of the last step."""
        r = first // total_force.particle_count
        kinetic, power = ti.cast(0.0, state.wide), ti.cast(0.0, state.wide)
        for i in range(first, first + total_force.particle_count):
            m = ti.cast(state.mass[i], state.wide)
            kinetic += 0.5 * m * ti.cast(state.end_velocity[i].norm_sqr(), state.wide)
            power += m * ti.cast(state.end_acceleration[i].dot(state.end_velocity[i]), state.wide)
        potential = state.density[2 * r + 1] - kinetic
        return -1.5 * power / potential if potential < 0.0 else ti.cast(0.0, state.wide)
