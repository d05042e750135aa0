"""Explicit Runge–Kutta methods: a tableau, and one step for all of them."""

import math
from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.arithmetic.force_numbers import zero_vector
from mpp_taichi.arithmetic.particle_update import drift_particle, kick_particle, push_particle
from mpp_taichi.device.fast_taichi.vector_fields import put_vector, vector_at
from mpp_taichi.integrators._base import Integrator
from mpp_taichi.integrators._launchers import Launchers
from mpp_taichi.types import Template

# (a, b, c) of the methods that solve v' = a(v) inside a kick, by order (see _splitting).
EULER = (((),), (1.0,))
MIDPOINT = (((), (0.5,)), (0.0, 1.0))
HEUN3 = (((), (1 / 3,), (0.0, 2 / 3)), (0.25, 0.0, 0.75))
CLASSICAL = (((), (0.5,), (0.0, 0.5), (0.0, 0.0, 1.0)), (1 / 6, 1 / 3, 1 / 3, 1 / 6))


def taylor(order: int) -> tuple[tuple, tuple]:
    """(a, b) of a method whose step is the Taylor polynomial of exp(h f) for linear f; of second order for other f.

    Each slope is taken at v + h/(p − k) × the slope before, k = 0, …, p − 2, and only the last slope makes the step.
    """
    rows = [(0.0,) * k + (1.0 / (order - k),) for k in range(order - 1)]
    return ((), *rows), (0.0,) * (order - 1) + (1.0,)


def nystroem_rows(a: tuple, b: tuple) -> list[tuple[float, list[float], list[float]]]:
    """Rows (c, weights, weights̄) of every stage, and last of the end of the step, in Nyström's form.

    For x' = v, v' = f the stages store only the slopes f: with the full tableau A and c = A·1, stage s is at
    v₀ + h Σ A_sk f_k and x₀ + c_s h v₀ + h² Σ (A·A)_sk f_k; the end of the step has b and b·A in place of the rows of A and
    A·A. Algebraically the method is the same.
    """
    stages = len(b)
    full = [list(row) + [0.0] * (stages - len(row)) for row in a]
    ends = [*full, list(b)]
    bars = [[math.fsum(row[j] * full[j][k] for j in range(stages)) for k in range(stages)] for row in ends]
    return [(math.fsum(row), row, bar) for row, bar in zip(ends, bars, strict=True)]


