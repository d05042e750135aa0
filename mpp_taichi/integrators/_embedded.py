"""Embedded Runge–Kutta pairs with a step of their own choice, and looks by their own polynomial."""

from dataclasses import replace
from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.integrators._adaptive import Adaptive
from mpp_taichi.integrators._compensated_sum import compensated_sum
from mpp_taichi.integrators._runge_kutta import RungeKutta
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.types import Template

SAFETY = 0.9
PROPORTIONAL, INTEGRAL = 0.2, 0.85  # exponents of the last error and of this one, in parts of 1/k where the error goes as h^k
SHORTEST, LONGEST = 0.2, 5.0  # of a step, over the one before
FIRST_SHARE = 0.1  # of the time in which the speed changes by as much as it is, for a first step at a tolerance of 1
LEAST_ERROR = 1e-4  # that is believed, in parts of what is tolerated


def wide_rows(pair: type[RungeKutta]) -> np.ndarray:
    """Square tableau of all slopes: those of the stages, of the end of the step, and of the dense output."""
    rows = [*pair.a, pair.b, *pair.dense_stages]
    return np.array([[*row, *[0.0] * (len(rows) - len(row))] for row in rows])


class Embedded(Adaptive):
    """A pair's step h, controlled by its estimate of the error; see RungeKutta for what a pair declares.

    What is estimated is e, the largest |Δx| / X and |Δv| / V of a particle, X and V the largest distance and velocity from the
    first particle, or the change in the step where that is more: no matter where the system is and how it moves as a whole.
    A step is taken where e ≤ tolerance; the next one is h 0.9 (tolerance/e)^(0.85/k) (e_before/tolerance)^(0.2/k), the same
    for all particles, and a refused one shrinks by 0.9 (tolerance/e)^(1/k). The first slope is the last of the step before,
    sums over steps are compensated. Looks between two steps are the pair's own polynomial; where that wants more forces, they
    are evaluated for steps that are looked at.
    Source: Hairer, Nørsett & Wanner, Solving Ordinary Differential Equations I, 2nd ed. (1993), §II.4; the controller:
    Gustafsson, ACM Trans. Math. Softw. 17 (1991) 533.
    """

    pair: type[RungeKutta]
    error_order = 0  # k
    tolerance: float
    controlled_by = "tolerance"
    launch = replace(Adaptive.launchers, quickly=True)
    VECTORS = ("start_position", "start_velocity", "start_acceleration", "position_rest", "velocity_rest")
    memory = ("clock", "tally", "judged", "slope", *VECTORS)

    def work_fields(self, total_force: Any, start: Snapshot, *, plan: str, on_cpu: bool) -> dict[str, tuple[str, int]]:
        """The true state at the start of the step, all slopes, and of each replica the clock and what was judged.

        That is the error of the last step, in tolerances, and whether its looks have their slopes. Weights are looked up:
        written into the kernel they would take half a minute to compile.
        """
        n, count = start.particle_count, self._count
        return {
            "clock": ("wide", self.CLOCK),
            "tally": ("index", self.TALLY),
            "control": ("wide", self.CONTROL),
            "judged": ("wide", 2),
            "weight": ("scalar", 2 * count * len(self._table())),
            "node": ("scalar", count),
            "slope": ("vector", count * n),
            **{name: ("vector", n) for name in self.VECTORS},
        }

    def arrange(self, state: Any) -> None:
        """Write the weights into their fields, once for each replica."""
        rows = np.array(self._table())
        state.weight.from_numpy(np.tile(rows.ravel(), state.replica_count).astype(rows.dtype))
        state.node.from_numpy(np.tile(wide_rows(self.pair).sum(axis=1), state.replica_count))

    @property
    def _count(self) -> int:
        """Of the slopes."""
        return len(wide_rows(self.pair))

    @property
    def _evaluated(self) -> int:
        """Slopes of a step, that of its end the last; those beyond are of looks."""
        return len(self.pair.b) + 1

    def _table(self) -> list[list[list[float]]]:
        """Weights of all slopes in x, times h², and in v, times h: where each slope is taken, and of each estimate.

        Then those of θ, θ², …; and a row for what these make of a look.
        """
        full = wide_rows(self.pair)
        errors = [np.array([*row, *[0.0] * (len(full) - len(row))]) for row in self.pair.error_weights]
        dense = np.array([list(row) for row in self.pair.dense_weights]).T
        rows = [*full, *errors, *dense, np.zeros(len(full))]
        return [[(row @ full).tolist(), row.tolist()] for row in rows]

    def control(self) -> tuple[float, float]:
        """The tolerance as given, but not what round-off alone exceeds; and the share that the first step is."""
        rounding = 2.0**-24 if ti.lang.impl.current_cfg().default_fp == ti.f32 else 2.0**-53
        tolerance = max(self.tolerance, 16.0 * rounding)
        return tolerance, FIRST_SHARE * tolerance ** (1.0 / self.error_order)

    # A run ---------------------------------------------------------------------------------------------------------------

    @ti.func
    def begin(self, state: Template, total_force: Template, first, time: Template, dt: Template, shape: Template):
        """The first step is a small part of the time in which the acceleration would change the speed."""
        r = first // total_force.particle_count
        self.start_clock(state, r, time)
        self.evaluate(state, total_force, first, time, shape)
        fastest, most, widest = ti.cast(0.0, state.wide), ti.cast(0.0, state.wide), ti.cast(0.0, state.wide)
        zero = ti.Vector.zero(float, state.dimensions)
        for i in range(first, first + total_force.particle_count):
            found = self.found(state, total_force, first, i, time)
            fastest = ti.max(fastest, ti.cast((state.velocity[i] - state.velocity[first]).norm(), state.wide))
            most = ti.max(most, ti.cast(found.norm(), state.wide))
            widest = ti.max(widest, ti.cast((state.position[i] - state.position[first]).norm(), state.wide))
            state.start_position[i], state.start_velocity[i] = state.position[i], state.velocity[i]
            state.position_rest[i], state.velocity_rest[i] = zero, zero
            state.start_acceleration[i] = found
            self._keep(state, total_force, first, i, 0, found)
        following = self.time_of_change(state, fastest, most, widest, dt)
        state.clock[self.CLOCK * r + 2] = state.control[self.CONTROL * r + 1] * following
        state.judged[2 * r] = 1.0
        state.judged[2 * r + 1] = 0.0

    @ti.func
    def show(self, state: Template, total_force: Template, first, time: Template):
        """The step's polynomial at a time within it."""
        r = first // total_force.particle_count
        s, h = self.share_of_step(state, r, time), ti.cast(state.clock[self.CLOCK * r + 1], float)
        self._complete(state, total_force, first, h)
        powers, last = ti.static(self._count + len(self.pair.error_weights), len(self._table()) - 1)
        for k in range(2 * self._count):
            weight = ti.cast(0.0, float)
            for back in range(last - powers):
                weight = (weight + state.weight[self._place(first, total_force, last - 1 - back) + k]) * s
            state.weight[self._place(first, total_force, last) + k] = weight
        for i in range(first, first + total_force.particle_count):
            x, v = self._sums(state, total_force, first, i, last)
            velocity = state.start_velocity[i]
            state.position[i] = state.start_position[i] + (h * (s * velocity + h * x) - state.position_rest[i])
            state.velocity[i] = velocity + (h * v - state.velocity_rest[i])

    @ti.func
    def _complete(self, state: Template, total_force: Template, first, h):
        """Slopes that only looks want, where this step has not got them yet."""
        r = first // total_force.particle_count
        if ti.static(self._count > self._evaluated):
            if state.judged[2 * r + 1] == 0.0 and h > 0.0:
                start, stop = ti.static(self._evaluated, self._count)
                self._take_slopes(state, total_force, first, start, stop, h, "serial")
                state.judged[2 * r + 1] = 1.0

    @property
    def path_degree(self) -> int:
        """That of the polynomial of looks."""
        return max(len(row) for row in self.pair.dense_weights)

    @ti.func
    def write_paths(self, state: Template, total_force: Template, coefficient: Template):
        """The polynomial of looks: x₀, h v₀ and h² Σ_k w_mk f_k."""
        n, powers = ti.static(total_force.particle_count, self._count + len(self.pair.error_weights))
        h = ti.cast(state.clock[1], float)
        self._complete(state, total_force, 0, h)
        for i in range(n):
            coefficient[i] = state.start_position[i] - state.position_rest[i]
            coefficient[n + i] = h * state.start_velocity[i]
            for m in range(2, self.path_degree + 1):
                x, _ = self._sums(state, total_force, 0, i, powers + m - 1)
                coefficient[m * n + i] = h * h * x

    # A step --------------------------------------------------------------------------------------------------------------

    @ti.func
    def take_step(self, state: Template, total_force: Template, first, shape: Template):
        """From the start state with its slope: try, judge, and leave the length of this step and the next."""
        r = first // total_force.particle_count
        h = state.clock[self.CLOCK * r + 2]
        grows = ti.cast(LONGEST, state.wide)
        trying = 1
        while trying == 1:
            self._take_slopes(state, total_force, first, 1, ti.static(self._evaluated), ti.cast(h, float), shape)
            error = self._error(state, total_force, first, ti.cast(h, float))
            if state.clock[self.CLOCK * r] + 1e-3 * h == state.clock[self.CLOCK * r]:
                state.tally[self.TALLY * r + self.STALLED] = 1
                state.clock[self.CLOCK * r + 1] = 0.0  # so that the start of the step is what is shown
                trying = 0
            elif error <= 1.0:
                seen = ti.max(error, ti.cast(LEAST_ERROR, state.wide))
                change = SAFETY * seen ** (-INTEGRAL / self.error_order)
                change *= state.judged[2 * r] ** (PROPORTIONAL / self.error_order)
                state.judged[2 * r], state.judged[2 * r + 1] = seen, 0.0
                state.tally[self.TALLY * r + self.STEPS] += 1
                state.clock[self.CLOCK * r + 1] = h
                state.clock[self.CLOCK * r + 2] = h * ti.min(grows, ti.max(ti.cast(SHORTEST, state.wide), change))
                trying = 0
            else:
                # What is no number fails both ways, and shrinks the most.
                state.tally[self.TALLY * r + self.REFUSED] += 1
                change = ti.cast(SHORTEST, state.wide)
                if error < 1e30:
                    change = ti.max(change, SAFETY * error ** (-1.0 / self.error_order))
                h *= change
                grows = 1.0

    @ti.func
    def _take_slopes(self, state: Template, total_force: Template, first, start, stop, h, shape: Template):
        """Slopes number start … stop − 1 of the step of length h; the force is compiled once, its places for each."""
        r = first // total_force.particle_count
        for k in range(start, stop):
            node = state.node[self._count * r + k]
            for i in range(first, first + total_force.particle_count):
                x, v = self._sums(state, total_force, first, i, k)
                velocity = state.start_velocity[i]
                change = h * (node * velocity + h * x) - state.position_rest[i]
                state.position[i] = state.start_position[i] + change
                state.velocity[i] = velocity + (h * v - state.velocity_rest[i])
            now = state.clock[self.CLOCK * r] + ti.cast(node * h, state.wide)
            self.evaluate(state, total_force, first, now, shape)
            for i in range(first, first + total_force.particle_count):
                self._keep(state, total_force, first, i, k, self.found(state, total_force, first, i, now))

    @ti.func
    def _keep(self, state: Template, total_force: Template, first, i, k, slope):
        """Slope k of a particle."""
        state.slope[first * self._count + k * total_force.particle_count + i - first] = slope

    @ti.func
    def _place(self, first, total_force: Template, row):
        """Where the weights of a row begin."""
        r = first // total_force.particle_count
        return 2 * ti.static(self._count) * (ti.static(len(self._table())) * r + row)

    @ti.func
    def _sums(self, state: Template, total_force: Template, first, i, row):
        """Weighted sums over the slopes of a particle, for x and for v."""
        x, v = ti.Vector.zero(float, state.dimensions), ti.Vector.zero(float, state.dimensions)
        place = self._place(first, total_force, row)
        for k in range(self._count):
            slope = state.slope[first * self._count + k * total_force.particle_count + i - first]
            x += state.weight[place + k] * slope
            v += state.weight[place + self._count + k] * slope
        return x, v

    @ti.func
    def _error(self, state: Template, total_force: Template, first, h):
        """The estimate over the tolerance, the state at the end of the step; of two it is E₅² / √(E₅² + 0.01 E₃²)."""
        r = first // total_force.particle_count
        widest, fastest = ti.cast(0.0, float), ti.cast(0.0, float)
        for i in range(first, first + total_force.particle_count):
            widest = ti.max(widest, (state.start_position[i] - state.start_position[first]).norm())
            widest = ti.max(widest, (state.position[i] - state.start_position[i]).norm())
            fastest = ti.max(fastest, (state.start_velocity[i] - state.start_velocity[first]).norm())
            fastest = ti.max(fastest, (state.velocity[i] - state.start_velocity[i]).norm())
        count = ti.static(len(self.pair.error_weights))
        errors = ti.Vector.zero(float, count)
        for i in range(first, first + total_force.particle_count):
            for c in ti.static(range(count)):
                x, v = self._sums(state, total_force, first, i, self._count + c)
                off, slip = h * h * x.norm(), h * v.norm()
                off = off / widest if off > 0.0 or ti.math.isnan(off) else off
                slip = slip / fastest if slip > 0.0 or ti.math.isnan(slip) else slip
                # A comparison with what is no number is false, and it would be lost.
                if not (off <= errors[c]):
                    errors[c] = off
                if not (slip <= errors[c]):
                    errors[c] = slip
        result = errors[0]
        if ti.static(count == 2):
            result *= errors[0] / ti.sqrt(errors[0] ** 2 + 0.01 * errors[1] ** 2) if errors[0] > 0.0 else 1.0
        return ti.cast(result, state.wide) / state.control[self.CONTROL * r]

    @ti.func
    def enter_next(self, state: Template, total_force: Template, first):
        """The end of this step is the start of the next; sums are compensated."""
        r = first // total_force.particle_count
        h = ti.cast(state.clock[self.CLOCK * r + 1], float)
        last = ti.static(self._evaluated - 1)
        for i in range(first, first + total_force.particle_count):
            x, v = self._sums(state, total_force, first, i, last)
            way = h * (state.start_velocity[i] + h * x)
            state.start_position[i], state.position_rest[i] = compensated_sum(
                state.start_position[i], state.position_rest[i], way
            )
            state.start_velocity[i], state.velocity_rest[i] = compensated_sum(
                state.start_velocity[i], state.velocity_rest[i], h * v
            )
            slope = state.slope[first * self._count + last * total_force.particle_count + i - first]
            state.start_acceleration[i] = slope
            self._keep(state, total_force, first, i, 0, slope)
        state.clock[self.CLOCK * r] += state.clock[self.CLOCK * r + 1]
