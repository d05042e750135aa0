"""Integrator: owns one whole step, written once and run by every execution plan."""

from collections.abc import Callable
from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.snapshot import Snapshot
from mpp_taichi.types import Template


@ti.data_oriented
class Integrator:
    """What every integrator declares, and the step of all of them: an opening stage, then force and stage in turn.

    order            of the global error in dt
    symplectic       keeps the energy of a conservative system bounded for ever
    time_reversible  a step of −dt undoes a step of dt, to round-off
    nodes            times, as parts of dt, at which a step wants the force
    keeps_force      a step uses, at its start, the force that the step before ended with
    implicit         a step solves equations (see _implicit.py)
    adaptive         takes steps of its own choice (see _adaptive.py)
    derivatives      of the acceleration that a step wants summed with it, in time: 1 the jerk, 2 the snap as well; a class
                     that wants any says so with a literal `needs_derivatives = True`, which scenes are checked by
    own_state        keeps the motion in fields of its own, and `launch` sets what is shown from them
    quickly_compiled its kernels are long, and compiled without Taichi's own optimisation (see quick_compilation.py)
    writes_vectors   its step reads and writes vectors by components: it can be compiled together with the sum over pairs
                     in explicit vectors (see device/fast_taichi/explicit_vectors.py)
    takes_velocity   keeps its order beside forces that depend on velocity; a class where it is not so says it with a literal
                     False of its own, which scenes are checked by, and the method is refused beside such forces
    takes_time       goes beside forces that depend on time by themselves; said and checked in the same way
    on_cpu_only      wants what other backends lack
    memory           work fields that a step hands on to the next
    can_use_tree     needs accelerations alone, of all particles at once, so that a tree can sum them
    takes_low_parts  moves particles by `low_parts`, so that it runs in f32c and ds; it says its `step_numbers`

    The next attributes are read from the source text, before the class is imported, and must have literal values:

    moves_forward_alone  all drifts lead forward in time, so that contacts can be resolved during each of them
    drifts_after_kick    every drift follows the kick whose impulse it carries, as contacts with a compliance require
    begins_anew          chooses each step by the motion at its beginning alone, so that a step can be cut at a contact
    flies                takes no steps: a contact solver that flies moves the particles
    takes_sliders        False: forces cannot be changed while the scene runs, since the method keeps constants made of them
    made_for             flags of forces: the method goes with forces that have one of them, and with no other force
    made_for_reason      why
    orbits_central_body  moves all bodies on orbits around one of them, whose index is the parameter `central`; the parameter
                         `corrector` is one of the literal `correctors`
    default_of_kind      the method of a scene that leaves the choice of the method to its `accuracy:`
    reference_method     gives a reference solution to round-off, from which errors of other methods are measured
    proposed_for         purposes ("tree", "friction", "oscillation") for which messages propose the method

    Subclasses may make any of them a property; here they must stay plain attributes, or Taichi would take these instead.
    """

    order = 0
    symplectic = False
    time_reversible = False
    nodes: tuple = ()
    keeps_force = False
    implicit = False
    adaptive = False
    derivatives = 0
    needs_derivatives = False
    own_state = False
    quickly_compiled = False
    writes_vectors = False
    takes_velocity = True
    takes_time = True
    on_cpu_only = False
    memory: tuple = ()
    takes_low_parts = False
    can_use_tree = False
    moves_forward_alone = False
    drifts_after_kick = False
    begins_anew = False
    flies = False
    takes_sliders = True
    made_for: tuple = ()
    made_for_reason = ""
    orbits_central_body = False
    default_of_kind = False
    reference_method = False
    proposed_for: tuple = ()

    @property
    def evaluations(self) -> int:
        """Forces per step."""
        return len(self.nodes)

    def scratch_count(self, velocity_dependent: bool) -> int:
        """Vector fields beyond position, velocity and acceleration."""
        raise TypeError(f"{type(self).__name__} does not say what it needs")

    def low_scratch_count(self) -> int:
        """Vector fields more where positions and velocities have low parts; they come after the others."""
        return 0

    def step_numbers(self, dt: float) -> list[float]:
        """What velocities and accelerations are multiplied by in a step of dt [time]; with low parts, more digits are kept."""
        return []

    def work_fields(self, total_force: Any, start: Snapshot, *, plan: str, on_cpu: bool) -> dict[str, tuple[str, int]]:
        """Fields beyond those, by name: kind and count for each replica (see State)."""
        return {}

    def arrange(self, state: Any) -> None:
        """Fill the work fields that a step reads and none writes, after the state was set from outside."""

    def in_vectors(self, state: Any, total_force: Any) -> bool:
        """Whether a kernel with a whole step in one thread is compiled with explicit vectors."""
        return self.writes_vectors and total_force.pairs_in_tiles and not state.carries_low

    def starting_force(self, total_force: Any) -> Any:
        """The forces that a step with `keeps_force` expects to find, after the state was set from outside."""
        return total_force

    def prepare(self, state: Any, sum_forces: Callable[[], None]) -> None:
        """What a step with `keeps_force` expects to find, after the state was set from outside."""
        sum_forces()

    def adopt(self, state: Any) -> None:
        """Take positions and velocities that were set from outside; twice is once."""

    def left_lattice(self, state: Any, i: int) -> str:
        """What is wrong with particle i, of all replicas, that is no fault of the force; mostly nothing."""
        return ""

    def amplification(self, frequency: float, damping: float = 0.0) -> np.ndarray:
        """Matrix of one step for the oscillator x" = −ω² x − γ x′, in x and dt·v; frequency = ω dt, damping = γ dt.

        A step is stable where no eigenvalue is beyond 1 in modulus. Over one oscillation the energy falls by |λ|² a step.
        Methods of several steps give the matrix of their longer state.
        """
        raise TypeError(f"{type(self).__name__} does not say how it treats an oscillator")

    def loops(self, k: int, total_force: Any) -> int:
        """How many loops over particles stage k runs."""
        raise TypeError(f"{type(self).__name__} does not say how many loops it runs")

    def wants_sum(self, total_force: Any) -> bool:
        """Whether a stage finds the sum of the forces without velocity in state.acceleration; else it sums them itself."""
        return total_force.has_velocity_independent

    def joins_steps(self, total_force: Any) -> bool:
        """Whether the last stage of a step and the opening one of the next can share a loop (`stage_and_opening`)."""
        return False

    def looks_stages_up(self, total_force: Any) -> bool:
        """Whether the parallel plan compiles the stages after the opening as one, looked up while running."""
        return False

    @ti.func
    def stage(self, state: Template, total_force: Template, first, time: Template, dt: Template, k: Template):
        """Stage k of the step that began at `time`: 0 opens it, k + 1 follows the force at nodes[k].

        Works on the particles first … first + particle_count − 1. Never reads what another particle's entry is given here.
        """

    @ti.func
    def stage_and_opening(self, state: Template, total_force: Template, first, time: Template, dt: Template, opens):
        """The last stage and, where it `opens` the next step, the opening one, to the same bits as one after the other."""

    @ti.func
    def stage_after_force(self, state: Template, total_force: Template, first, time: Template, dt: Template, k):
        """Stage k ≥ 1, where k is known only when the kernel runs."""
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
        """What comes after the opening stage; where steps are joined it also `opens` the next."""
        if ti.static(shape == "serial" and self.evaluations > 1):
            # The force is by far the most there is to compile, so the kernel holds it once and loops over the stages.
            for k in range(self.evaluations):
                node = 0.0
                for c in ti.static(range(self.evaluations)):
                    if k == c:
                        node = self.nodes[c]
                if ti.static(self.wants_sum(total_force)):
                    total_force.accumulate(state, first, time + node * dt, shape)
                self.stage_after_force(state, total_force, first, time, dt, k + 1)
        else:
            for k in ti.static(range(self.evaluations)):
                if ti.static(self.wants_sum(total_force)):
                    total_force.accumulate(state, first, time + self.nodes[k] * dt, shape)
                if ti.static(joins and k == self.evaluations - 1):
                    self.stage_and_opening(state, total_force, first, time, dt, opens)
                else:
                    self.stage(state, total_force, first, time, dt, k + 1)
