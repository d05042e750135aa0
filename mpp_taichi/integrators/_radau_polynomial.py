"""Radau polynomial: the equations of a step of ias15, for the motion and for a deviation from it."""

from math import comb
from typing import Any

import taichi as ti

from mpp_taichi.integrators._compensated_sum import compensated_sum
from mpp_taichi.integrators._radau import differences_of_powers, powers_of_differences, radau_nodes
from mpp_taichi.types import Template

NODES = radau_nodes(7)
POWERS = powers_of_differences(NODES)
DIFFERENCES = differences_of_powers(NODES)
TERMS = 7
ITERATIONS = 12  # of a step's equations at most; round-off ends them before


@ti.data_oriented
class RadauPolynomial:
    """The accelerations in a step of the length h as polynomials through 8 Gauss–Radau nodes, one for each particle.

        a(s) = a₀ + Σ b_k s^(k+1),  x(s) = x₀ + s h v₀ + (s h)² (a₀/2 + Σ b_k s^(k+1) / ((k+2)(k+3))),  s = 0 … 1

    Fields of the state, whose names begin with `prefix`: the start x₀, v₀ with the rounding errors of its sums, a₀, the
    coefficients b, their predictions e, and the divided differences g. `place` writes into position and velocity.
    """

    def __init__(self, prefix: str = "") -> None:
        """Name the fields."""
        self.prefix = prefix
        places = ("start_position", "start_velocity", "start_acceleration", "position_rest", "velocity_rest")
        self.memory = tuple(
            prefix + name for name in (*places, *(f"b{k}" for k in range(TERMS)), *(f"e{k}" for k in range(TERMS)))
        )

    def work_fields(self, particle_count: int) -> dict[str, tuple[str, int]]:
        """The fields, as work fields of the state."""
        names = (*self.memory, *(f"{self.prefix}g{k}" for k in range(TERMS)))
        return {name: ("vector", particle_count) for name in names}

    def field(self, state: Any, name: str) -> Any:
        """A field of this polynomial."""
        return getattr(state, self.prefix + name)

    def term(self, state: Any, letter: str, k: int) -> Any:
        """The field of coefficient k."""
        return getattr(state, f"{self.prefix}{letter}{k}")

    @ti.func
    def begin(self, state: Template, total_force: Template, first):
        """Take positions and velocities as the start of the first step, whose polynomial is not known at all."""
        zero = ti.Vector.zero(float, state.dimensions)
        for i in range(first, first + total_force.particle_count):
            ti.static(self.field(state, "start_position"))[i] = ti.static(self.field(state, "position"))[i]
            ti.static(self.field(state, "start_velocity"))[i] = ti.static(self.field(state, "velocity"))[i]
            ti.static(self.field(state, "position_rest"))[i] = zero
            ti.static(self.field(state, "velocity_rest"))[i] = zero
            for k in ti.static(range(TERMS)):
                ti.static(self.term(state, "b", k))[i] = zero
                ti.static(self.term(state, "e", k))[i] = zero

    def iterations(self, particles: int, per_evaluation: int) -> int:
        """Loop iterations of `solve`, and of the judgement of a step, an upper bound."""
        return 1 + ITERATIONS * (1 + TERMS * (1 + per_evaluation + 2 * particles)) + 3 * particles

    @ti.func
    def solve(self, state: Template, total_force: Template, law: Template, first, begin, h, shape: Template):
        """Iterate until the change of the last coefficient, relative to the largest acceleration, is zero or stops falling.

        Returns its last change. `law` places the particles at a node, evaluates the forces there, and has found the
        acceleration of a particle.
        """
        self._take_differences(state, total_force, first)
        r = first // total_force.particle_count
        before = ti.cast(2.0, state.wide)
        going = 1
        count = 0
        while going == 1:
            count += 1
            for n in range(TERMS):
                node = 0.0
                for c in ti.static(range(TERMS)):
                    if n == c:
                        node = NODES[c]
                law.place(state, total_force, first, node, h)
                now = begin + ti.cast(node * h, state.wide)
                law.evaluate(state, total_force, first, now, shape)
                state.measure[2 * r] = 0.0
                state.measure[2 * r + 1] = 0.0
                for i in range(first, first + total_force.particle_count):
                    a = law.found(state, total_force, first, i, now)
                    change = self._correct(state, i, a, n)
                    if n == TERMS - 1:
                        self._raise(state, 2 * r, change)
                        self._raise(state, 2 * r + 1, a.norm())
            error = state.measure[2 * r]
            if error > 0.0:
                error /= state.measure[2 * r + 1]
            if error < 1e-16 or (count > 2 and not error < before) or count == ITERATIONS:
                going = 0
            before = error
        return before

    @ti.func
    def _take_differences(self, state: Template, total_force: Template, first):
        """Compute g from b: g_j = Σ_k≥j d_kj b_k."""
        for i in range(first, first + total_force.particle_count):
            for j in ti.static(range(TERMS)):
                g = ti.Vector.zero(float, state.dimensions)
                for k in ti.static(range(j, TERMS)):
                    g += DIFFERENCES[k][j] * ti.static(self.term(state, "b", k))[i]
                ti.static(self.term(state, "g", j))[i] = g

    @ti.func
    def _raise(self, state: Template, place, value):
        """Raise a maximum of the field `measure`; NaN becomes infinity."""
        wide = ti.cast(value, state.wide)
        if wide > state.measure[place] or ti.math.isnan(wide):
            state.measure[place] = ti.select(ti.math.isnan(wide), ti.cast(ti.math.inf, state.wide), wide)

    @ti.func
    def _correct(self, state: Template, i, a, n):
        """Make the polynomial pass through the acceleration a at node n; returns the change of its last coefficient."""
        result = 0.0
        quotient = a - ti.static(self.field(state, "start_acceleration"))[i]
        for m in ti.static(range(TERMS)):
            if n == m:
                quotient *= ti.static(1.0 / NODES[m])
                for j in ti.static(range(m)):
                    quotient = (quotient - ti.static(self.term(state, "g", j))[i]) * ti.static(1.0 / (NODES[m] - NODES[j]))
                change = quotient - ti.static(self.term(state, "g", m))[i]
                ti.static(self.term(state, "g", m))[i] = quotient
                for k in ti.static(range(m + 1)):
                    b = ti.static(self.term(state, "b", k))[i]
                    ti.static(self.term(state, "b", k))[i] = b + POWERS[m][k] * change
                if ti.static(m == TERMS - 1):
                    result = change.norm()
        return result

    @ti.func
    def place(self, state: Template, total_force: Template, first, s, h, with_velocity: Template):
        """Set the particles to the value of the polynomial at s; the smallest terms are added first."""
        way = s * h
        for i in range(first, first + total_force.particle_count):
            x = ti.Vector.zero(float, state.dimensions)
            v = ti.Vector.zero(float, state.dimensions)
            for back in ti.static(range(TERMS)):
                k = ti.static(TERMS - 1 - back)
                b = ti.static(self.term(state, "b", k))[i]
                x = (x + ti.static(1.0 / ((k + 2) * (k + 3))) * b) * s
                if ti.static(with_velocity):
                    v = (v + ti.static(1.0 / (k + 2)) * b) * s
            a = ti.static(self.field(state, "start_acceleration"))[i]
            velocity = ti.static(self.field(state, "start_velocity"))[i]
            x = (x + 0.5 * a) * way
            rest = ti.static(self.field(state, "position_rest"))[i]
            start = ti.static(self.field(state, "start_position"))[i]
            ti.static(self.field(state, "position"))[i] = start + ((x + velocity) * way - rest)
            if ti.static(with_velocity):
                slip = ti.static(self.field(state, "velocity_rest"))[i]
                ti.static(self.field(state, "velocity"))[i] = velocity + ((v + a) * way - slip)

    @ti.func
    def rescale(self, state: Template, total_force: Template, first, share):
        """Rescale the polynomial to a shorter step from the same start; coefficients that are NaN become 0."""
        for i in range(first, first + total_force.particle_count):
            power = share
            for k in ti.static(range(TERMS)):
                b = ti.static(self.term(state, "b", k))[i] * power
                b = ti.select(ti.math.isnan(b.norm()), ti.Vector.zero(float, state.dimensions), b)
                ti.static(self.term(state, "b", k))[i] = b
                ti.static(self.term(state, "e", k))[i] = b
                power *= share

    @ti.func
    def enter_next(self, state: Template, total_force: Template, first, h, share):
        """Make the end of the step the start of the next step, longer by the factor `share`, and predict its polynomial.

        The prediction continues the last polynomial, and adds the error that the last prediction had.
        """
        for i in range(first, first + total_force.particle_count):
            self._add_compensated(state, i, h)
            power = share
            for k in ti.static(range(TERMS)):
                # Taylor's coefficients at s = 1: Σ_m≥k C(m + 1, k + 1) b_m, over the new step.
                going_on = ti.Vector.zero(float, state.dimensions)
                for back in ti.static(range(TERMS - k)):
                    m = ti.static(TERMS - 1 - back)
                    going_on += ti.static(float(comb(m + 1, k + 1))) * ti.static(self.term(state, "b", m))[i]
                missed = ti.static(self.term(state, "b", k))[i] - ti.static(self.term(state, "e", k))[i]
                ti.static(self.term(state, "e", k))[i] = power * going_on
                ti.static(self.term(state, "b", k))[i] = power * going_on + missed
                power *= share

    @ti.func
    def _add_compensated(self, state: Template, i, h):
        """Add the changes of x and v in a step of length h to the start of the step."""
        x = ti.Vector.zero(float, state.dimensions)
        v = ti.Vector.zero(float, state.dimensions)
        for back in ti.static(range(TERMS)):
            k = ti.static(TERMS - 1 - back)
            b = ti.static(self.term(state, "b", k))[i]
            x += ti.static(1.0 / ((k + 2) * (k + 3))) * b
            v += ti.static(1.0 / (k + 2)) * b
        a, velocity = ti.static(self.field(state, "start_acceleration"))[i], ti.static(self.field(state, "start_velocity"))[i]
        start, rest = ti.static(self.field(state, "start_position"))[i], ti.static(self.field(state, "position_rest"))[i]
        slip = ti.static(self.field(state, "velocity_rest"))[i]
        start, rest = compensated_sum(start, rest, h * (velocity + h * (0.5 * a + x)))
        velocity, slip = compensated_sum(velocity, slip, h * (a + v))
        ti.static(self.field(state, "start_position"))[i], ti.static(self.field(state, "position_rest"))[i] = start, rest
        ti.static(self.field(state, "start_velocity"))[i], ti.static(self.field(state, "velocity_rest"))[i] = velocity, slip
