"""Splitting methods: a table of drifts and kicks, and one step for all of them."""

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
    def evaluations(self) -> int:
        """One per kick, less the one that is handed on."""
        return len(self.kicks) - (1 if self.begins_with_kick else 0)

    def scratch_count(self, velocity_dependent: bool) -> int:
        """Start velocities and slopes of the kick's own method."""
        return 1 + len(KICK_METHODS[self.order][1]) if velocity_dependent else 0

    @ti.func
    def prepare(self, state: Template, total_force: Template, first, time, shape: Template):
        """A step that begins with a kick expects the acceleration."""
        if ti.static(self.begins_with_kick):
            total_force.accumulate(state, first, time, shape)

    def entries(self) -> list[tuple[float, float, float]]:
        """(node, kick, drift) in turn: force at `node`·dt, then the kick, then the drift.

        The first entry needs no new force: it is the opening drift, or the kick that uses the force of the step before.
        """
        kicks = self.kicks if self.begins_with_kick else (0.0, *self.kicks)
        drifts = (*self.drifts, 0.0) if self.begins_with_kick else self.drifts
        return [(sum(drifts[:k]), kick, drift) for k, (kick, drift) in enumerate(zip(kicks, drifts, strict=True))]

    @ti.func
    def step(self, state: Template, total_force: Template, first, time, dt, shape: Template):
        """Drift, kick, drift, … as the table says; each kick and the drift after it share one loop."""
        entries = ti.static(self.entries())
        for k in ti.static(range(len(entries))):
            node, kick, drift = ti.static(entries[k])
            if ti.static(k > 0):
                total_force.accumulate(state, first, time + node * dt, shape)
            self.kick_and_drift(state, total_force, first, time + node * dt, dt, kick, drift)

    @ti.func
    def kick_and_drift(self, state: Template, total_force: Template, first, time, dt, kick: Template, drift: Template):
        """v += kick·dt·a, then x += drift·dt·v; a zero coefficient costs nothing."""
        if ti.static(total_force.depends_on_velocity and kick != 0.0):
            self.damped_kick(state, total_force, first, time, kick * dt)
            if ti.static(drift != 0.0):
                for i in range(first, first + total_force.particle_count):
                    state.position[i] = state.position[i] + drift * dt * state.velocity[i]
        else:
            if ti.static(kick != 0.0 or drift != 0.0):
                for i in range(first, first + total_force.particle_count):
                    if ti.static(kick != 0.0):
                        state.velocity[i] = state.velocity[i] + kick * dt * state.acceleration[i]
                    if ti.static(drift != 0.0):
                        state.position[i] = state.position[i] + drift * dt * state.velocity[i]

    @ti.func
    def damped_kick(self, state: Template, total_force: Template, first, time, h):
        """Solve v' = acceleration + f(v) over h at fixed positions."""
        a, b = ti.static(KICK_METHODS[self.order])
        for i in range(first, first + total_force.particle_count):
            state.scratch_0[i] = state.velocity[i]
        for s in ti.static(range(len(b))):
            if ti.static(s > 0):
                for i in range(first, first + total_force.particle_count):
                    stage = state.scratch_0[i]
                    for k in ti.static(range(s)):
                        if ti.static(a[s][k] != 0.0):
                            stage += h * a[s][k] * state.scratch[1 + k][i]
                    state.velocity[i] = stage
            for i in range(first, first + total_force.particle_count):
                slope = total_force.local_acceleration(state, first, i, time, True)
                state.scratch[1 + s][i] = state.acceleration[i] + slope
        for i in range(first, first + total_force.particle_count):
            end = state.scratch_0[i]
            for k in ti.static(range(len(b))):
                if ti.static(b[k] != 0.0):
                    end += h * b[k] * state.scratch[1 + k][i]
            state.velocity[i] = end
