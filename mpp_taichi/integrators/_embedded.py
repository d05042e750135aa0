"""Embedded Runge–Kutta pairs that choose their steps, with output between two steps by the polynomial of the pair."""

from dataclasses import replace
from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.arithmetic.rough_functions import rough_power
from mpp_taichi.arithmetic.round_off import round_off
from mpp_taichi.device import bulk_copy
from mpp_taichi.integrators._adaptive import Adaptive
from mpp_taichi.integrators._compensated_sum import compensated_sum
from mpp_taichi.integrators._leverage import orbit_error_factors, orbit_forces
from mpp_taichi.integrators._runge_kutta import RungeKutta
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.types import Template

SAFETY = 0.9
PROPORTIONAL, INTEGRAL = 0.2, 0.85  # exponents of the last and the present error, times 1/k for an error of order h^k
SHORTEST, LONGEST = 0.2, 5.0  # length of a step, relative to the step before
FIRST_SHARE = 0.1  # of `time_of_change`: the first step at a tolerance of 1
REFUSED_BEFORE = -1.0  # in the field `judged`, where the next try is not the first of its step
LEAST_ERROR = 1e-4  # smaller estimates, relative to the tolerance, are not trusted


def wide_rows(pair: type[RungeKutta]) -> np.ndarray:
    """Square tableau of all slopes: of the stages, of the end of the step, and of the dense output."""
    rows = [*pair.a, pair.b, *pair.dense_stages]
    return np.array([[*row, *[0.0] * (len(rows) - len(row))] for row in rows])


def judges_orbits(total_force: Any) -> bool:
    """Whether errors of the orbits of pairs are estimated: not where a tree sums the force."""
    return bool(total_force.has_pairs and not total_force.by_tree and orbit_forces(total_force))


