"""Newton's method for the equations of an implicit step, in one thread or all particles at once."""

from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.device import bulk_copy
from mpp_taichi.solvers._sums import dot, read_total, reduce_terms, zero_pair
from mpp_taichi.solvers.newton_matrix import NewtonMatrix
from mpp_taichi.solvers.report import SolverReport
from mpp_taichi.types import Template

MOST_ITERATIONS = 40
OVERSHOOT = 0.9  # the slope along an update may change its sign, but not exceed this part of its former size
SMALLEST_FACTOR = 1e-3  # of an update that is halved again and again
AT_ROUND_OFF = 1e4  # squared: updates within a hundred tolerances that shrink no more are rounding errors of the forces
# Relative to the length of a step; far below the error of any method of second order, and above rounding errors.
TOLERANCE = {ti.f32: 1e-6, ti.f64: 1e-12}
# For reversible methods, which damp no residual: a run there and back gathers the residuals of all its steps.
REVERSIBLE_TOLERANCE = {ti.f32: 1e-6, ti.f64: 1e-14}
UNIT_ROUND_OFF = {ti.f32: 2.0**-24, ti.f64: 2.0**-53}
COUNTERS = ("newton_count", "newton_most", "linear_count", "solved_steps", "cut_steps", "gaining_pieces")
RUNNING, SOLVED, GAVE_UP = 0, 1, 2


