"""Start search: the reference values of a quantity where spheres touch, from runs whose starts differ by rounding.

Event-driven flight gives the reference, or else the scene's own solver with halved steps. Collisions enlarge rounding errors:
where the values of two runs differ, they are random numbers, and the mean of RUNS runs counts, with Student's t times its
standard error as its bar. The difference from the two coarser numbers of steps is added to the bar, since the steps leave
errors of first order.
"""

import math

import numpy as np

from mpp_taichi.accuracy.contact_methods import exact_solvers
from mpp_taichi.accuracy.machine import Machine
from mpp_taichi.accuracy.measuring import means
from mpp_taichi.accuracy.reference import FALLING, FLOOR
from mpp_taichi.accuracy.sample import Configuration
from mpp_taichi.accuracy.value_desk import PATIENCE, ValueDesk
from mpp_taichi.accuracy.value_reference import EPSILON, STUDENT, scales_of
from mpp_taichi.accuracy.workbench import Workbench

RUNS = 6  # of a quantity that scatters
SCATTERS = 1e-9  # the least difference, over the value, of runs from shifted starts whose mean is taken
OF_AIM = 0.005  # the same, of an aim
FIRST_PART = 0.25  # of the scene's own number of steps
MOST_LEVELS = 12


class StartSearch:
    """Finds the reference of a scene with contacts, which lies on the desk."""

    def __init__(self, desk: ValueDesk) -> None:
        """Begin without a run."""
        self.desk = desk
        self._levels: list[tuple[np.ndarray, np.ndarray]] = []  # values and scatters, coarse to fine
        self._steps = max(1, round(FIRST_PART * desk.problem.own_steps))

    def find(self, bench: Workbench, share: float) -> None:
        """By event-driven flight, or by the scene's own solver, until the share of the budget is spent."""
        desk = self.desk
        exact = next((name for name in exact_solvers() if name in desk.methods), None)
        machine = None if exact is None or self._levels else desk.machine_of(bench, exact)
        if machine is not None and self._fly(machine, bench):
            return
        machine = desk.machine_of(bench, desk.own.name)
        while machine is not None and desk.undefined < PATIENCE and len(self._levels) < MOST_LEVELS:
            expected = 2.0 * desk.wanted.runs * self._steps * machine.budget_per_step
            if len(self._levels) > 1 and expected > desk.budget.left(share):
                return
            desk.budget.check()
            if self._is_known_by(machine, bench):
                return

    def _is_known_by(self, machine: Machine, bench: Workbench) -> bool:
        """Whether one more level, of twice the steps, makes the values known well enough."""
        desk, configuration = self.desk, machine.configuration(self._steps)
        if not self._levels:
            self._decide_runs(machine, bench, configuration)
        sample = desk.sampled(machine, configuration)
        self._steps = 2 * self._steps + 1  # steps that are halved exactly meet a contact at the same place of a step
        if not sample.values:
            return False
        values, scatter, _ = means(sample.values)
        self._levels.append((values, scatter))
        if len(self._levels) < 2:
            return False
        mean_bar = STUDENT * scatter / math.sqrt(desk.wanted.runs)
        table = np.array([each for each, _ in self._levels])
        differences = np.abs(np.diff(table, axis=0))
        apart = np.max(np.abs(table[-3:-1] - values), axis=0)  # of two levels, as one of them may agree by chance
        bars = apart + mean_bar + EPSILON * np.abs(values)
        scales = scales_of(desk.wanted, values, bars)
        found = [float(np.max(row)) for row in differences / scales]
        within = desk.wanted.runs > 1 and bool(np.all(differences[-1] <= math.sqrt(2.0) * mean_bar))
        falls = len(found) > 1 and (found[-2] >= FALLING * found[-1] or max(found[-2:]) < FLOOR)
        steps = configuration.steps
        desk.take(machine, values, bars, desk.problem.samples, found, steps=steps, sure=within or falls, scatters=scatter)
        return within or (falls and desk.is_enough)

    def _fly(self, machine: Machine, bench: Workbench) -> bool:
        """By flight; False where it breaks off."""
        desk = self.desk
        if not self._decide_runs(machine, bench, machine.configuration(desk.problem.samples)):
            return False
        sample = desk.sampled(machine, machine.configuration(desk.problem.samples))
        if not sample.values:
            return False
        values, scatter, _ = means(sample.values)
        bars = STUDENT * scatter / math.sqrt(desk.wanted.runs)
        if desk.wanted.runs == 1:
            beside = [machine.measure(sample.configuration, desk.budget, number=number).values for number in (1, 2)]
            if any(each is None for each in beside):
                return False
            bars = np.max(np.abs(np.array(beside) - values), axis=0)
        bars = bars + EPSILON * np.abs(values)
        desk.take(machine, values, bars, desk.problem.samples, [], sure=True, scatters=scatter)
        return True

    def _decide_runs(self, machine: Machine, bench: Workbench, configuration: Configuration) -> bool:
        """Find out by two runs whether the quantity scatters; False where one of them has no value."""
        desk = self.desk
        one, other = (machine.measure(configuration, desk.budget, number=number) for number in (0, 1))
        if one.values is None or other.values is None:
            desk.reason = one.reason or other.reason
            return False
        values = np.array(one.values)
        apart = np.abs(values - np.array(other.values))
        largest = float(np.max(apart / scales_of(desk.wanted, values, np.zeros(len(values)))))
        if largest > max(SCATTERS, OF_AIM * (desk.aim or 0.0)):
            desk.change(bench, runs=RUNS)
            desk.tell(f"{desk.wanted.name} differs by {largest:.0e} where rounding differs: every setting is run {RUNS} times")
        return True