class RungeKutta(Integrator):
    """Explicit Runge–Kutta step for x' = v, v' = f(x, v, t), given by the tableau rows `a` and weights `b`.

    Velocity-dependent forces keep the order. The method is not symplectic: energy drifts. Scratch fields hold the start
    positions, the start velocities and one slope per stage.

    A method may declare what the control of the step and the output between two steps need. Steps of fixed length need none
    of it:

    error_weights   rows e whose h Σ e_k k_k estimate the error of a step, k_k the slopes of the stages, then the slope at the
                    end of the step, which is the first slope of the next step
    dense_stages    rows a of further slopes, over all slopes before them, for the dense output
    dense_weights   one row (p₁, p₂, …) for each of these slopes: x(t + θh) = x + h Σ_k (p₁ θ + p₂ θ² + …)_k k_k
    dense_order     order of this polynomial: its error is of the order h^(dense_order + 1)

    The slopes k are the slopes of (x, v). Sums over slopes are written with the stored slopes f as in `nystroem_rows`: the part
    of x is h Σ e_k v₀ + h² Σ (e·A)_k f_k.
    """

    a: tuple = ()
    b: tuple = ()
    error_weights: tuple = ()
    dense_stages: tuple = ()
    dense_weights: tuple = ()
    dense_order = 0
    can_use_tree = True
    takes_low_parts = True
    takes_any_numbers = True
    sums_slices = True
    launchers = Launchers(vectors=True)
    typical_evaluations = 2

    @property
    def nodes(self) -> tuple:
        """Times of the slopes, as parts of dt."""
        return tuple(node for node, _weights, _bars in nystroem_rows(self.a, self.b)[:-1])

    def scratch_count(self, velocity_dependent: bool) -> int:
        """Start positions, start velocities, slopes."""
        return 2 + len(self.b)

    def low_scratch_count(self) -> int:
        """Low parts of the start positions and start velocities."""
        return 2

    def slopes(self, velocity_dependent: bool) -> range:
        """The fields after the start."""
        return range(2, 2 + len(self.b))

    def step_numbers(self, dt: float) -> list[float]:
        """c h of every stage and of the end, and for each slope a_k h and (A·A)_k h²."""
        return [
            number
            for node, weights, bars in nystroem_rows(self.a, self.b)
            for number in (node * dt, *(weight * dt for weight in weights), *(bar * dt * dt for bar in bars))
        ]

    def amplification(self, frequency: float, damping: float = 0.0) -> np.ndarray:
        """The method's stability function, applied to the oscillator's matrix."""
        oscillator = np.array([[0.0, 1.0], [-(frequency**2), -damping]])
        slopes: list[np.ndarray] = []
        for row in (*self.a, self.b):
            stage = np.eye(2) + sum(weight * slope for weight, slope in zip(row, slopes))
            slopes.append(oscillator @ stage)
        return stage

    def loops(self, k: int, total_force: Any) -> int:
        """One loop keeps the start; every other stage has a loop for the slope, one for the move, and one for damped slices."""
        return 1 if k == 0 else 2 + total_force.slice_loops(True)

    @ti.func
    def stage(self, state: Template, total_force: Template, first, time: Template, dt: Template, k: Template):
        """Stage 0 keeps the start; stage k takes slope k − 1 and moves the state to the place of the next slope."""
        rows, slopes = ti.static(nystroem_rows(self.a, self.b), len(self.b))
        if ti.static(k == 0):
            for i in range(first, first + total_force.particle_count):
                put_vector(state.scratch_0, i, state.position[i])
                put_vector(state.scratch_1, i, state.velocity[i])
                if ti.static(state.carries_low):
                    state.scratch[slopes + 2][i] = state.position_low[i]
                    state.scratch[slopes + 3][i] = state.velocity_low[i]
                if ti.static(state.carries_rest):
                    state.scratch[slopes + 4][i] = state.position_rest[i]
                    state.scratch[slopes + 5][i] = state.velocity_rest[i]
        else:
            total_force.sum_slices(state, state.velocity, True)
            for i in range(first, first + total_force.particle_count):
                slope = self.slope(state, total_force, first, i, time + rows[k - 1][0] * dt)
                put_vector(state.scratch[1 + k], i, slope)
            self.move(state, total_force, first, dt, k, rows[k])

    @ti.func
    def slope(self, state: Template, total_force: Template, first, i, time):
        """Acceleration of particle i by all forces.

        The forces that do not depend on velocity, and springs in slices, have been summed already.
        """
        result = zero_vector(state)
        if ti.static(total_force.has_velocity_independent):
            result = result + vector_at(state.acceleration, i)
        if ti.static(total_force.depends_on_velocity):
            result = result + total_force.local_acceleration(state, first, i, time, True, True)
        return result

    @ti.func
    def stage_after_force(self, state: Template, total_force: Template, first, time: Template, dt: Template, k):
        """A stage that is looked up while the kernel runs: the friction is compiled once, and only the sums for each stage."""
        rows = ti.static(nystroem_rows(self.a, self.b))
        node = 0.0
        for c in ti.static(range(1, len(self.b) + 1)):
            if k == c:
                node = rows[c - 1][0]
        total_force.sum_slices(state, state.velocity, True)
        for i in range(first, first + total_force.particle_count):
            slope = self.slope(state, total_force, first, i, time + dt * node)
            for c in ti.static(range(1, len(self.b) + 1)):
                if k == c:
                    put_vector(state.scratch[1 + c], i, slope)
        for c in ti.static(range(1, len(self.b) + 1)):
            if k == c:
                self.move(state, total_force, first, dt, c, rows[c])

    @ti.func
    def move(self, state: Template, total_force: Template, first, dt: Template, s: Template, row: Template):
        """Set the state to stage s, or to the end of the step, as its row says."""
        if ti.static(state.carries_low):
            self.move_both_parts(state, total_force, first, s, row)
        else:
            self.move_rounded(state, total_force, first, dt, row)

    @ti.func
    def move_both_parts(self, state: Template, total_force: Template, first, s: Template, row: Template):
        """`move` with low parts: x = x₀ + c h v₀ + Σ (h² (A·A)_k) f_k, each term added by itself; likewise v."""
        _node, weights, bars = ti.static(row)
        slopes = ti.static(len(self.b))
        entry = ti.static(s * (1 + 2 * slopes))
        for i in range(first, first + total_force.particle_count):
            state.position[i], state.position_low[i] = state.scratch_0[i], state.scratch[slopes + 2][i]
            state.velocity[i], state.velocity_low[i] = state.scratch_1[i], state.scratch[slopes + 3][i]
            if ti.static(state.carries_rest):
                state.position_rest[i], state.velocity_rest[i] = state.scratch[slopes + 4][i], state.scratch[slopes + 5][i]
            drift_particle(state, i, 0.0, entry)
            for k in ti.static(range(len(self.b))):
                if ti.static(bars[k] != 0.0):
                    push_particle(state, i, 0.0, entry + 1 + slopes + k, state.scratch[2 + k][i])
                if ti.static(weights[k] != 0.0):
                    kick_particle(state, i, 0.0, entry + 1 + k, state.scratch[2 + k][i])

    @ti.func
    def move_rounded(self, state: Template, total_force: Template, first, dt: Template, row: Template):
        """`move` without low parts."""
        node, weights, bars = ti.static(row)
        for i in range(first, first + total_force.particle_count):
            velocity_change = zero_vector(state)
            position_change = node * vector_at(state.scratch_1, i)
            for k in ti.static(range(len(self.b))):
                if ti.static(weights[k] != 0.0):
                    velocity_change = velocity_change + weights[k] * vector_at(state.scratch[2 + k], i)
                if ti.static(bars[k] != 0.0):
                    position_change = position_change + dt * bars[k] * vector_at(state.scratch[2 + k], i)
            put_vector(state.position, i, vector_at(state.scratch_0, i) + dt * position_change)
            put_vector(state.velocity, i, vector_at(state.scratch_1, i) + dt * velocity_change)
