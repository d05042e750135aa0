"""Force sum: the accelerations of all particles as a plan sums them, outside the kernel of a step."""

from abc import ABC, abstractmethod
from collections.abc import Callable
from contextlib import AbstractContextManager

import taichi as ti

from mpp_taichi.device.fast_taichi.serial_loops import SerialLoops
from mpp_taichi.device.heavy_loops import is_heavy
from mpp_taichi.forces._total_force import TotalForce
from mpp_taichi.state.state import State
from mpp_taichi.types import Template


class ForceSum(ABC):
    """Accelerations by the forces that do not depend on velocity; `state.acceleration` receives them."""

    @abstractmethod
    def add_up(self, force: TotalForce, time: float) -> None:
        """Sum a force for all particles of all replicas."""

    @abstractmethod
    def parallel_loops(self) -> int | None:
        """Parallel loops that one sum of all forces starts; None where the number is not known beforehand."""


@ti.data_oriented
class SerialForceSum(ForceSum):
    """One thread for each replica: the sum of the plans serial and replicas."""

    def __init__(self, state: State, *, grain: int, compiled: Callable[[], AbstractContextManager]) -> None:
        """`grain`: iterations of a parallel loop for each heavy one; `compiled`: how the kernel is compiled."""
        self.state, self.grain, self.compiled = state, grain, compiled

    def add_up(self, force: TotalForce, time: float) -> None:
        """Sum a force for all particles of all replicas."""
        with self.compiled():
            self._accumulate(force, time)

    def parallel_loops(self) -> int | None:
        """No loops of a step: the thread of the step itself sums."""
        return 0

    @ti.kernel
    def _accumulate(self, total_force: Template, time: float):
        if ti.static(self.state.replica_count == 1):
            ti.loop_config(serialize=True)  # no other thread is woken
            for _ in range(1):
                total_force.accumulate(self.state, 0, time, "serial")
        else:
            for q in range(self.state.replica_count * self.grain):
                if is_heavy(q, self.grain):
                    replica = q // self.grain
                    total_force.at_replica(replica)
                    first = replica * self.state.particle_count
                    total_force.accumulate(self.state, first, time, "serial")


@ti.data_oriented
class ParallelForceSum(ForceSum):
    """All particles at once, in one kernel: the sum of the plan parallel."""

    def __init__(self, state: State, total_force: TotalForce) -> None:
        """Bind the state; `total_force` are all forces of the step."""
        self.state, self.total_force = state, total_force

    def add_up(self, force: TotalForce, time: float) -> None:
        """Sum a force for all particles."""
        self._accumulate(force, time)

    def parallel_loops(self) -> int | None:
        """One loop, and the loops over pairs, or the loop over slices, which there are without pairs only."""
        if not self.total_force.has_pairs:
            return 1 + self.total_force.slice_loops(False)
        return 1 + self.total_force.pair_loops(self.state) + self.state.has_fixed_axes

    @ti.kernel
    def _accumulate(self, total_force: Template, time: float):
        total_force.accumulate(self.state, 0, time, "parallel")


@ti.data_oriented
class LaunchedForceSum(ForceSum):
    """All particles at once, the sum over pairs in launches of its own.

    The pair sum of the CPU is compiled in a mode of its own, and a tree is many kernels: neither fits into the kernel of a
    step.
    """

    def __init__(self, state: State, total_force: TotalForce, loops: AbstractContextManager) -> None:
        """`loops`: how loops over particles are run, `SerialLoops` where there are few particles."""
        self.state, self.total_force, self.loops = state, total_force, loops
        self.plain = ParallelForceSum(state, total_force)
        self.pairs_alone = total_force.is_symmetric_alone(state)

    def add_up(self, force: TotalForce, time: float) -> None:
        """Sum a force for all particles."""
        if not force.has_pairs:
            self.plain.add_up(force, time)
            return
        if self.pairs_alone and force is self.total_force:
            force.pair_sum.set_accelerations(self.state)
        else:
            with self.loops:
                self._begin_sum(force, time)
            force.pair_sum.add_accelerations(self.state)
        if self.state.has_fixed_axes:
            with self.loops:
                self._end_sum(force)

    def parallel_loops(self) -> int | None:
        """The loops over pairs, and the loops over particles that do not run on the calling thread; unknown for a tree."""
        if self.total_force.by_tree:
            return None
        few = isinstance(self.loops, SerialLoops)
        begins = 0 if self.pairs_alone or few else 1
        return begins + self.total_force.pair_loops(self.state) + (self.state.has_fixed_axes and not few)

    @ti.kernel
    def _begin_sum(self, total_force: Template, time: float):
        total_force.begin_sum(self.state, 0, time)

    @ti.kernel
    def _end_sum(self, total_force: Template):
        total_force.end_sum(self.state, 0)
