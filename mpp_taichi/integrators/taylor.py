"""Taylor's method for gravity: the motion of a step as a power series of high degree."""

from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.arithmetic.inverse_distance import inverse_root, softened_square
from mpp_taichi.arithmetic.rough_functions import rough_power
from mpp_taichi.component import component, param
from mpp_taichi.integrators._adaptive import Adaptive, rounding
from mpp_taichi.integrators._compensated_sum import compensated_sum
from mpp_taichi.integrators._gravity_series import GravitySeries
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.types import Template

MARGIN = 0.0075  # of the tolerance: bound of the error of a step, so that the tolerance is the error of an orbit, as measured
FINEST = 0.01  # of the rounding: bound of the last terms of a step at round-off
UNITS = 2100  # doublings between the smallest and the largest number
LONGEST = 4.0  # step, relative to the step before: on a straight path no other bound exists
FIRST_SHARE = 0.125  # of the time in which a pair moves or falls by its distance: the first unit of time at round-off


@component
@ti.data_oriented
class Taylor(Adaptive):
    """The power series of all positions to an order p by recurrence, steps h as long as the first missing term is small.

    h = min over all pairs of (0.0075 ε w / ((p + 1) |d_(p+1)| (1 + (0.75 L)²)^½))^(1/p): d_n are the coefficients of a pair's
    separation, d_(p+1) is continued from the last four, w is the relative speed, and L is the leverage, the part by which an
    error of a bound pair grows in an orbit, 1/(1 − e) at the pericentre of an ellipse. So ε is the error of an orbit, within
    a factor of 10: after n orbits the error at the mean distance is ε n (n + 1)/2 of the system's size, since a wrong period
    counts in each orbit. No step is shorter than round-off needs, min over n = p − 1, p of (0.01 · 2⁻⁵² |d_0| / |d_n|)^(1/n).
    Where p is odd, the errors of the energy before and after the pericentre of an encounter cancel, so that an odd order
    below some 15 has a several times smaller error than the even orders beside it. No step is repeated, and between the ends
    of steps the series is as accurate as at the ends. Sums of positions and velocities are compensated, so that the error of
    the energy grows like round-off, with the square root of the number of steps. Coefficients are in a unit of time near the
    step, a power of two, so that they stay in the range of numbers. The fastest method for few bodies under gravity, from
    about seven digits on; the work of a step grows with the pairs and p².
    For `newtonian_gravity` and `uniform_gravity` only.
    Sources: Moore, Interval Analysis (1966); Jorba & Zou, Exp. Math. 14 (2005) 99; for n bodies
    Biscani & Izzo, Mon. Not. R. Astron. Soc. 504 (2021) 2614.
    """

    dt: float = param(None, optional=True, above=0.0, unit="time", help="time between samples; absent: run.duration / 1000")
    tolerance: float = param(
        1e-16, above=0.0, maximum=1e-2, help="ε, the error of an orbit, in parts of the system's size; 1e-16: round-off"
    )
    order: int = param(20, minimum=4, maximum=40, help="order of the series; 13 is a little faster for errors above 1e-4")

    carries_rounding = True
    controlled_by = "tolerance"
    begins_anew = True
    reference_tolerances = (1e-14, 1e-15, 1e-16)  # steps in the ratio 1 : 0.89 : 0.79
    promising_for = ("encounters",)
    made_for = ("gravitates", "is_uniform")
    made_for_reason = "its series are theirs"
    memory = ("clock", "tally", "coefficient", "position_rest", "velocity_rest")

    def in_vectors(self, state: Any, total_force: Any) -> bool:
        """With any number of pairs."""
        return bool(total_force.has_pairs)

    def work_fields(self, total_force: Any, start: Snapshot, *, plan: str, on_cpu: bool) -> dict[str, tuple[str, int]]:
        """The series, the rounding errors of the state, and the clock, whose last entry is the unit of time."""
        self.series = GravitySeries(total_force, start, self.order)
        return {
            "clock": ("wide", self.CLOCK),
            "tally": ("index", self.TALLY),
            "control": ("wide", self.CONTROL),
            "position_rest": ("vector", start.particle_count),
            "velocity_rest": ("vector", start.particle_count),
            **self.series.work_fields(),
        }

    def control(self) -> tuple[float, float]:
        """The bound of the error of a step, 0 where ε is round-off; and the bound of the last terms at round-off."""
        return (MARGIN * self.tolerance if self.tolerance > rounding() else 0.0), FINEST * rounding()

    def iterations_of_step(self, particles: int, per_evaluation: int) -> int:
        """The recurrences of all orders, and the sums of the series that end a step and show the state."""
        return self.series.iterations() + 2 * (particles * (self.order + 2) + UNITS)

    @ti.func
    def begin(self, state: Template, total_force: Template, first, time: Template, dt: Template, shape: Template):
        """Take positions and velocities as the coefficients 0 and 1, in a first unit of time."""
        r = first // total_force.particle_count
        self.start_clock(state, r, time)
        self.series.begin(state, first)
        bound = self._first_time(state, total_force, first)
        if state.control[self.CONTROL * r] == 0.0:
            bound *= FIRST_SHARE
        unit = ti.cast(1.0, state.wide)  # a power of two, so that to change it rounds nothing
        if not (0.0 < bound < ti.math.inf):
            bound = dt
        while unit > bound:
            unit *= 0.5
        while 2.0 * unit <= bound:
            unit *= 2.0
        state.clock[self.CLOCK * r + 2] = unit
        for i in range(first, first + total_force.particle_count):
            row = self._row(first, i)
            state.coefficient[row] = state.position[i]
            state.coefficient[row + total_force.particle_count] = ti.cast(unit, float) * state.velocity[i]
            state.position_rest[i] = ti.Vector.zero(float, state.dimensions)
            state.velocity_rest[i] = ti.Vector.zero(float, state.dimensions)

    @ti.func
    def _row(self, first, i):
        """Index of coefficient 0 of particle i."""
        return first // self.series.count * self.series.rows * self.series.count + i - first

    @ti.func
    def _first_time(self, state: Template, total_force: Template, first):
        """The time in which the fastest pair moves, or falls, by its distance."""
        rate = ti.cast(0.0, state.wide)  # squared
        for i in range(first, first + total_force.particle_count):
            for j in range(i + 1, first + total_force.particle_count):
                d = state.position[j] - state.position[i]
                apart = softened_square(d.norm_sqr(), self.series.softening_squared)
                fall = 0.0
                for force in ti.static(total_force.pair_forces):
                    pull = force.response(state, i) * force.source(state, j) + force.response(state, j) * force.source(state, i)
                    fall = ti.abs(pull) / (apart * ti.sqrt(apart))
                rate = ti.max(rate, ti.cast(fall + (state.velocity[j] - state.velocity[i]).norm_sqr() / apart, state.wide))
        return inverse_root(rate)

    @ti.func
    def take_step(self, state: Template, total_force: Template, first, shape: Template):
        """Extend the series from the state, and set the length of the step. Each order of the acceleration is an evaluation."""
        r = first // total_force.particle_count
        begin, unit = state.clock[self.CLOCK * r], state.clock[self.CLOCK * r + 2]
        error, finest = state.control[self.CONTROL * r], state.control[self.CONTROL * r + 1]
        self.series.extend(state, first, ti.cast(unit, float), ti.cast(begin, float))
        squared = self.series.last_terms(state, first, ti.cast(unit, float), error)
        share = ti.cast(LONGEST, state.wide)
        for n in ti.static(range(2)):
            square = ti.cast(squared[n], state.wide)
            share = ti.min(share, rough_power(finest * finest / square, 0.5 / (self.order - 1 + n)))
        if error > 0.0 and squared[2] > 0.0:
            square = ti.cast(squared[2], state.wide)
            share = ti.min(ti.max(share, rough_power(error * error / square, 0.5 / self.order)), LONGEST)
        h = share * unit
        tally = self.TALLY * r
        state.tally[tally + self.EVALUATIONS] = state.tally[tally + self.EVALUATIONS] + (self.order - 1)
        if begin + 1e-3 * h > begin:
            state.tally[tally + self.STEPS] = state.tally[tally + self.STEPS] + 1
            state.clock[self.CLOCK * r + 1] = h
        else:
            state.tally[tally + self.STALLED] = 1
            state.clock[self.CLOCK * r + 1] = 0.0  # so that the start of the step is shown

    @ti.func
    def enter_next(self, state: Template, total_force: Template, first):
        """Make the end of the last step, in compensated sums, the start of the next, with a unit of time near the last step."""
        r = first // total_force.particle_count
        h, unit = state.clock[self.CLOCK * r + 1], state.clock[self.CLOCK * r + 2]
        share, old = ti.cast(h / unit, float), ti.cast(unit, float)
        while unit > h:
            unit *= 0.5
        while 2.0 * unit <= h:
            unit *= 2.0
        per_old, new = 1.0 / old, ti.cast(unit, float)  # powers of two: exact
        for group in range(self.series.count // self.series.group):
            begin = first + group * self.series.group
            way, push = self._change(state, first, begin, share)
            for m, c in ti.static(ti.ndrange(self.series.group, state.dimensions)):
                i, row = begin + m, self._row(first, begin + m)
                x = ti.static(self.series.component(state, c))[row]
                x, state.position_rest[i][c] = compensated_sum(x, state.position_rest[i][c], way[m][c])
                ti.static(self.series.component(state, c))[row] = x
                v = ti.static(self.series.component(state, c))[row + self.series.count] * per_old
                v, state.velocity_rest[i][c] = compensated_sum(v, state.velocity_rest[i][c], push[m][c] * per_old)
                ti.static(self.series.component(state, c))[row + self.series.count] = v * new
        state.clock[self.CLOCK * r] = state.clock[self.CLOCK * r] + h  # `+=` would be an atomic
        state.clock[self.CLOCK * r + 2] = unit

    @ti.func
    def _change(self, state: Template, first, begin, share):
        """Changes of the positions of a group, and of its velocities times the unit of time; the smallest terms come first."""
        way = [[0.0 for c in ti.static(range(state.dimensions))] for m in ti.static(range(self.series.group))]
        push = [[0.0 for c in ti.static(range(state.dimensions))] for m in ti.static(range(self.series.group))]
        factor = ti.cast(self.order, float)
        row = self._row(first, begin)
        for back in range(self.order - 1):
            now = row + (self.order - back) * self.series.count
            for m, c in ti.static(ti.ndrange(self.series.group, state.dimensions)):
                x = ti.static(self.series.component(state, c))[now + m]
                way[m][c] = (way[m][c] + x) * share
                push[m][c] = (push[m][c] + factor * x) * share
            factor -= 1.0
        for m, c in ti.static(ti.ndrange(self.series.group, state.dimensions)):
            way[m][c] = (way[m][c] + ti.static(self.series.component(state, c))[row + self.series.count + m]) * share
        return way, push

    @ti.func
    def show(self, state: Template, total_force: Template, first, time: Template):
        """Set the state to the value of the step's series at a time within the step."""
        r = first // total_force.particle_count
        per_unit = ti.cast(1.0 / state.clock[self.CLOCK * r + 2], float)
        h = ti.cast(state.clock[self.CLOCK * r + 1], float)
        share = self.share_of_step(state, r, time) * h * per_unit
        for group in range(self.series.count // self.series.group):
            begin = first + group * self.series.group
            way, push = self._change(state, first, begin, share)
            for m, c in ti.static(ti.ndrange(self.series.group, state.dimensions)):
                i, row = begin + m, self._row(first, begin + m)
                state.position[i][c] = ti.static(self.series.component(state, c))[row] + (way[m][c] - state.position_rest[i][c])
                speed = ti.static(self.series.component(state, c))[row + self.series.count] + push[m][c]
                state.velocity[i][c] = speed * per_unit - state.velocity_rest[i][c]

    @property
    def path_degree(self) -> int:
        """The order of the series."""
        return self.order

    @ti.func
    def write_paths(self, state: Template, total_force: Template, coefficient: Template):
        """Write the step's series, in parts of the step."""
        n = ti.static(total_force.particle_count)
        share = ti.cast(state.clock[1] / state.clock[2], float)
        for i in range(n):
            power = ti.cast(1.0, float)
            for m in range(self.order + 1):
                for c in ti.static(range(state.dimensions)):
                    coefficient[m * n + i][c] = ti.static(self.series.component(state, c))[m * self.series.count + i] * power
                power *= share
            coefficient[i] = coefficient[i] - state.position_rest[i]

    @ti.func
    def length_again(self, state: Template, r):
        """0: the series determines the length of a step."""
        return ti.cast(0.0, state.wide)

    def accelerations(self, state: Any) -> np.ndarray:
        """Twice the coefficients of order 2, over the unit of time squared."""
        rows = state.coefficient.to_numpy().reshape(state.replica_count, self.series.rows, self.series.count, -1)
        units = state.clock.to_numpy().reshape(-1, self.CLOCK)[:, 2]
        return np.concatenate(2.0 * rows[:, 2] / units[:, None, None] ** 2)
