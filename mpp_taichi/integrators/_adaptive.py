"""Adaptive methods: steps of their own choice, and a look at any time between."""

from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.integrators._base import Integrator
from mpp_taichi.integrators._launchers import Launchers
from mpp_taichi.integrators._trouble import Trouble, not_finite
from mpp_taichi.types import Template


class Adaptive(Integrator):
    """Takes steps as long as its error control allows, and shows the state at other times by its own polynomial.

    `dt` is the time between two looks; the motion does not depend on it. What a step hands on to the next is `memory`: between
    two looks the true state is there, and `position` and `velocity` hold what is shown. For each replica `clock` has the begin
    and length of the last step, and the length of the next [time]; `tally` the steps taken, the steps refused, the evaluations
    of the force, and whether the step fell below what the time can resolve.

    The parameter `controlled_by` says how accurate a run is. Kernels read it from `control`, two numbers for each replica, so
    that one compilation serves all its values.
    """

    launchers = Launchers(serial="adaptive", replicas="adaptive", parallel="", cpu_only=True)  # its loops have no bound
    path_degree = 0  # of the polynomials that `write_paths` gives; 0: it gives none
    CONTROL = 2
    CLOCK = 3
    TALLY = 4
    STEPS, REFUSED, EVALUATIONS, STALLED = range(4)

    def scratch_count(self, velocity_dependent: bool) -> int:
        """What it keeps has names of its own."""
        return 0

    def amplification(self, frequency: float, damping: float = 0.0) -> np.ndarray:
        """The exact one: no step is too long, as `dt` is not the step. exp of M = [[0, 1], [−ω², −γ]] by its eigenvalues λ, μ:

        (e^λ (M − μ) − e^μ (M − λ)) / (λ − μ); where they are equal e^λ (1 + M − λ).
        """
        matrix = np.array([[0.0, 1.0], [-(frequency**2), -damping]])
        root = np.emath.sqrt(damping**2 / 4 - frequency**2)
        one, other = -damping / 2 + root, -damping / 2 - root
        if abs(root) < 1e-8 * max(damping, 1e-300):
            return np.real(np.exp(one) * (np.eye(2) + matrix - one * np.eye(2)))
        return np.real((np.exp(one) * (matrix - other * np.eye(2)) - np.exp(other) * (matrix - one * np.eye(2))) / (2 * root))

    def control(self) -> tuple[float, float]:
        """The two numbers that kernels read, from the parameter `controlled_by`."""
        return float(getattr(self, self.controlled_by)), 0.0

    def set_control(self, state: Any) -> None:
        """Before a run begins: what `controlled_by` has become."""
        state.control.from_numpy(np.tile(np.array(self.control()), state.replica_count))

    def times(self, state: Any) -> np.ndarray:
        """End of the last step [time], of each replica."""
        clock = state.clock.to_numpy().reshape(-1, self.CLOCK)
        return np.asarray(clock[:, 0] + clock[:, 1], dtype=float)

    def lengths(self, state: Any) -> np.ndarray:
        """Of the last step [time], of each replica."""
        return np.asarray(state.clock.to_numpy().reshape(-1, self.CLOCK)[:, 1], dtype=float)

    def counts(self, state: Any) -> np.ndarray:
        """Steps taken, steps refused, evaluations and whether it stalled, (replicas, 4)."""
        return np.asarray(state.tally.to_numpy().reshape(-1, self.TALLY))

    def stalled_replicas(self, state: Any) -> np.ndarray:
        """Numbers of the replicas whose step has become too short for their time."""
        return np.flatnonzero(self.counts(state)[:, self.STALLED])

    def trouble(self, state: Any, bad: int) -> Trouble | None:
        """A replica whose step has become too short, and of its particles the one that is accelerated most."""
        stalled = self.stalled_replicas(state)
        if not len(stalled):
            return not_finite(bad)
        first = int(stalled[0]) * state.particle_count
        size = np.linalg.norm(self.accelerations(state)[first : first + state.particle_count], axis=1)
        particle = first + int(np.argmax(np.nan_to_num(size, nan=np.inf)))
        return Trouble("stalled", particle, time=float(self.times(state).min()))

    def facts(self, state: Any) -> dict[str, Any]:
        """What the control of the step did since the method was prepared, in all replicas."""
        counts = self.counts(state)
        return {
            "step_control": {
                "steps": int(counts[:, self.STEPS].sum()),
                "refused": int(counts[:, self.REFUSED].sum()),
                "force_evaluations": int(counts[:, self.EVALUATIONS].sum()),
                "last_step": float(self.lengths(state)[0]),
                "replicas": len(counts),
            }
        }

    @property
    def evaluations_per_step(self) -> int | None:
        """Differs from step to step."""
        return None

    def accelerations(self, state: Any) -> np.ndarray:
        """At the start of the last step, (total_count, dimensions) [length / time²]."""
        return np.asarray(state.start_acceleration.to_numpy())

    @ti.func
    def begin(self, state: Template, total_force: Template, first, time: Template, dt: Template, shape: Template):
        """Take the state as it is at `time`, with nothing known of it."""

    @ti.func
    def advance_to(self, state: Template, total_force: Template, first, end: Template, shape: Template):
        """Take steps until one ends at `end` or later."""
        r = first // total_force.particle_count
        while self.is_short_of(state, r, end):
            if state.clock[self.CLOCK * r + 1] > 0.0:
                self.enter_next(state, total_force, first)
            self.take_step(state, total_force, first, shape)

    @ti.func
    def enter_next(self, state: Template, total_force: Template, first):
        """Make the end of the last step the start of the next."""

    @ti.func
    def take_step(self, state: Template, total_force: Template, first, shape: Template):
        """One step from its start, with the length of this and the next."""

    @ti.func
    def show(self, state: Template, total_force: Template, first, time: Template):
        """Positions and velocities at a time within the last step."""

    @ti.func
    def begin_again(self, state: Template, total_force: Template, first, time: Template, shape: Template):
        """Take the state as it is at a time within the last step, where something has changed it; what was counted stays."""
        r = first // total_force.particle_count
        length = self.length_again(state, r)
        counted = ti.Vector([state.tally[self.TALLY * r + c] for c in ti.static(range(self.TALLY))], ti.i32)
        self.begin(state, total_force, first, time, state.clock[self.CLOCK * r + 1], shape)
        for c in ti.static(range(self.TALLY)):
            state.tally[self.TALLY * r + c] = state.tally[self.TALLY * r + c] + counted[c]
        if length > 0.0:
            state.clock[self.CLOCK * r + 2] = length

    @ti.func
    def length_again(self, state: Template, r):
        """Of the first step after one was cut: that of the last, or of what was to be the next; 0: as for any start."""
        return ti.min(state.clock[self.CLOCK * r + 1], state.clock[self.CLOCK * r + 2])

    @ti.func
    def write_paths(self, state: Template, total_force: Template, coefficient: Template):
        """The polynomials of the last step's positions, of one copy: x_i = Σ_m coefficient[m n + i] s^m, s = 0 … 1."""

    @ti.func
    def start_clock(self, state: Template, r, time):
        """Of replica r: no step taken, nothing counted."""
        for c in ti.static(range(self.TALLY)):
            state.tally[self.TALLY * r + c] = 0
        state.clock[self.CLOCK * r] = time
        state.clock[self.CLOCK * r + 1] = 0.0

    @ti.func
    def time_of_change(self, state: Template, fastest, most, widest, dt):
        """In which the largest acceleration changes the largest speed by as much as it is, or from rest crosses the system."""
        result = ti.cast(dt, state.wide)
        if most > 0.0 and fastest > 0.0:
            result = fastest / most
        elif most > 0.0 and widest > 0.0:
            result = ti.sqrt(widest / most)
        return result

    @ti.func
    def is_short_of(self, state: Template, r, end):
        """Whether replica r has to take another step, and can."""
        reached = state.clock[self.CLOCK * r] + state.clock[self.CLOCK * r + 1]
        return reached < end and state.tally[self.TALLY * r + self.STALLED] == 0

    @ti.func
    def share_of_step(self, state: Template, r, time):
        """Where in the last step of replica r a time is, 0 … 1; 0 before the first."""
        h = state.clock[self.CLOCK * r + 1]
        return ti.cast((time - state.clock[self.CLOCK * r]) / h if h > 0.0 else 0.0, float)

    @ti.func
    def evaluate(self, state: Template, total_force: Template, first, time, shape: Template):
        """Counted: state.acceleration = what does not depend on velocity."""
        state.tally[self.TALLY * (first // total_force.particle_count) + self.EVALUATIONS] += 1
        if ti.static(total_force.has_velocity_independent):
            total_force.accumulate(state, first, ti.cast(time, float), shape)

    @ti.func
    def found(self, state: Template, total_force: Template, first, i, time):
        """Acceleration of a particle where the state now is, after `evaluate`."""
        result = ti.Vector.zero(float, state.dimensions)
        if ti.static(total_force.has_velocity_independent):
            result += state.acceleration[i]
        if ti.static(total_force.depends_on_velocity):
            result += total_force.local_acceleration(state, first, i, ti.cast(time, float), True)
        return result


def rounding() -> float:
    """Of the precision of the run: the distance of the numbers beside 1."""
    return 2.0**-23 if ti.lang.impl.current_cfg().default_fp == ti.f32 else 2.0**-52
