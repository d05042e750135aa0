"""Collisions: whether they leave the positions at the end of a scene with contacts a meaning.

They enlarge errors of rounding, and in a heap the errors of the steps: where two halvings of the step give two other heaps, no
step that can be paid for gives the positions.
"""

import math

from mpp_taichi.accuracy import flight_reference
from mpp_taichi.accuracy.budget import Budget, OutOfTime
from mpp_taichi.accuracy.contact_methods import exact_solvers
from mpp_taichi.accuracy.machine import Machine
from mpp_taichi.accuracy.measuring import shifted_start
from mpp_taichi.accuracy.methods import methods
from mpp_taichi.accuracy.problem import Problem
from mpp_taichi.accuracy.reference import FALLING, MEANING, distance, lost_at, size_of
from mpp_taichi.accuracy.reference_machines import DEVICE
from mpp_taichi.accuracy.stretches import LOOKS
from mpp_taichi.accuracy.workbench import Workbench
from mpp_taichi.errors import BackendError, MppError

STEPS_SHARE = 0.1  # of the budget, for three runs with halved steps
COARSEST_PART = 0.25  # of the scene's own number of steps: coarser steps tell nothing of the scene's own
FEWEST_COLLISIONS = 10  # in a run: fewer collisions make no gas, and what rounding decides is where they happen at one instant


def meaning_ends(problem: Problem, budget: Budget) -> float | None:
    """Time before the end at which positions were found to lose their meaning [time], by collisions that enlarge rounding.

    By event-driven flight, else by the scene's own solver with its own step, from starts that differ by rounding, and then with
    halved steps. None where positions keep their meaning, where there are few collisions, or where the budget ends or the runs
    break off first.
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
    configuration, began = machine.configuration(problem.own_steps), budget.spent
    runs = [machine.run(configuration, budget, follow=True, start=shifted_start(problem, k, DEVICE[1])) for k in (0, 1)]
    (one, first), (other, second) = runs
    if one.end is None or other.end is None or first is None or second is None:
        return None
    size = size_of(first) or 1.0
    lost = lost_at(first, second, size)
    if distance(one.end, other.end, size)[0] < MEANING or lost is None:
        return _by_halved_steps(machine, problem, budget, (budget.spent - began) / 2.0)
    return lost


def _by_halved_steps(machine: Machine, problem: Problem, budget: Budget, seconds: float) -> float | None:
    """The time at which the two finest of three runs with halved steps part, if finer steps do not bring them together.

    A run with the scene's own steps takes so many `seconds` of the budget.

    NEVER where they do, or where three runs would take more than STEPS_SHARE of the budget; None where a run breaks off.
    """
    own = problem.own_steps
    part = min(1.0, STEPS_SHARE * budget.seconds / (7.0 * max(seconds, 1e-9)))
    if part < COARSEST_PART:
        return NEVER
    steps = round(part * own)
    odd = [LOOKS * (math.ceil(part * steps / LOOKS) | 1) for part in (1, 2, 4)]  # no run has its ends of steps in common
    runs = [machine.run(machine.configuration(each), budget, follow=True) for each in odd]
    ends = [sample.end for sample, _ in runs if sample.end is not None]
    paths = [trace for _, trace in runs if trace is not None]
    if len(ends) < len(odd) or len(paths) < len(odd):
        return None
    size = size_of(paths[2]) or 1.0
    coarse, fine = (distance(ends[k], ends[k + 1], size)[0] for k in (0, 1))
    lost = lost_at(paths[1], paths[2], size)
    return NEVER if fine < MEANING or FALLING * fine < coarse or lost is None else lost
