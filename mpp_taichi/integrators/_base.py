"""Integrator: owns one whole step, written once and run by every execution plan."""

from collections.abc import Callable
from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.integrators._launchers import Launchers
from mpp_taichi.integrators._trouble import Trouble, not_finite
from mpp_taichi.snapshot import Snapshot
from mpp_taichi.solvers.report import SolverReport
from mpp_taichi.types import Template

SumForces = Callable[[Any, float], None]
"""Accelerations by the forces that do not depend on velocity: of a TotalForce, at a time."""


@ti.data_oriented
class Integrator:
    """The declarations and the step of every integrator: an opening stage, then a sum of forces and a stage in turn.

    order            of the global error in dt
    symplectic       keeps the energy of a conservative system bounded for ever
    time_reversible  a step of −dt undoes a step of dt, to round-off
    nodes            times, as parts of dt, at which a step needs the sum of the forces
    derivatives      how many time derivatives of the acceleration are summed with it: 1 the jerk, 2 the snap as well. A class
                     that needs any declares the literal `needs_derivatives = True`, by which scenes are checked
    takes_velocity   keeps its order with forces that depend on velocity. A class that does not declares the literal False, by
                     which scenes are checked, and the method is refused with such forces
    takes_time       works with forces that depend on time explicitly; declared and checked in the same way
    memory           work fields that a step leaves for the next step
    needs            quantities of the particles that the step reads, beside those that the forces need
    can_use_tree     needs nothing but accelerations, of all particles at once, so that a tree can sum them
    takes_low_parts  moves particles by the functions of `particle_update`, so that it runs in f32c, ds and df64
    carries_rounding  keeps the rounding errors of positions and velocities, so that changes below their spacing are not lost
    controlled_by    name of the parameter that sets the accuracy of a method that chooses its steps itself; else empty
    stable_for_any_stiffness  no spring is too stiff for any step
    steps_about_center   where particles act on each other only, the state holds positions and velocities relative to a frame
                         that moves with the centre of mass. For methods whose errors come near to round-off
    launchers        by which launchers of step/ it is run; read only by step/choose.py (see _launchers.py)

    The next attributes are read from the source text, before the class is imported, and must have literal values:

    moves_forward_alone  all drifts lead forward in time, so that contacts can be resolved during each of them
    drifts_after_kick    every drift follows the kick whose impulse it carries, as contacts with a compliance require
    begins_anew          chooses each step only by the motion at its beginning, so that a step can be cut at a contact
    flies                takes no steps: a contact solver that flies moves the particles
    takes_sliders        False: forces cannot be changed while the scene runs, since the method keeps constants made of them
    draws_random         changes velocities by random numbers in the middle of each drift (`meet_bath`): its motions have no
                         error that could be measured, and no tangent
    takes_rods           keeps the lengths of rigid rods, and its order with them
    takes_paths          puts bodies on given paths where they are after each of its drifts, and keeps its order with them
    takes_limits         evaluates the forces at places of the motion only, so that springs may break or yield there
    sums_slices          sums springs in slices before its loops over particles (TotalForce.sum_slices)
    made_for             flags of forces: the method goes with forces that have one of them, and with no other force
    made_for_reason      why the method goes with no other force
    orbits_central_body  moves all bodies on orbits around one of them, whose index is the parameter `central`; the parameter
                         `corrector` is one of the literal `correctors`
    default_of_kind      the method of a scene that leaves the choice of the method to its `accuracy:`
    reference_tolerances  of a method that gives reference solutions: three values of `controlled_by`, coarse to fine, with
                         which its errors are round-off, and its rounding errors are independent
    typical_evaluations  sums of forces in a step, roughly: enough to choose a plan by. An implicit step is many sweeps over
                         the particles, but each sweep has a launch of its own: one sweep is what counts
    promising_for        kinds of scenes ("encounters", "planets", "stiffness", see accuracy/families.py) in which a study of
                         accuracy tries the method first
    takes_any_numbers    the step can be taken with dual numbers and with lanes (arithmetic/kernel_number.py)
    takes_tangent        follows a deviation by equations of its own (`follow_deviation`), where the state has one; the phase
                         sets `follows_deviation` before it asks for the fields
    slow_to_compile      takes many times as long to compile as most methods
    proposed_for         purposes ("tree", "friction", "oscillation") for which messages propose the method
    well_known           whether readers know the method from textbooks, so that plots of a study always show it

    A subclass may make any of them a property. Here they must stay plain attributes: from a property of this class Taichi
    would take the value of this class, and not of the subclass.
    """

    order = 0
    symplectic = False
    time_reversible = False
    nodes: tuple = ()
    derivatives = 0
    needs_derivatives = False
    takes_velocity = True
    takes_time = True
    memory: tuple = ()
    needs: frozenset = frozenset()
    takes_low_parts = False
    carries_rounding = False
    controlled_by = ""
    stable_for_any_stiffness = False
    steps_about_center = False
    launchers = Launchers()
    can_use_tree = False
    moves_forward_alone = False
    drifts_after_kick = False
    begins_anew = False
    flies = False
    takes_sliders = True
    draws_random = False
    takes_rods = False
    takes_paths = False
    takes_limits = False
    sums_slices = False
    takes_any_numbers = False
    takes_tangent = False
    follows_deviation = False
    made_for: tuple = ()
    made_for_reason = ""
    orbits_central_body = False
    default_of_kind = False
    reference_tolerances: tuple = ()
    typical_evaluations = 1
    promising_for: tuple = ()
    slow_to_compile = False
    proposed_for: tuple = ()
    well_known = False

    @property
    def evaluations(self) -> int:
        """Sums of forces in a step that is made of stages."""
        return len(self.nodes)

    @property
    def evaluations_per_step(self) -> int | None:
        """Sums of forces in a step, for reports; None where the number differs from step to step."""
        return self.evaluations

    def scratch_count(self, velocity_dependent: bool) -> int:
        """Number of vector fields that a step needs beside position, velocity and acceleration."""
        raise TypeError(f"{type(self).__name__} does not declare its fields")

    def low_scratch_count(self) -> int:
        """Number of further vector fields where positions and velocities have low parts, which come after the others.

        There are as many again after these where positions and velocities have a third part.
        """
        return 0

    def slopes(self, velocity_dependent: bool) -> range:
        """The vector fields of `scratch_count` that hold accelerations, which have low parts in df64."""
        return range(0)

    def step_numbers(self, dt: float) -> list[float]:
        """The factors of velocities and accelerations in a step of dt [time], of which more digits are kept with low parts."""
        return []

    def work_fields(self, total_force: Any, start: Snapshot, *, plan: str, on_cpu: bool) -> dict[str, tuple[str, int]]:
        """Further fields of the state, by name: kind and count for each replica (see State)."""
        return {}

    def arrange(self, state: Any) -> None:
        """Give the work fields their first values, after the state was set from outside and before `prepare`."""

    def drifts_along_rods(self) -> int:
        """Drifts in a step that keep the lengths of rods, of a method that `takes_rods`."""
        raise TypeError(f"{type(self).__name__} keeps no lengths of rods")

    def in_vectors(self, state: Any, total_force: Any) -> bool:
        """Whether a kernel that runs whole steps in one thread is compiled with explicit vectors."""
        plain = not (state.carries_low or total_force.has_rods or total_force.has_given)
        return self.launchers.vectors and total_force.pairs_in_tiles and plain

    def prepare(self, state: Any, total_force: Any, time: float, sum_forces: SumForces) -> None:
        """Prepare the values that a step expects from the step before, after the state was set from outside."""

    def adopt(self, state: Any, dt: float) -> None:
        """Take positions and velocities that were set from outside, for steps of `dt`; to do so twice changes nothing more."""

    def count_from(self, state: Any, step: int) -> None:
        """The next step has this number since the start of the run; called after the state was set or taken over."""

    def set_step(self, state: Any, dt: float) -> None:
        """Prepare for steps of dt; called before each launch."""

    def heat(self, state: Any) -> float:
        """Energy that a bath of the method has given to the particles of the first replica [energy]."""
        return 0.0

    standing_reason = ""  # why replicas stand still

    def standing_replicas(self, state: Any) -> np.ndarray:
        """Numbers of the replicas that the method cannot move on."""
        return np.zeros(0, np.int64)

    def trouble(self, state: Any, bad: int) -> Trouble | None:
        """Why the run cannot go on, or None; `bad` is the first particle that is not finite, or −1. Asked after `collect`."""
        return not_finite(bad)

    def clear_trouble(self, state: Any) -> None:
        """Forget earlier trouble: the state is again as it was before."""

    def collect(self, state: Any) -> SolverReport | None:
        """The counts of the solver since the last call; None where a step solves no equations."""
        return None

    def facts(self, state: Any) -> dict[str, Any]:
        """The entries of reports about this kind of method, and about its work since it was prepared."""
        return {}

    def amplification(self, frequency: float, damping: float = 0.0) -> np.ndarray:
        """Matrix of one step for the oscillator x" = −ω² x − γ x′, in x and dt·v; frequency = ω dt, damping = γ dt.

        A step is stable where no eigenvalue λ has a modulus above 1. The energy changes by the factor |λ|² in each step.
        Methods of several steps give the matrix of their longer state.
        """
        raise TypeError(f"{type(self).__name__} does not declare its amplification")

    def loops(self, k: int, total_force: Any) -> int:
        """Number of loops over particles in stage k."""
        raise TypeError(f"{type(self).__name__} does not declare its loops")

    def parallel_loops(self, total_force: Any, loops_of_sum: int | None) -> int | None:
        """Parallel loops of one step, where a sum of forces takes `loops_of_sum`; None where that is not known."""
        if loops_of_sum is None:
            return None
        opening = 1 if self.joins_steps(total_force) else 0
        stages = sum(self.loops(k, total_force) for k in range(opening, self.evaluations + 1))
        return (self.evaluations * loops_of_sum if self.wants_sum(total_force) else 0) + stages

    def wants_sum(self, total_force: Any) -> bool:
        """Whether stages expect the sum of the forces in state.acceleration; otherwise each stage sums the forces itself.

        The sum is over the forces that do not depend on velocity.
        """
        return total_force.has_velocity_independent

    def joins_steps(self, total_force: Any) -> bool:
        """Whether the last stage of a step and the opening one of the next can share a loop (`stage_and_opening`)."""
        return False

    def looks_stages_up(self, total_force: Any) -> bool:
        """Whether the parallel plan compiles the stages after the opening as one, looked up while running."""
        return False

    @ti.func
    def stage(self, state: Template, total_force: Template, first, time: Template, dt: Template, k: Template):
        """Stage k of the step that began at `time`: stage 0 opens the step, stage k + 1 follows the force at nodes[k].

        It works on the particles first … first + particle_count − 1. An iteration never reads an entry of another particle that
        the same loop writes.
        """

    @ti.func
    def stage_and_opening(self, state: Template, total_force: Template, first, time: Template, dt: Template, opens):
        """The last stage and, where it `opens` the next step, the next opening stage; the same bits as with separate stages."""

    @ti.func
    def stage_after_force(self, state: Template, total_force: Template, first, time: Template, dt: Template, k):
        """Stage k ≥ 1, where k is not known before the kernel runs."""
        for c in ti.static(range(1, self.evaluations + 1)):
            if k == c:
                self.stage(state, total_force, first, time, dt, c)

    @ti.func
    def step(self, state: Template, total_force: Template, first, time: Template, dt: Template, shape: Template):
        """Advance from `time` to `time + dt`."""
        self.stage(state, total_force, first, time, dt, 0)
        self.step_on(state, total_force, first, time, dt, shape, False, False)

    @ti.func
    def step_on(
        self,
        state: Template,
        total_force: Template,
        first,
        time: Template,
        dt: Template,
        shape: Template,
        joins: Template,
        opens,
    ):
        """The rest of a step after its opening stage; where steps are joined, its last stage also `opens` the next step."""
        if ti.static(shape == "serial" and self.evaluations > 1):
            # The sum of forces takes by far the longest to compile, so the kernel holds it once, in a loop over the stages.
            for k in range(self.evaluations):
                node = 0.0
                for c in ti.static(range(self.evaluations)):
                    if k == c:
                        node = self.nodes[c]
                if ti.static(self.wants_sum(total_force)):
                    total_force.accumulate(state, first, time + dt * node, shape)
                self.stage_after_force(state, total_force, first, time, dt, k + 1)
        else:
            for k in ti.static(range(self.evaluations)):
                if ti.static(self.wants_sum(total_force)):
                    total_force.accumulate(state, first, time + self.nodes[k] * dt, shape)
                if ti.static(joins and k == self.evaluations - 1):
                    self.stage_and_opening(state, total_force, first, time, dt, opens)
                else:
                    self.stage(state, total_force, first, time, dt, k + 1)