@ti.data_oriented
class Newton:
    """Solve P = b a(x* + P, v* + (g/b) P) for the displacement P of every particle.

    In the Euclidean norm over all particles, the last update, or the next one as the observed rate of convergence predicts it,
    must be below the tolerance times the displacement of the step; rounding errors of the positions are allowed for. An update
    that is too long (the residual along the update has changed its sign) is halved. A step that is not solved is reported.
    Source: Hairer & Wanner, Solving ODEs II, §IV.8 (the rate); Crisfield, Non-linear Finite Element Analysis, §9.2 (halving).
    """

    def __init__(self, matrix: NewtonMatrix, linear: Any, tolerance: float | None, *, reversible: bool):
        """Bind the solver of the linear systems; the default tolerance belongs to the precision and the kind of method."""
        precision = ti.lang.impl.current_cfg().default_fp
        self.matrix = matrix
        self.linear = linear
        self.total_force = matrix.total_force
        self.particle_count = matrix.total_force.particle_count
        self.launched = SolverReport()  # of steps whose iteration ran on the host
        default = (REVERSIBLE_TOLERANCE if reversible else TOLERANCE)[precision]
        self.tolerance_squared = (default if tolerance is None else tolerance) ** 2
        self.floor_squared = (4.0 * matrix.dimensions * UNIT_ROUND_OFF[precision]) ** 2

    def fields(self) -> dict[str, tuple[str, int]]:
        """Kind and count, for each replica, of the fields of this solver, of its matrix and of its linear solver."""
        vectors = ("piece_start", "base_shift", "base_velocity", "shift", "update", "right_side", "residual")
        return {
            **{name: ("vector", self.particle_count) for name in vectors},
            **{name: ("index", 1) for name in (*COUNTERS, "unsolved")},
            **self.matrix.fields(),
            **self.linear.fields(),
        }

    # The part of one particle; the results are summed over the particles

    @ti.func
    def displace(self, state: Template, i, ratio):
        """Move the particle to the trial position; ratio = g/b."""
        state.position[i] = state.piece_start[i] + (state.base_shift[i] + state.shift[i])
        state.velocity[i] = state.base_velocity[i] + ratio * state.shift[i]

    @ti.func
    def measure(self, state: Template, first, i, time, b):
        """Right side W (b a − P) at the trial position; returns its product with the last update."""
        acceleration = state.acceleration[i]
        if ti.static(self.total_force.depends_on_velocity):
            acceleration += self.total_force.local_acceleration(state, first, i, time, True)
        right_side = self.matrix.weight(state, i) * (b * acceleration - state.shift[i])
        if ti.static(state.has_fixed_axes):
            right_side *= state.free[i]
        state.right_side[i] = right_side
        return ti.Vector([dot(state, right_side, state.update[i]), ti.cast(0.0, state.wide)])

    @ti.func
    def apply(self, state: Template, i, factor, dt):
        """P += factor·δ; returns |factor·δ|² and the allowed size of |factor·δ|²."""
        change = factor * state.update[i]
        state.shift[i] = state.shift[i] + change
        way = dt * state.base_velocity[i]
        moved = dot(state, state.shift[i], state.shift[i]) + dot(state, way, way)
        # Rounding errors of positions reach P through the forces: fully along stiff springs, hardly along soft springs.
        noisy = ti.Vector.zero(float, state.dimensions)
        for k in ti.static(range(state.dimensions)):
            noisy[k] = (1.0 - self.matrix.weight(state, i) * state.inverse_block[i][k, k]) * state.piece_start[i][k]
        if ti.static(state.has_fixed_axes):
            noisy *= state.free[i]
        noise = dot(state, noisy, noisy)
        return ti.Vector([dot(state, change, change), self.tolerance_squared * moved + self.floor_squared * noise])

    # One thread

    @ti.func
    def solve_serial(self, state: Template, first, time, dt, b, g):
        """Find P, and count the iterations; returns 1 when P was found."""
        end = first + self.particle_count
        replica = first // self.particle_count
        status = RUNNING
        iterations = 0
        factor = ti.cast(1.0, float)
        slope_before = ti.cast(0.0, state.wide)
        last = ti.cast(0.0, state.wide)
        for i in range(first, end):
            state.update[i] = ti.Vector.zero(float, state.dimensions)
        while status == RUNNING:
            for i in range(first, end):
                self.displace(state, i, g / b)
            self.total_force.accumulate(state, first, time, "serial")
            slope = zero_pair(state)
            for i in range(first, end):
                slope += self.measure(state, first, i, time, b)
            sizes = zero_pair(state)
            if slope[0] < -OVERSHOOT * slope_before and factor > SMALLEST_FACTOR:
                factor *= 0.5
                for i in range(first, end):
                    sizes += self.apply(state, i, -factor, dt)
            else:
                indefinite = 1
                projected = 0
                while indefinite == 1 and projected < 2:
                    for i in range(first, end):
                        self.matrix.linearize(state, first, i, time, b, g, projected)
                    count, slope_before, indefinite = self.linear.solve_serial(state, first, time, g)
                    state.linear_count[replica] = state.linear_count[replica] + count
                    projected += 1
                factor = ti.cast(1.0, float)
                for i in range(first, end):
                    sizes += self.apply(state, i, factor, dt)
                iterations += 1
                status = self.judge(iterations, indefinite, sizes, last)
                last = sizes[0]
        state.newton_count[replica] = state.newton_count[replica] + iterations
        state.newton_most[replica] = ti.max(state.newton_most[replica], iterations)
        return ti.select(status == SOLVED, 1, 0)

    @ti.func
    def judge(self, iterations, indefinite, sizes, last):
        """State of the iteration; the text of `judgement`, on the device."""
        status = RUNNING
        if indefinite == 1:
            status = GAVE_UP
        elif sizes[0] <= sizes[1]:
            status = SOLVED
        elif iterations > 1 and sizes[0] < last:
            rate = ti.sqrt(sizes[0] / last)
            if rate * rate * sizes[0] <= (1.0 - rate) * (1.0 - rate) * sizes[1]:
                status = SOLVED
        if status == RUNNING and iterations > 3 and sizes[0] > 0.25 * last and sizes[0] <= AT_ROUND_OFF * sizes[1]:
            status = SOLVED
        if status == RUNNING and (iterations >= MOST_ITERATIONS or not sizes[0] < ti.math.inf):
            status = GAVE_UP
        return status

    # All particles at once

    def solve_parallel(self, state: Any, launch_force: Any, time: float, dt: float, b: float, g: float) -> bool:
        """Solve with a launch for each sweep; `launch_force(total_force, time)` sets the accelerations."""
        status, iterations, linear_iterations, factor, slope_before, last = RUNNING, 0, 0, 1.0, 0.0, 0.0
        self._clear(state)
        while status == RUNNING:
            self._displace(state, g / b)
            launch_force(self.total_force, time)
            self._measure(state, time, b)
            slope = read_total(state)[0]
            if slope < -OVERSHOOT * slope_before and factor > SMALLEST_FACTOR:
                factor *= 0.5
                self._apply(state, -factor, dt)
                continue
            for projected in (0, 1):
                self._linearize(state, time, b, g, projected)
                count, slope_before, indefinite = self.linear.solve_parallel(state, time, g)
                linear_iterations += count
                if not indefinite:
                    break
            factor = 1.0
            self._apply(state, factor, dt)
            iterations += 1
            sizes = read_total(state)
            status = judgement(iterations, indefinite, sizes, last)
            last = sizes[0]
        self.launched.newton_iterations += iterations
        self.launched.linear_iterations += linear_iterations
        self.launched.most_newton_iterations = max(self.launched.most_newton_iterations, iterations)
        return status == SOLVED

    def collect(self, state: Any) -> SolverReport:
        """The counts since the last call, from the device and from the host."""
        fields = [getattr(state, name) for name in (*COUNTERS, "unsolved")]
        found = bulk_copy.read(fields, np.int32)
        bulk_copy.write(fields[:-1], [np.zeros_like(count) for count in found[:-1]])
        counts = dict(zip(COUNTERS, found))
        report, self.launched = self.launched, SolverReport()
        report.add(
            SolverReport(
                steps=int(counts["solved_steps"].sum()),
                newton_iterations=int(counts["newton_count"].sum()),
                linear_iterations=int(counts["linear_count"].sum()),
                cut_steps=int(counts["cut_steps"].sum()),
                gaining_pieces=int(counts["gaining_pieces"].sum()),
                most_newton_iterations=int(counts["newton_most"].max()),
                unsolved=int(found[-1].sum()),
            )
        )
        report.fewest_steps += int(counts["solved_steps"].min())
        return report

    @ti.kernel
    def _clear(self, state: Template):
        for i in range(self.particle_count):
            state.update[i] = ti.Vector.zero(float, state.dimensions)

    @ti.kernel
    def _displace(self, state: Template, ratio: float):
        for i in range(self.particle_count):
            self.displace(state, i, ratio)

    @ti.kernel
    def _measure(self, state: Template, time: float, b: float):
        for i in range(self.particle_count):
            state.terms[i] = self.measure(state, 0, i, time, b)
        reduce_terms(state)

    @ti.kernel
    def _linearize(self, state: Template, time: float, b: float, g: float, projected: ti.i32):
        for i in range(self.particle_count):
            self.matrix.linearize(state, 0, i, time, b, g, projected)

    @ti.kernel
    def _apply(self, state: Template, factor: float, dt: float):
        for i in range(self.particle_count):
            state.terms[i] = self.apply(state, i, factor, dt)
        reduce_terms(state)


def judgement(iterations: int, indefinite: bool, sizes: tuple[float, float], last: float) -> int:
    """RUNNING, SOLVED or GAVE_UP, from |δ|² and its allowed size, and from |δ|² of the iteration before."""
    size, allowed = sizes
    if indefinite:
        return GAVE_UP
    if size <= allowed:
        return SOLVED
    if iterations > 1 and size < last:
        rate = (size / last) ** 0.5
        if rate**2 * size <= (1.0 - rate) ** 2 * allowed:
            return SOLVED
    if iterations > 3 and size > 0.25 * last and size <= AT_ROUND_OFF * allowed:
        return SOLVED
    return GAVE_UP if iterations >= MOST_ITERATIONS or not size < float("inf") else RUNNING
