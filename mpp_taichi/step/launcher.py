"""Launcher: one kind of step, as kernels that are launched. Each kind is one file of this folder, chosen in `choose.py`.

A new kind of step is one new file here. It holds a class named after the file (`own_state.py` holds `OwnState`) that extends
`Launcher` and provides

    launch             the steps first … last − 1 of a run; only this member is required
    begin              where a first step needs something else than the integrator's own preparation
    set_up             where the launcher keeps something that follows from its parts
    launches_per_step  the number of parallel loops of a step, where it is known
    launch_metered     where the powers of an energy balance can be measured inside the kernel of the steps
    look_ahead         where the motion goes on between two steps in another way than x + v t (set `moves_between_steps` too)

The family of integrators that it runs names the file in its `launchers` (see integrators/_launchers.py), and a contact solver
in its `launched_by`. No other file changes: other files use a step only through the class below.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass
from typing import Any

import numpy as np

from mpp_taichi.arithmetic.low_parts import step_parts
from mpp_taichi.contacts._base import ContactSolver
from mpp_taichi.forces._total_force import TotalForce
from mpp_taichi.integrators._base import Integrator
from mpp_taichi.integrators._trouble import Trouble
from mpp_taichi.solvers.report import SolverReport
from mpp_taichi.state.state import State
from mpp_taichi.state.tangent_meter import TangentMeter
from mpp_taichi.step.finite_check import FiniteCheck
from mpp_taichi.step.force_sum import ForceSum

Mode = Callable[[], AbstractContextManager]


@dataclass(frozen=True, eq=False)
class StepParts:
    """All that a launcher is made of.

    force_sum  the accelerations as the plan sums them
    compiled   how the kernels of whole steps are compiled: with explicit vectors, quickly, or in Taichi's own way
    quickly    how a kernel is compiled that explicit vectors do not suit: quickly, or in Taichi's own way
    loops      how short loops over particles are run: on the calling thread where there are few particles
    finite     the search for a particle that is not finite
    grain      iterations of a parallel loop for each heavy iteration
    on_cpu     whether the device is a CPU
    shape      of the sum of forces inside a kernel: "serial", "parallel", or "launched" where it is no part of the kernel
    loop_limit   iterations that one thread of the device may make in a launch; None: any number
    tangent_meter   meter of the growth of a deviation; None where no quantity asks for it
    """

    state: State
    total_force: TotalForce
    integrator: Integrator
    contacts: ContactSolver | None
    force_sum: ForceSum
    finite: FiniteCheck
    compiled: Mode
    quickly: Mode
    loops: AbstractContextManager
    grain: int
    shape: str
    on_cpu: bool
    loop_limit: int | None = None
    tangent_meter: TangentMeter | None = None


class Launcher(ABC):
    """The steps of one integrator, with its forces and contacts, under one plan; kernels are compiled when first launched.

    `prepare` once after the state was set from outside, then `advance` any number of times. After a launch `collect` gives the
    counts of the solver, then `trouble` says whether the run can go on.
    """

    takes_steps = True
    """Whether a run consists of steps of dt, or dt is only the time between two samples of a free flight."""
    contacts_in_every_step = True
    """Whether every step looks for contacts, where the scene has any."""
    moves_between_steps = False
    """Whether `look_ahead` shows more than x + v t."""
    _numbers_of: float | None = None  # the dt whose step numbers the state has

    def __init__(self, parts: StepParts) -> None:
        """Bind the parts; nothing is compiled before the first launch."""
        self.parts = parts
        self.state: Any = parts.state  # its work fields have the names that a method gives them
        self.total_force = parts.total_force
        self.integrator: Any = parts.integrator  # each kind of step asks for methods of its own family
        self.contacts: Any = parts.contacts
        self.force_sum, self.compiled, self.loops = parts.force_sum, parts.compiled, parts.loops
        self.grain, self.shape = parts.grain, parts.shape
        self._carries_low = parts.state.carries_low
        self.used = parts.state.replica_count
        self.set_up()

    def set_up(self) -> None:  # noqa: B027 — most kinds of step have nothing to do here
        """Keep the values that follow from the parts."""

    def use(self, count: int) -> None:
        """Advance only the first `count` replicas from now on, where this kind of step can; the others are spare places."""
        self.used = count

    def destroy(self) -> None:  # noqa: B027 — most have no memory beside the state
        """Free the memory of the launcher."""

    def prepare(self, time: float, dt: float) -> None:
        """Set everything that the first step expects to find, after the state was set from outside; `dt` is the run's step."""
        self.integrator.adopt(self.state, dt)
        self.integrator.arrange(self.state)
        self.total_force.settle(self.state, time)
        self.begin(time, dt)
        if self.contacts is not None:
            self.contacts.prepare(time)

    def begin(self, time: float, dt: float) -> None:
        """The method's own part of `prepare`: most often the force that a step expects the step before to have left."""
        self.integrator.prepare(self.state, self.total_force, time, self.force_sum.add_up)

    def advance(self, time: float, dt: float, first: int, last: int) -> None:
        """Take the steps first … last − 1 of length `dt`, where step s begins at time + s dt.

        The begin of a step is computed from its number, so that a force that depends on time gives the same bits however the
        steps of a run are divided into launches.
        """
        self._begin_launch(dt)
        self.launch(time, dt, first, last)
        self.state.pass_time(last - first, dt)

    def advance_metered(self, time: float, dt: float, first: int, last: int, meter: Any) -> None:
        """`advance`, and a meter of powers measures after every step."""
        self._begin_launch(dt)
        self.launch_metered(time, dt, first, last, meter)
        self.state.pass_time(last - first, dt)

    def _begin_launch(self, dt: float) -> None:
        self.integrator.set_step(self.state, dt)
        if self._carries_low and dt != self._numbers_of:
            self._write_step_numbers(dt)
        if self.total_force.has_rods:
            self.total_force.rods.begin_launch(self.state)

    @abstractmethod
    def launch(self, time: float, dt: float, first: int, last: int) -> None:
        """The kernels of the steps first … last − 1."""

    def launch_metered(self, time: float, dt: float, first: int, last: int, meter: Any) -> None:
        """`launch`, step by step, and after each step the kernel of the meter."""
        measure_between(self, time, dt, first, last, meter)

    def look_ahead(self, dt: float, share: float) -> None:
        """Show the positions and velocities a `share` of a step later, where the launcher `moves_between_steps`."""
        raise TypeError(f"{type(self).__name__} does not move between steps")

    # Cost of a step

    def launches_per_step(self) -> int | None:
        """Parallel loops started in one step: 0 where a launch holds many steps, None where the number is not known."""
        return 0

    def loop_iterations_per_step(self) -> int:
        """Loop iterations of one thread in one step of a serial or replica kernel, an upper bound."""
        return 1 + max(1, self.integrator.evaluations) * self.loop_iterations_per_evaluation()

    def loop_iterations_per_evaluation(self) -> int:
        """Loop iterations of one thread in a sum of the forces of one copy, an upper bound."""
        n, state = self.state.particle_count, self.state
        springs = state.spring_neighbor.shape[0] if "spring_neighbor" in state.quantities else 0
        per_evaluation = (n * n if self.total_force.has_pairs else 0) + springs + 8 * n
        if self.total_force.has_rods:
            per_evaluation += self.total_force.rods.loop_iterations()
        return per_evaluation

    def facts(self) -> dict[str, Any]:
        """The entries of reports about this kind of step, and about its work since it was prepared."""
        return {
            "force_evaluations_per_step": self.integrator.evaluations_per_step,
            "launches_per_step": self.launches_per_step(),
            **self.integrator.facts(self.state),
        }

    def collect(self) -> SolverReport | None:
        """The counts of the solver of implicit steps since the last call; None where no equations are solved."""
        return self.integrator.collect(self.state)

    def trouble(self) -> Trouble | None:
        """Why the run cannot go on, or None; to be asked after `collect`. Waits for the device."""
        rods = self._trouble_of_rods() if self.total_force.has_rods else None
        return rods or self.integrator.trouble(self.state, self.parts.finite.first_bad_particle())

    def _trouble_of_rods(self) -> Trouble | None:
        """The first rod whose length was not kept."""
        found = self.total_force.rods.failure(self.state)
        if found is None:
            return None
        drifts, row, singular = found
        band = self.total_force.rods.band
        steps = drifts // self.integrator.drifts_along_rods()
        return Trouble("bent", int(band.first[row]), steps=steps, other=int(band.second[row]), singular=singular)

    def clear_trouble(self) -> None:
        """Forget earlier trouble: the state is again as it was before."""
        self.integrator.clear_trouble(self.state)

    def first_bad_particle(self) -> int:
        """Index of the first particle whose position or velocity is not finite, or −1. Waits for the device."""
        return self.parts.finite.first_bad_particle()

    def _write_step_numbers(self, dt: float) -> None:
        """Products of dt and coefficients of the method with more digits than the run's precision has (see low_parts.py)."""
        numbers = step_parts(self.integrator.step_numbers(dt))
        self.state.step_parts.from_numpy(np.tile(numbers, (self.state.replica_count, 1)))
        self._numbers_of = dt


def measure_between(launcher: Launcher, time: float, dt: float, first: int, last: int, meter: Any) -> None:
    """Launch the steps first … last − 1 one by one, and measure after each of them."""
    for s in range(first, last):
        launcher.launch(time, dt, s, s + 1)
        meter.keep(s - first, time + (s + 1) * dt)
