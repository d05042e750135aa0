"""Collisions: whether they leave the positions at the end of a scene with contacts a meaning."""

from mpp_taichi.accuracy import flight_reference
from mpp_taichi.accuracy.budget import Budget, OutOfTime
from mpp_taichi.accuracy.contact_methods import exact_solvers
from mpp_taichi.accuracy.machine import Machine
from mpp_taichi.accuracy.measuring import shifted_start
from mpp_taichi.accuracy.methods import methods
from mpp_taichi.accuracy.problem import Problem
from mpp_taichi.accuracy.reference import MEANING, distance, lost_at, size_of
from mpp_taichi.accuracy.reference_machines import DEVICE
from mpp_taichi.accuracy.workbench import Workbench
from mpp_taichi.errors import BackendError, MppError

FEWEST_COLLISIONS = 10  # in a run: fewer collisions make no gas, and what rounding decides is where they happen at one instant


def meaning_ends(problem: Problem, budget: Budget) -> float | None:
    """Time before the end at which positions were found to lose their meaning [time], by collisions that enlarge rounding.

    By event-driven flight, else by the scene's own solver with its own step, from starts that differ by rounding. None where
    positions keep their meaning, where there are few collisions, or where the budget ends or the runs break off first.
    """
    if not problem.has_contacts or problem.spec.timeline:
        return None
    known = methods(problem)
    exact = [name for name in exact_solvers() if name in known]
    with Workbench(problem, backend=DEVICE[0], precision=DEVICE[1]) as bench:
        for name in dict.fromkeys((*exact, problem.own_method)):
            try:
                machine = bench.machine(name)
                found = _by_flight(machine, budget) if name in exact else _by_own_steps(machine, problem, budget)
            except OutOfTime:
                return None
            except BackendError:
                raise
            except MppError:
                continue
            if found is not None:
                return None if found < 0.0 else found
    return None


NEVER = -1.0


def _by_flight(machine: Machine, budget: Budget) -> float | None:
    """The time, NEVER where positions keep their meaning; None where the flight breaks off."""
    found = flight_reference.fly(machine, budget)
    if found is None:
        return None
    reference, sample = found
    few = sample.evaluations < FEWEST_COLLISIONS
    return NEVER if reference.trusted or few or reference.meaning is None else reference.meaning


def _by_own_steps(machine: Machine, problem: Problem, budget: Budget) -> float | None:
    """The time, NEVER where positions keep their meaning; None where a run breaks off."""
    configuration = machine.configuration(problem.own_steps)
    runs = [machine.run(configuration, budget, follow=True, start=shifted_start(problem, k, DEVICE[1])) for k in (0, 1)]
    (one, first), (other, second) = runs
    if one.end is None or other.end is None or first is None or second is None:
        return None
    size = size_of(first) or 1.0
    lost = lost_at(first, second, size)
    return NEVER if distance(one.end, other.end, size)[0] < MEANING or lost is None else lost