class Embedded(Adaptive):
    """Steps of a pair, whose length h is controlled by the pair's estimate of the error; see RungeKutta for its declarations.

    The estimate e is the largest |Δx| / X or |Δv| / V of all particles. X and V are the largest distance and velocity relative
    to the first particle, or the largest change in the step where that is more, so that the place and the velocity of the whole
    system do not matter. Under gravity and Coulomb's force the tolerance is the error of an orbit: e is multiplied by the
    measured factor `orbit_factor`, and is for each bound pair at least `leverage_factor` L times the larger of |Δd|/ρ and
    |Δw|/w, the errors of its separation and relative velocity; the leverage L (_leverage.py) is 1/(1 − e) at the pericentre of
    an ellipse. A step is accepted where e ≤ tolerance; the next step is
    h 0.9 (tolerance/e)^(0.85/k) (e_before/tolerance)^(0.2/k), the same for all particles. A refused step is repeated with
    h 0.9 (tolerance/e)^(1/k). The first slope is the last slope of the step before, and sums over steps are compensated.
    Between two steps the state is on the pair's polynomial. Further forces that the polynomial needs are evaluated only in
    steps in which the state is shown.
    Source: Hairer, Nørsett & Wanner, Solving Ordinary Differential Equations I, 2nd ed. (1993), §II.4; the controller:
    Gustafsson, ACM Trans. Math. Softw. 17 (1991) 533.
    """

    pair: type[RungeKutta]
    error_order = 0  # k
    orbit_factor = 1.0  # error of an orbit over the estimates of its steps, measured
    leverage_factor = 0.0  # part of a pair's leverage that counts
    tolerance: float
    carries_rounding = True
    controlled_by = "tolerance"
    launchers = replace(Adaptive.launchers, quickly=True)
    VECTORS = ("start_position", "start_velocity", "start_acceleration", "position_rest", "velocity_rest")
    memory = ("clock", "tally", "judged", "slope", *VECTORS)

    def work_fields(self, total_force: Any, start: Snapshot, *, plan: str, on_cpu: bool) -> dict[str, tuple[str, int]]:
        """The true state at the start of the step, all slopes, and for each replica the clock and the field `judged`.

        `judged` holds the error of the last step relative to the tolerance, and whether the step has the slopes of its dense
        output, or is refused. Weights are looked up in a field: in the kernel itself they would take half a minute to compile.
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
            **({"miss": ("vector", 2 * len(self.pair.error_weights) * n)} if judges_orbits(total_force) else {}),
            **{name: ("vector", n) for name in self.VECTORS},
        }

    def arrange(self, state: Any) -> None:
        """Write the weights into their fields, once for each replica."""
        rows = np.array(self._table())
        nodes, kind = wide_rows(self.pair).sum(axis=1), ti.lang.util.to_numpy_type(state.weight.dtype)
        arrays = [np.tile(each.ravel(), state.replica_count).astype(kind) for each in (rows, nodes)]
        bulk_copy.write((state.weight, state.node), arrays)

    def iterations_of_step(self, particles: int, per_evaluation: int) -> int:
        """All slopes, each from a sum over the slopes before it, and the errors of all particles and pairs, for each try."""
        sums = particles * (1 + self._count)
        slope = 1 + sums + per_evaluation + particles
        errors = particles * (1 + len(self.pair.error_weights) * (1 + self._count)) + particles**2
        return self.TRIES * (1 + self._count * slope + errors) + 2 * sums + 2 * self._count * len(self._table())

    @property
    def _count(self) -> int:
        """Number of all slopes."""
        return len(wide_rows(self.pair))

    @property
    def _evaluated(self) -> int:
        """Number of slopes of a step, its end included; the slopes beyond belong to the dense output."""
        return len(self.pair.b) + 1

    def _table(self) -> list[list[list[float]]]:
        """Rows of the weights of all slopes in x, times h², and in v, times h.

        There is a row for the place of each slope, a row for each estimate of the error, a row for each power θ, θ², … of the
        dense output, and an empty row, into which `show` writes the sum of these powers.
        """
        full = wide_rows(self.pair)
        errors = [np.array([*row, *[0.0] * (len(full) - len(row))]) for row in self.pair.error_weights]
        dense = np.array([list(row) for row in self.pair.dense_weights]).T
        rows = [*full, *errors, *dense, np.zeros(len(full))]
        return [[(row @ full).tolist(), row.tolist()] for row in rows]

    def control(self) -> tuple[float, float]:
        """The tolerance, but no less than round-off allows; and the length of the first step relative to `time_of_change`."""
        tolerance = max(self.tolerance, 16.0 * round_off())
        return tolerance, FIRST_SHARE * tolerance ** (1.0 / self.error_order)

    # Steps up to the time of a sample

    @ti.func
    def begin(self, state: Template, total_force: Template, first, time: Template, dt: Template, shape: Template):
        """Take the state as the start; the first step is a small part of the time in which accelerations change speeds."""
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
        following = self.time_of_change(state, fastest, most, widest, time, dt)
        state.clock[self.CLOCK * r + 2] = state.control[self.CONTROL * r + 1] * following
        state.judged[2 * r] = 1.0
        state.judged[2 * r + 1] = 0.0

    @ti.func
    def show(self, state: Template, total_force: Template, first, time: Template):
        """Set the state to the value of the step's polynomial at a time within the step."""
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
        """Evaluate the slopes that only the dense output needs, unless this step has them already."""
        r = first // total_force.particle_count
        if ti.static(self._count > self._evaluated):
            if state.judged[2 * r + 1] == 0.0 and h > 0.0:
                start, stop = ti.static(self._evaluated, self._count)
                self._take_slopes(state, total_force, first, start, stop, h, "serial")
                state.judged[2 * r + 1] = 1.0

    @property
    def path_degree(self) -> int:
        """The degree of the dense output."""
        return max(len(row) for row in self.pair.dense_weights)

    @ti.func
    def write_paths(self, state: Template, total_force: Template, coefficient: Template):
        """Write the coefficients of the dense output: x₀, h v₀ and h² Σ_k w_mk f_k."""
        n, powers = ti.static(total_force.particle_count, self._count + len(self.pair.error_weights))
        h = ti.cast(state.clock[1], float)
        self._complete(state, total_force, 0, h)
        for i in range(n):
            coefficient[i] = state.start_position[i] - state.position_rest[i]
            coefficient[n + i] = h * state.start_velocity[i]
            for m in range(2, self.path_degree + 1):
                x, _ = self._sums(state, total_force, 0, i, powers + m - 1)
                coefficient[m * n + i] = h * h * x

    # A step

    @ti.func
    def take_step(self, state: Template, total_force: Template, first, shape: Template):
        """Try steps from the start state until the error of one is small enough; write its length and the next length."""
        r = first // total_force.particle_count
        h = state.clock[self.CLOCK * r + 2]
        grows = ti.cast(1.0 if state.judged[2 * r + 1] == REFUSED_BEFORE else LONGEST, state.wide)
        left = self.TRIES
        while left > 0:
            left -= 1
            self._take_slopes(state, total_force, first, 1, ti.static(self._evaluated), ti.cast(h, float), shape)
            error = self._error(state, total_force, first, ti.cast(h, float))
            if state.clock[self.CLOCK * r] + 1e-3 * h == state.clock[self.CLOCK * r]:
                state.tally[self.TALLY * r + self.STALLED] = 1
                state.clock[self.CLOCK * r + 1] = 0.0  # so that the start of the step is shown
                left = 0
            elif error <= 1.0:
                seen = ti.max(error, ti.cast(LEAST_ERROR, state.wide))
                change = SAFETY * rough_power(seen, -INTEGRAL / self.error_order)
                change *= rough_power(state.judged[2 * r], PROPORTIONAL / self.error_order)
                state.judged[2 * r], state.judged[2 * r + 1] = seen, 0.0
                self.count(state, r, self.STEPS, 1)
                state.clock[self.CLOCK * r + 1] = h
                state.clock[self.CLOCK * r + 2] = h * ti.min(grows, ti.max(ti.cast(SHORTEST, state.wide), change))
                left = 0
            else:
                # An error that is NaN fails both comparisons, and the step shrinks the most.
                self.count(state, r, self.REFUSED, 1)
                change = ti.cast(SHORTEST, state.wide)
                if error < 1e30:
                    change = ti.max(change, SAFETY * rough_power(error, -1.0 / self.error_order))
                h *= change
                grows = 1.0
                state.judged[2 * r + 1] = REFUSED_BEFORE
                state.clock[self.CLOCK * r + 1], state.clock[self.CLOCK * r + 2] = 0.0, h

    @ti.func
    def _take_slopes(self, state: Template, total_force: Template, first, start, stop, h, shape: Template):
        """Take the slopes start … stop − 1 of a step of length h; one copy of the force serves all slopes."""
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
        """Store slope k of particle i."""
        state.slope[first * self._count + k * total_force.particle_count + i - first] = slope

    @ti.func
    def _place(self, first, total_force: Template, row):
        """Index of the first weight of a row."""
        r = first // total_force.particle_count
        return 2 * ti.static(self._count) * (ti.static(len(self._table())) * r + row)

    @ti.func
    def _sums(self, state: Template, total_force: Template, first, i, row):
        """Weighted sums over the slopes of particle i, for x and for v."""
        x, v = ti.Vector.zero(float, state.dimensions), ti.Vector.zero(float, state.dimensions)
        place = self._place(first, total_force, row)
        for k in range(self._count):
            slope = state.slope[first * self._count + k * total_force.particle_count + i - first]
            x += state.weight[place + k] * slope
            v += state.weight[place + self._count + k] * slope
        return x, v

    @ti.func
    def _error(self, state: Template, total_force: Template, first, h):
        """The estimated error over the tolerance, at the end of the step; two estimates give E₅² / √(E₅² + 0.01 E₃²)."""
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
                if ti.static(judges_orbits(total_force)):
                    place = ti.static(2 * total_force.particle_count) * c + ti.static(2 * count - 1) * first + i
                    state.miss[place], state.miss[place + ti.static(total_force.particle_count)] = h * h * x, h * v
                off, slip = h * h * x.norm(), h * v.norm()
                off = off / widest if off > 0.0 or ti.math.isnan(off) else off
                slip = slip / fastest if slip > 0.0 or ti.math.isnan(slip) else slip
                # A comparison with NaN is false; written like this, NaN is kept as the error.
                if not (off <= errors[c]):
                    errors[c] = off
                if not (slip <= errors[c]):
                    errors[c] = slip
        if ti.static(judges_orbits(total_force)):
            errors = self._errors_of_orbits(state, total_force, first, errors)
        result = errors[0]
        if ti.static(count == 2):
            result *= errors[0] / ti.sqrt(errors[0] ** 2 + 0.01 * errors[1] ** 2) if errors[0] > 0.0 else 1.0
        if ti.static(len(orbit_forces(total_force)) > 0):
            result *= self.orbit_factor
        return ti.cast(result, state.wide) / state.control[self.CONTROL * r]

    @ti.func
    def _errors_of_orbits(self, state: Template, total_force: Template, first, errors):
        """The estimates, raised to those of the orbits of pairs about each other; the state is at the end of the step."""
        n, count = ti.static(total_force.particle_count, len(self.pair.error_weights))
        result = errors
        slopes = first * self._count + ti.static(self._evaluated - 1) * n
        for i in range(n):
            for j in range(i + 1, n):
                acceleration = state.slope[slopes + j] - state.slope[slopes + i]
                factors = orbit_error_factors(state, total_force, first + i, first + j, acceleration)
                if factors[0] > 0.0:
                    for c in ti.static(range(count)):
                        place = 2 * (count * first + c * n)
                        off = (state.miss[place + j] - state.miss[place + i]).norm()
                        slip = (state.miss[place + n + j] - state.miss[place + n + i]).norm()
                        error = self.leverage_factor * ti.max(factors[0] * off, factors[1] * slip)
                        if not (error <= result[c]):
                            result[c] = error
        return result

    @ti.func
    def enter_next(self, state: Template, total_force: Template, first):
        """Make the end of the last step the start of the next; the sums are compensated."""
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
        state.clock[self.CLOCK * r] = state.clock[self.CLOCK * r] + state.clock[self.CLOCK * r + 1]
