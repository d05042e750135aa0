"""Splitting methods: a table of drifts and kicks, and one step for all of them."""

import math

import numpy as np
import taichi as ti

from mpp_taichi.integrators import _runge_kutta
from mpp_taichi.integrators._base import Integrator
from mpp_taichi.types import Template

# How v' = A + f(v) is solved inside a kick when a force depends on velocity: to the order of the whole method.
KICK_METHODS = {1: _runge_kutta.EULER, 2: _runge_kutta.MIDPOINT, 4: _runge_kutta.CLASSICAL}


class Splitting(Integrator):
    """Composition of drifts x += c h v and kicks v += d h a(x), taken in turn.

    With as many drifts as kicks plus one the step begins and ends with a drift; with one kick more than drifts it begins and
    ends with a kick, and the last force serves the first kick of the next step. Forces that depend on velocity are integrated
    inside each kick, positions frozen, by a Runge–Kutta method of the order of the splitting, so that the order is kept.
    Every splitting is symplectic for conservative forces; palindromic tables are time-reversible.
    """

    drifts: tuple = ()
    kicks: tuple = ()
    symplectic = True

    @property
    def time_reversible(self) -> bool:
        """Whether the table reads the same backwards."""
        return self.drifts == self.drifts[::-1] and self.kicks == self.kicks[::-1]

    @property
    def begins_with_kick(self) -> bool:
        """Kick–drift–…–kick."""
        return len(self.kicks) > len(self.drifts)

    @property
    def keeps_force(self) -> bool:
        """A step that begins with a kick uses the force that the step before ended with."""
        return self.begins_with_kick

    @property
    def entries(self) -> tuple:
        """(node, kick, drift) of each stage: the first is the opening drift, or a kick by the force that was kept."""
        kicks = self.kicks if self.begins_with_kick else (0.0, *self.kicks)
        drifts = (*self.drifts, 0.0) if self.begins_with_kick else self.drifts
        return tuple((sum(drifts[:k]), kick, drift) for k, (kick, drift) in enumerate(zip(kicks, drifts, strict=True)))

    @property
    def nodes(self) -> tuple:
        """Where the drifts have led to."""
        return tuple(node for node, _kick, _drift in self.entries[1:])

    @property
    def kick_rows(self) -> tuple:
        """Weights of the slopes that give each velocity on the way through a damped kick, and last the one at its end."""
        a, b = KICK_METHODS[self.order]
        return (*a, b)

    def scratch_count(self, velocity_dependent: bool) -> int:
        """Start velocities and slopes of the kick's own method."""
        return 1 + len(KICK_METHODS[self.order][1]) if velocity_dependent else 0

    def amplification(self, frequency: float, damping: float = 0.0) -> np.ndarray:
        """Product of the drifts and kicks; a kick multiplies v by the polynomial of its own method."""
        step = np.eye(2)
        for _node, kick, drift in self.entries:
            # v' = A − γ v over the time `kick`: v ← R(w) v + kick·φ(w) A with w = −γ·kick, R the Taylor series of exp.
            terms = [(-damping * kick) ** k / math.factorial(k) for k in range(len(KICK_METHODS[self.order][1]) + 1)]
            growth = math.fsum(terms)
            push = kick * math.fsum(term / (k + 1) for k, term in enumerate(terms[:-1]))
            step = np.array([[1.0, 0.0], [-push * frequency**2, growth]]) @ step
            step = np.array([[1.0, drift], [0.0, 1.0]]) @ step
        return step

    def loops(self, k: int, velocity_dependent: bool) -> int:
        """One, or two for each stage of a kick that forces change on the way."""
        _node, kick, drift = self.entries[k]
        if velocity_dependent and kick != 0.0:
            return 2 * len(KICK_METHODS[self.order][1])
        return 1 if kick != 0.0 or drift != 0.0 else 0

    @ti.func
    def stage(self, state: Template, total_force: Template, first, time: Template, dt: Template, k: Template):
        """A kick and the drift after it; a coefficient of zero costs nothing."""
        node, kick, drift = ti.static(self.entries[k])
        self.kick_and_drift(state, total_force, first, time + node * dt, dt, kick, drift, kick != 0.0, drift != 0.0)

    @ti.func
    def stage_after_force(self, state: Template, total_force: Template, first, time: Template, dt: Template, k):
        """The same with coefficients looked up while running: one copy of the code serves all stages."""
        node, kick, drift = 0.0, 0.0, 0.0
        for c in ti.static(range(1, self.evaluations + 1)):
            if k == c:
                node, kick, drift = self.entries[c]
        self.kick_and_drift(state, total_force, first, time + node * dt, dt, kick, drift, True, True)

    @ti.func
    def kick_and_drift(
        self,
        state: Template,
        total_force: Template,
        first,
        time,
        dt: Template,
        kick: Template,
        drift: Template,
        has_kick: Template,
        has_drift: Template,
    ):
        """v += kick·dt·a, then x += drift·dt·v, in one loop."""
        if ti.static(total_force.depends_on_velocity and has_kick):
            self.damped_kick(state, total_force, first, time, kick * dt, drift * dt, has_drift)
        else:
            for i in range(first, first + total_force.particle_count):
                if ti.static(has_kick):
                    state.velocity[i] = state.velocity[i] + kick * dt * state.acceleration[i]
                if ti.static(has_drift):
                    state.position[i] = state.position[i] + drift * dt * state.velocity[i]

    @ti.func
    def damped_kick(
        self,
        state: Template,
        total_force: Template,
        first,
        time: Template,
        h: Template,
        drift: Template,
        has_drift: Template,
    ):
        """Solve v' = acceleration + f(v) over h at fixed positions, then drift; two loops for each slope."""
        rows = ti.static(self.kick_rows)
        for s in ti.static(range(len(rows) - 1)):
            weights = ti.static(rows[s + 1])
            for i in range(first, first + total_force.particle_count):
                slope = total_force.local_acceleration(state, first, i, time, True)
                state.scratch[1 + s][i] = state.acceleration[i] + slope
            for i in range(first, first + total_force.particle_count):
                if ti.static(s == 0):
                    state.scratch_0[i] = state.velocity[i]
                velocity = state.scratch_0[i]
                for k in ti.static(range(s + 1)):
                    if ti.static(weights[k] != 0.0):
                        velocity += h * weights[k] * state.scratch[1 + k][i]
                state.velocity[i] = velocity
                if ti.static(has_drift and s == len(rows) - 2):
                    state.position[i] = state.position[i] + drift * velocity
