"""Adaptive methods: they choose their steps themselves, and show the state at any time between two steps."""

from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.arithmetic.round_off import round_off
from mpp_taichi.device import bulk_copy
from mpp_taichi.integrators._base import Integrator
from mpp_taichi.integrators._launchers import Launchers
from mpp_taichi.integrators._trouble import Trouble, not_finite
from mpp_taichi.precision import FARTHEST_PAIR_IN_SINGLE
from mpp_taichi.scene.physics_checks import LARGEST_COORDINATE
from mpp_taichi.types import Template

NEAR_REST = 1e-3
"""Part of the time from rest across the system: the shortest time of change of a system of several particles."""

LONG_BESIDE_ROUNDING = 1e6
"""Roundings of the time in the shortest time of change: a first step, some 10⁻⁴ of this time, is many of them."""


@ti.data_oriented
class Adaptive(Integrator):
    """A method that takes steps as long as its error control allows, and shows the state at other times by a polynomial.

    `dt` is the time between two samples of the state; the motion does not depend on it. The fields of `memory` hold the true
    state at the start of the last step, and `position` and `velocity` hold the state that is shown. For each replica the field
    `clock` holds the begin and the length of the last step and the length of the next step [time]. The field `tally` holds the
    steps taken, the steps refused, the evaluations of the force, and whether the step became too short to change the time.

    The parameter that `controlled_by` names sets the accuracy of a run. Kernels read it from the field `control`, two numbers
    for each replica, so that one compilation serves all its values.
    """

    launchers = Launchers(serial="adaptive_steps", replicas="adaptive_steps", parallel="", copies_elsewhere=True)
    steps_about_center = True
    path_degree = 0  # of the polynomials that `write_paths` writes; 0: it writes none
    CONTROL = 2
    CLOCK = 3
    TALLY = 4
    STEPS, REFUSED, EVALUATIONS, STALLED = range(4)
    TRIES = 4  # of a step in one call of `take_step`; a step that needs more is tried again in the next call

    def scratch_count(self, velocity_dependent: bool) -> int:
        """None: its fields are work fields with names."""
        return 0

    def amplification(self, frequency: float, damping: float = 0.0) -> np.ndarray:
        """The exact matrix, since `dt` is not the step: exp of M = [[0, 1], [−ω², −γ]] by the eigenvalues λ and μ of M,

        (e^λ (M − μ) − e^μ (M − λ)) / (λ − μ); where the eigenvalues are equal e^λ (1 + M − λ).
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
        """Write the accuracy into the state, before a run begins."""
        kind = ti.lang.util.to_numpy_type(state.wide)
        bulk_copy.write([state.control], [np.tile(np.array(self.control(), kind), state.replica_count)])

    def times(self, state: Any) -> np.ndarray:
        """Time at which the last step ended, of each replica [time]."""
        clock = self._clock(state)
        return clock[:, 0] + clock[:, 1]

    def lengths(self, state: Any) -> np.ndarray:
        """Length of the last step of each replica [time]."""
        return self._clock(state)[:, 1]

    def are_short_of(self, state: Any, end: float) -> bool:
        """Whether the last step of a replica that has not stalled ends before `end`."""
        return bool(((self.times(state) < end) & (self.counts(state)[:, self.STALLED] == 0)).any())

    def _clock(self, state: Any) -> np.ndarray:
        kind = ti.lang.util.to_numpy_type(state.wide)
        return bulk_copy.read([state.clock], kind)[0].reshape(-1, self.CLOCK).astype(float)

    def first_lengths(self, state: Any) -> np.ndarray:
        """Length with which the first step begins, roughly, of each replica; only after `begin` [time]."""
        return self._clock(state)[:, 2]

    def counts(self, state: Any) -> np.ndarray:
        """Steps taken, steps refused, evaluations and whether it stalled, (replicas, 4)."""
        return bulk_copy.read([state.tally], np.int32)[0].reshape(-1, self.TALLY)

    def stalled_replicas(self, state: Any) -> np.ndarray:
        """Numbers of the replicas whose step has become too short for their time."""
        return np.flatnonzero(self.counts(state)[:, self.STALLED])

    standing_reason = "the step became too short to change the time"

    def standing_replicas(self, state: Any) -> np.ndarray:
        """The replicas that have stalled."""
        return self.stalled_replicas(state)

    def trouble(self, state: Any, bad: int) -> Trouble | None:
        """A replica whose step has become too short, and its particle with the largest acceleration."""
        stalled = self.stalled_replicas(state)
        if not len(stalled):
            return not_finite(bad)
        first = int(stalled[0]) * state.particle_count
        size = np.linalg.norm(self.accelerations(state)[first : first + state.particle_count], axis=1)
        particle = first + int(np.argmax(np.nan_to_num(size, nan=np.inf)))
        return Trouble("stalled", particle, time=float(self.times(state).min()))

    def facts(self, state: Any) -> dict[str, Any]:
        """The actions of the step control since the method was prepared, in all replicas."""
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
        """Accelerations at the start of the last step, (total_count, dimensions) [length / time²]."""
        return np.asarray(state.start_acceleration.to_numpy())

    @ti.func
    def begin(self, state: Template, total_force: Template, first, time: Template, dt: Template, shape: Template):
        """Take the state at `time` as the start of the first step."""

    @ti.func
    def advance_to(self, state: Template, total_force: Template, first, end: Template, most, shape: Template):
        """Take steps until a step ends at `end` or later, but no more than `most` steps."""
        r = first // total_force.particle_count
        left = most
        while left > 0 and self.is_short_of(state, r, end):
            left -= 1
            if state.clock[self.CLOCK * r + 1] > 0.0:
                self.enter_next(state, total_force, first)
            self.take_step(state, total_force, first, shape)

    @ti.func
    def enter_next(self, state: Template, total_force: Template, first):
        """Make the end of the last step the start of the next."""

    @ti.func
    def take_step(self, state: Template, total_force: Template, first, shape: Template):
        """Take one step from its start, and write its length and the length of the next step into `clock`.

        If `TRIES` tries in a row miss the accuracy, the step is not taken: its length in `clock` is 0, and the next length in
        `clock` is the length that the next call tries first.
        """

    def iterations_of_step(self, particles: int, per_evaluation: int) -> int:
        """Loop iterations of one call of `take_step`, with `enter_next` and `show`, an upper bound: some devices limit them.

        `per_evaluation` are the iterations of a sum of the forces.
        """
        raise TypeError(f"{type(self).__name__} does not tell the iterations of a step")

    @ti.func
    def show(self, state: Template, total_force: Template, first, time: Template):
        """Set positions and velocities to their values at a time within the last step."""

    @ti.func
    def begin_again(self, state: Template, total_force: Template, first, time: Template, shape: Template):
        """Begin a new step at a time within the last step, where the state was changed; the counts are kept."""
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
        """Length of the first step after a step was cut: the shorter of the last and the next length; 0: as at any start."""
        return ti.min(state.clock[self.CLOCK * r + 1], state.clock[self.CLOCK * r + 2])

    @ti.func
    def write_paths(self, state: Template, total_force: Template, coefficient: Template):
        """Write the polynomials of the positions in the last step, x_i = Σ_m coefficient[m n + i] s^m, s = 0 … 1."""

    @ti.func
    def start_clock(self, state: Template, r, time):
        """Set the clock of replica r to `time`, with no step taken and all counts zero."""
        for c in ti.static(range(self.TALLY)):
            state.tally[self.TALLY * r + c] = 0
        state.clock[self.CLOCK * r] = time
        state.clock[self.CLOCK * r + 1] = 0.0

    @ti.func
    def count(self, state: Template, r, which, amount):
        """Add to a count of replica r. `+=` would be an atomic, with which software Vulkan leaves `advance_to` too early."""
        place = self.TALLY * r + which
        state.tally[place] = state.tally[place] + amount

    @ti.func
    def time_of_change(self, state: Template, fastest, most, widest, time, dt):
        """Time in which the largest acceleration doubles the largest speed, or carries a particle from rest across the system.

        It is dt where nothing moves and nothing is accelerated. Where accelerations are next to nothing, it ends before a
        particle is so far away that the cube of its distance is no number. Speeds next to nothing, such as a rounding error,
        double in no time and tell nothing: the time is at least NEAR_REST of the time from rest across the system, and so long
        that a small part of it still changes `time`.
        """
        result = ti.cast(dt, state.wide)
        if most > 0.0 and fastest > 0.0:
            doubled = ti.max(fastest / most, NEAR_REST * ti.sqrt(widest / most), LONG_BESIDE_ROUNDING * 2.0**-52 * ti.abs(time))
            result = ti.min(doubled, ti.static(farthest()) / fastest)
        elif most > 0.0 and widest > 0.0:
            result = ti.sqrt(widest / most)
        return result

    @ti.func
    def is_short_of(self, state: Template, r, end):
        """Whether the last step of replica r ends before `end`, and the replica has not stalled."""
        reached = state.clock[self.CLOCK * r] + state.clock[self.CLOCK * r + 1]
        return reached < end and state.tally[self.TALLY * r + self.STALLED] == 0

    @ti.func
    def share_of_step(self, state: Template, r, time):
        """Position of a time in the last step of replica r, 0 … 1; 0 before the first step."""
        h = state.clock[self.CLOCK * r + 1]
        return ti.cast((time - state.clock[self.CLOCK * r]) / h if h > 0.0 else 0.0, float)

    @ti.func
    def evaluate(self, state: Template, total_force: Template, first, time, shape: Template):
        """Set state.acceleration to the sum of the forces that do not depend on velocity, and count the evaluation."""
        self.count(state, first // total_force.particle_count, self.EVALUATIONS, 1)
        if ti.static(total_force.has_velocity_independent):
            total_force.accumulate(state, first, ti.cast(time, float), shape)

    @ti.func
    def found(self, state: Template, total_force: Template, first, i, time):
        """Acceleration of a particle by all forces, after `evaluate`."""
        result = ti.Vector.zero(float, state.dimensions)
        if ti.static(total_force.has_velocity_independent):
            result += state.acceleration[i]
        if ti.static(total_force.depends_on_velocity):
            result += total_force.local_acceleration(state, first, i, ti.cast(time, float), True)
        return result


def rounding() -> float:
    """Distance between 1 and the next larger number in the precision of the run."""
    return 2.0 * round_off()


def farthest() -> float:
    """A distance whose cube is a number, in the precision of the run [length]."""
    return FARTHEST_PAIR_IN_SINGLE if ti.lang.impl.current_cfg().default_fp == ti.f32 else LARGEST_COORDINATE


def smallest() -> float:
    """The smallest positive number of full precision, in the precision of the run."""
    return 2.0**-126 if ti.lang.impl.current_cfg().default_fp == ti.f32 else 2.0**-1022
