"""Start search: the reference values of a quantity where spheres touch, from runs whose starts differ by rounding.

Event-driven flight gives the reference, or else the scene's own solver with halved steps. Collisions enlarge rounding errors:
where the values of two runs differ, they are random numbers, and the mean of RUNS runs counts, with Student's t times its
standard error as its bar. The difference from the two coarser numbers of steps is added to the bar, since the steps leave
errors of first order.

Where the values of halved steps do not agree, because every step gives another heap, the search begins anew with starts that
differ by HEAP_SHIFT, and the three finest numbers of steps give the mean together, see `heap_levels`.
"""

import math

import numpy as np

from mpp_taichi.accuracy.contact_methods import exact_solvers
from mpp_taichi.accuracy.heap_levels import RUNS, HeapLevels, is_lottery
from mpp_taichi.accuracy.machine import Machine
from mpp_taichi.accuracy.measuring import HEAP_SHIFT, means
from mpp_taichi.accuracy.reference import FALLING, FLOOR
from mpp_taichi.accuracy.reference_machines import SHARE
from mpp_taichi.accuracy.sample import Configuration, Sample
from mpp_taichi.accuracy.value_desk import PATIENCE, ValueDesk
from mpp_taichi.accuracy.value_reference import EPSILON, STUDENT, scales_of
from mpp_taichi.accuracy.workbench import Workbench

SCATTERS = 1e-9  # the least difference, over the value, of runs from shifted starts whose mean is taken
OF_AIM = 0.005  # the same, of an aim
FIRST_PART = 0.25  # of the scene's own number of steps
MOST_LEVELS = 12
LEVEL_SHARE = 0.1  # of the budget, for one more level of a heap whose mean is known
TRIAL_LEVEL = 3  # level at which runs from starts TRIAL_SHIFT apart tell whether a small error decides the heap
TRIAL_SHIFT, TRIAL_RUNS = 1e-6, 3
AMPLIFIED = 100.0  # times the shift: a larger change of the value, over the value, is not proportional to the shift
OF_DIFFERENCE = 0.25  # of the difference of the last two levels: so large a change shows that this difference is no error


class StartSearch:
    """Finds the reference of a scene with contacts, which lies on the desk."""

    def __init__(self, desk: ValueDesk) -> None:
        """Begin without a run."""
        self.desk = desk
        self._levels: list[tuple[np.ndarray, np.ndarray]] = []  # values and scatters, coarse to fine
        self._heaps = HeapLevels()
        self._steps = self._first = max(1, round(FIRST_PART * desk.problem.own_steps))

    def find(self, bench: Workbench, share: float) -> None:
        """By event-driven flight, or by the scene's own solver, until the share of the budget is spent."""
        desk = self.desk
        exact = next((name for name in exact_solvers() if name in desk.methods), None)
        machine = None if exact is None or self._levels or self._heaps.levels else desk.machine_of(bench, exact)
        if machine is not None and self._fly(machine, bench):
            return
        machine = desk.machine_of(bench, desk.own.name)
        while machine is not None and desk.undefined < PATIENCE and len(self._levels) < MOST_LEVELS:
            expected = 2.0 * desk.wanted.runs * self._steps * machine.budget_per_step
            if len(self._levels) > 1 and expected > desk.budget.left(share):
                return
            if self._heaps.is_pooled and self._is_too_dear(expected, share):
                return
            desk.budget.check()
            if self._is_known_by_heaps(machine) if desk.wanted.shift else self._is_known_by(machine, bench):
                return

    def _is_too_dear(self, expected: float, share: float) -> bool:
        """Whether a further level of a heap takes too long [s].

        The bar of a known mean holds what finer steps would change: beyond its share of the budget only short levels follow.
        """
        desk = self.desk
        if not desk.is_known:
            return expected > desk.budget.left(share)
        return desk.budget.spent + expected > SHARE * desk.budget.seconds and expected > LEVEL_SHARE * desk.budget.seconds

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
        within = desk.wanted.runs > 1 and len(found) > 1 and bool(np.all(differences[-2:] <= math.sqrt(2.0) * mean_bar))
        falls = len(found) > 1 and (found[-2] >= FALLING * found[-1] or max(found[-2:]) < FLOOR)
        steps = configuration.steps
        desk.take(machine, values, bars, desk.problem.samples, found, steps=steps, sure=within or falls, scatters=scatter)
        if not within and (
            is_lottery(found, FALLING, SCATTERS) or self._shows_heaps(machine, bench, sample, scales, found[-1])
        ):
            self._begin_heaps(bench)
            return False
        return within or (falls and desk.is_enough)

    def _shows_heaps(self, machine: Machine, bench: Workbench, sample: Sample, scales: np.ndarray, last: float) -> bool:
        """Whether a small shift of the start changes the values as much as the steps do; `last` is their last difference."""
        desk = self.desk
        if len(self._levels) != TRIAL_LEVEL:
            return False
        desk.change(bench, shift=TRIAL_SHIFT)
        runs = [machine.measure(sample.configuration, desk.budget, number=number).values for number in range(TRIAL_RUNS)]
        desk.change(bench, shift=0.0)
        apart = [float(np.max(np.abs(np.array(each) - sample.values[0]) / scales)) for each in runs if each is not None]
        return max(apart, default=0.0) > max(AMPLIFIED * TRIAL_SHIFT, OF_DIFFERENCE * last)

    def _begin_heaps(self, bench: Workbench) -> None:
        """Begin anew, with starts that differ by more than rounding."""
        desk = self.desk
        self._levels, self._steps, desk.reference = [], self._first, None
        desk.store.forget()
        desk.store.notes.pop("values", None)
        desk.change(bench, runs=RUNS, shift=HEAP_SHIFT)
        desk.tell(
            f"{desk.wanted.name} is another with every step: the mean of {RUNS} runs from starts {HEAP_SHIFT:g} apart counts"
        )

    def _is_known_by_heaps(self, machine: Machine) -> bool:
        """The same as `_is_known_by`, where every step gives another heap."""
        desk, heaps, steps = self.desk, self._heaps, self._steps
        sample = desk.sampled(machine, machine.configuration(steps))
        self._steps = 2 * steps + 1
        if not sample.values:
            return False
        heaps.add(np.array(sample.values))
        if not heaps.is_pooled:
            return False
        values, bars = heaps.mean, heaps.bars
        bars = bars + EPSILON * np.abs(values)
        sure = bool(np.all((bars < np.abs(values)) | (bars == 0.0)))
        differences = np.abs(np.diff(heaps.means, axis=0)) / scales_of(desk.wanted, values, bars)
        found = [float(np.max(row)) for row in differences]
        desk.take(machine, values, bars, desk.problem.samples, found, steps=steps, sure=sure, scatters=heaps.scatter)
        assert desk.reference is not None
        desk.reason = "" if sure else f"its mean is no larger than the bar of the mean: {desk.reference.told}"
        desk.ended = heaps.agree
        return desk.ended

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
