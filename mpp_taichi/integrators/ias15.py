"""Gauss–Radau of order 15, which chooses its steps: accurate to round-off, in close encounters as well."""

from typing import Any

import taichi as ti

from mpp_taichi.component import component, param
from mpp_taichi.integrators._adaptive import Adaptive, rounding
from mpp_taichi.integrators._radau_polynomial import TERMS, RadauPolynomial
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.types import Template

FIRST_SHARE = 0.01  # of `time_of_change`: the first step
AGAIN_SHARE = 0.7  # of the next length, after the state was changed: a step that is slightly too long would not be repeated
LARGEST_CHANGE = 4.0  # of the length from a step to the next; a step that is too long by more than this factor is repeated


@component
@ti.data_oriented
class Ias15(Adaptive):
    """Acceleration over a step as a polynomial through 8 Gauss–Radau nodes, found by iteration to round-off.

        a(s) = a₀ + Σ b_k s^(k+1),  x(s) = x₀ + s h v₀ + (s h)² (a₀/2 + Σ b_k s^(k+1) / ((k+2)(k+3))),  s = 0 … 1

    The next step is h τ (5040 ε)^(1/7), where τ is the time, in steps, in which the acceleration changes at the step's end:
    τ² = min (|a| |a″| + |a′|²) / (|a′| |a‴| + |a″|²) over the particles, which is not zero where only an acceleration is zero.
    A particle that the change of its acceleration moves by less than a rounding of the farthest place has no part in it: of a
    particle at rest on a relaxed spring, τ is proportional to the step, so that no step would be short enough.
    Sums of positions and velocities are compensated, so that the error of the energy grows like round-off, with the square root
    of the number of steps. In f32 steps are longer: the derivatives of shorter steps would be round-off. Between the ends of
    steps the polynomial is as accurate as at the ends. The error of an orbit is at most 20 ε^(15/7) of the system's size from
    ε = 1e-2 to round-off: ε itself is no error.
    Sources: Everhart, IAU Colloq. 83 (1985) 185; Rein & Spiegel, Mon. Not. R. Astron. Soc. 446 (2015) 1424; criterion:
    Aarseth, Gravitational N-Body Simulations (2003) eq. 2.13, scaled as by Pham, Rein & Spiegel, Open J. Astrophys. 7 (2024).
    """

    dt: float = param(None, optional=True, above=0.0, unit="time", help="time between samples; absent: run.duration / 1000")
    epsilon: float = param(
        1e-9, above=0.0, maximum=1e-2, help="ε of the step length: smaller takes shorter steps; 1e-9: round-off"
    )

    order = 15
    path_degree = TERMS + 2
    carries_rounding = True
    controlled_by = "epsilon"
    begins_anew = True
    reference_tolerances = (1e-9, 3e-10, 1e-10)  # steps in the ratio 1 : 0.84 : 0.72
    slow_to_compile = True
    promising_for = ("encounters",)
    takes_tangent = True
    follows_deviation = False
    path = RadauPolynomial()

    @property
    def memory(self) -> tuple[str, ...]:
        """The fields of the clock and of the last step's polynomial, and of the deviation in a run that follows a deviation."""
        return ("clock", "tally", *self.path.memory, *(_deviation_class().memory if self.follows_deviation else ()))

    def follow_deviation(self, meter: Any, dual_state: Any, dual_force: Any) -> None:
        """Follow the deviation of a meter; the state and the sum of the forces are those of dual numbers."""
        self.deviation = _deviation_class()(meter, dual_state, dual_force)

    def work_fields(self, total_force: Any, start: Snapshot, *, plan: str, on_cpu: bool) -> dict[str, tuple[str, int]]:
        """The fields of the clock and of a step's polynomial, and of the deviation in a run that follows a deviation."""
        return {
            "clock": ("wide", self.CLOCK),
            "tally": ("index", self.TALLY),
            "control": ("wide", self.CONTROL),
            "measure": ("wide", 2),
            **self.path.work_fields(start.particle_count),
            **(_deviation_class().work_fields(start.particle_count) if self.follows_deviation else {}),
        }

    def control(self) -> tuple[float, float]:
        """(5040 ε)^(1/7), and the tolerance of the iteration.

        ε is bounded from below, so that the derivatives of a step stand out from round-off: in f32 steps are 0.73 τ or longer.
        """
        epsilon = max(self.epsilon, 200.0 * rounding())
        return (5040.0 * epsilon) ** (1.0 / 7.0), max(epsilon, 1e4 * rounding())

    def iterations_of_step(self, particles: int, per_evaluation: int) -> int:
        """The forces at all nodes in all iterations of each try; a deviation is found by as many iterations as a try."""
        tries = self.TRIES + (1 if self.follows_deviation else 0)
        return tries * self.path.iterations(particles, per_evaluation) + per_evaluation + 8 * particles

    # Steps up to the time of a sample

    @ti.func
    def begin(self, state: Template, total_force: Template, first, time: Template, dt: Template, shape: Template):
        """Take the state as the start; the first step is a small part of the time in which accelerations change speeds."""
        r = first // total_force.particle_count
        self.start_clock(state, r, time)
        self.evaluate(state, total_force, first, time, shape)
        fastest, most, widest = ti.cast(0.0, state.wide), ti.cast(0.0, state.wide), ti.cast(0.0, state.wide)
        for i in range(first, first + total_force.particle_count):
            fastest = ti.max(fastest, ti.cast(state.velocity[i].norm(), state.wide))
            most = ti.max(most, ti.cast(self.found(state, total_force, first, i, time).norm(), state.wide))
            widest = ti.max(widest, ti.cast((state.position[i] - state.position[first]).norm(), state.wide))
        state.clock[self.CLOCK * r + 2] = FIRST_SHARE * self.time_of_change(state, fastest, most, widest, time, dt)
        self.path.begin(state, total_force, first)
        if ti.static(self.follows_deviation):
            self.deviation.begin(total_force, first)

    @ti.func
    def show(self, state: Template, total_force: Template, first, time: Template):
        """Set the state to the value of the step's polynomial at a time within the step."""
        r = first // total_force.particle_count
        h = ti.cast(state.clock[self.CLOCK * r + 1], float)
        share = self.share_of_step(state, r, time)
        if ti.static(self.follows_deviation):
            self.deviation.show(total_force, first, share, state.clock[self.CLOCK * r + 1])
        self.path.place(state, total_force, first, share, h, True)

    @ti.func
    def length_again(self, state: Template, r):
        """The length of the last step, but less than the next length that its end asked for."""
        return ti.min(state.clock[self.CLOCK * r + 1], AGAIN_SHARE * state.clock[self.CLOCK * r + 2])

    @ti.func
    def write_paths(self, state: Template, total_force: Template, coefficient: Template):
        """Write the coefficients of the step's polynomial: x₀, h v₀, h² a₀/2 and h² b_k / ((k+2)(k+3))."""
        n = ti.static(total_force.particle_count)
        h = ti.cast(state.clock[1], float)
        for i in range(n):
            coefficient[i] = state.start_position[i] - state.position_rest[i]
            coefficient[n + i] = h * state.start_velocity[i]
            coefficient[2 * n + i] = 0.5 * h * h * state.start_acceleration[i]
            for k in ti.static(range(TERMS)):
                b = ti.static(self.path.term(state, "b", k))[i]
                coefficient[(k + 3) * n + i] = h * h * ti.static(1.0 / ((k + 2) * (k + 3))) * b

    @ti.func
    def take_step(self, state: Template, total_force: Template, first, shape: Template):
        """From the start state and the predicted `b`, iterate until a step is accepted; write its length and the next."""
        r = first // total_force.particle_count
        begin = state.clock[self.CLOCK * r]
        h = state.clock[self.CLOCK * r + 2]
        for i in range(first, first + total_force.particle_count):
            state.position[i] = state.start_position[i]
            state.velocity[i] = state.start_velocity[i]
        self.evaluate(state, total_force, first, begin, shape)
        for i in range(first, first + total_force.particle_count):
            state.start_acceleration[i] = self.found(state, total_force, first, i, begin)
        left = self.TRIES
        while left > 0:
            left -= 1
            error = self.path.solve(state, total_force, self, first, begin, ti.cast(h, float), shape)
            share = self._longest_share(state, total_force, first, ti.cast(h, float))
            if not error <= state.control[self.CONTROL * r + 1]:  # NaN fails, too
                share = ti.min(share, ti.static(0.5 / LARGEST_CHANGE))
            following = ti.min(h * share, h * LARGEST_CHANGE)
            if begin + 1e-3 * following == begin:
                state.tally[self.TALLY * r + self.STALLED] = 1
                state.clock[self.CLOCK * r + 1] = 0.0  # so that the start of the step is shown
                left = 0
            elif share < 1.0 / LARGEST_CHANGE:
                self.count(state, r, self.REFUSED, 1)
                self.path.rescale(state, total_force, first, ti.cast(following / h, float))
                h = following
                state.clock[self.CLOCK * r + 1], state.clock[self.CLOCK * r + 2] = 0.0, h
            else:
                left = 0
                self.count(state, r, self.STEPS, 1)
                state.clock[self.CLOCK * r + 1] = h
                state.clock[self.CLOCK * r + 2] = following
                if ti.static(self.follows_deviation):
                    self.deviation.follow(total_force, first, begin, ti.cast(h, float))

    @ti.func
    def place(self, state: Template, total_force: Template, first, s, h):
        """Set the particles to a node of the step, for the evaluation of the forces."""
        self.path.place(state, total_force, first, s, h, total_force.depends_on_velocity)

    # Transition to the next step

    @ti.func
    def _longest_share(self, state: Template, total_force: Template, first, h):
        """Length of the next step relative to this step, at most; 0 where a value is NaN."""
        r = first // total_force.particle_count
        state.measure[2 * r] = -ti.cast(ti.math.inf, state.wide)
        farthest = ti.cast(0.0, float)
        for i in range(first, first + total_force.particle_count):
            farthest = ti.max(farthest, state.start_position[i].norm())
        for i in range(first, first + total_force.particle_count):
            a = state.start_acceleration[i]
            first_slope = ti.Vector.zero(float, state.dimensions)
            second, third = first_slope, first_slope
            for k in ti.static(range(TERMS)):
                b = ti.static(self.path.term(state, "b", k))[i]
                a += b
                first_slope += (k + 1.0) * b
                second += (k + 1.0) * k * b
                third += (k + 1.0) * k * (k - 1.0) * b
            above = a.norm() * second.norm() + first_slope.norm_sqr()
            below = first_slope.norm() * third.norm() + second.norm_sqr()
            moved = h * h * (first_slope.norm() + second.norm() + third.norm())
            if (below > 0.0 and moved > ti.static(rounding()) * farthest) or ti.math.isnan(below):
                slowness = ti.cast(above / below, state.wide)
                raised = ti.select(ti.math.isnan(slowness), ti.cast(0.0, state.wide), -slowness)
                state.measure[2 * r] = ti.max(state.measure[2 * r], raised)
        result = ti.cast(LARGEST_CHANGE, state.wide)
        if ti.math.isinf(state.measure[2 * r]) == 0:
            result = ti.sqrt(-state.measure[2 * r]) * state.control[self.CONTROL * r]
        return result

    @ti.func
    def enter_next(self, state: Template, total_force: Template, first):
        """Make the end of the last step the start of the next, and predict the polynomial of the next step."""
        r = first // total_force.particle_count
        h = ti.cast(state.clock[self.CLOCK * r + 1], float)
        share = ti.cast(state.clock[self.CLOCK * r + 2] / state.clock[self.CLOCK * r + 1], float)
        if ti.static(self.follows_deviation):
            self.deviation.enter_next(total_force, first, state.clock[self.CLOCK * r + 1], share)
        self.path.enter_next(state, total_force, first, h, share)
        state.clock[self.CLOCK * r] = state.clock[self.CLOCK * r] + state.clock[self.CLOCK * r + 1]


def _deviation_class() -> Any:
    """RadauDeviation, imported only where a run follows a deviation: its tables and dual numbers take 30 ms of a start."""
    from mpp_taichi.integrators._radau_deviation import RadauDeviation

    return RadauDeviation
