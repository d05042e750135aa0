"""Value search: the reference values of a wanted quantity, by the ways in which a reference of positions is found.

Where bodies may meet closely, an adaptive method runs with three tolerances; else the steps of the most promising method are
halved until the values agree. Where spheres touch, see `start_search`.

Reference runs sample FINER times as often as the run verb does. The change of the value with half of these samples is a
part of its bar.
"""

import contextlib
import itertools
import math
from collections.abc import Callable

import numpy as np

from mpp_taichi.accuracy import adaptive_reference
from mpp_taichi.accuracy.budget import Budget, OutOfTime
from mpp_taichi.accuracy.families import meets
from mpp_taichi.accuracy.machine import Machine
from mpp_taichi.accuracy.methods import StudyMethod, first_steps, for_reference
from mpp_taichi.accuracy.problem import Problem
from mpp_taichi.accuracy.reference_machines import MOST_BUDGETS, SHARE
from mpp_taichi.accuracy.start_search import StartSearch
from mpp_taichi.accuracy.store import Store
from mpp_taichi.accuracy.value_desk import PATIENCE, ValueDesk
from mpp_taichi.accuracy.value_reference import EPSILON, ValueConvergence, scales_of
from mpp_taichi.accuracy.workbench import Workbench
from mpp_taichi.errors import MppError

FINER = (4.0, 16.0)  # times the samples of the run verb; the second where the first leaves too large a bar
MOST_SAMPLES = 2**13  # in a reference run; fewer times FINER where the quantity asks for many samples
MOST_RUNGS = 24


class ValueSearch:
    """Finds the reference values of one study; they lie on its `desk`."""

    def __init__(
        self,
        problem: Problem,
        store: Store,
        budget: Budget,
        methods: dict[str, StudyMethod],
        *,
        wished: str | None = None,
        tell: Callable[[str], None],
    ) -> None:
        """Begin without a reference; `wished` names the only method that may give it."""
        self.desk = ValueDesk(problem, store, budget, methods, tell)
        self.wished = wished
        self._halved: tuple[Machine, ValueConvergence, int] | None = None
        self._tried: set[str] = set()

    def find(self, bench: Workbench) -> None:
        """Find the reference; where its share of the budget ends first, go on for up to MOST_BUDGETS budgets.

        Raises:
            OutOfTime: they were spent, and no value is known.
        """
        desk, has_contacts = self.desk, self.desk.problem.has_contacts
        if desk.recall():
            bench.shorten(desk.problem)
            return
        search = StartSearch(desk).find if has_contacts else self._by_tolerances_or_halving
        with contextlib.suppress(OutOfTime):
            search(bench, SHARE)
        if not (desk.is_known if has_contacts else desk.suffices) and desk.undefined < PATIENCE and not desk.ended:
            share = f"{SHARE:.0%} of the budget"
            desk.tell(f"the reference needs more than {share}: up to {MOST_BUDGETS:g} budgets are spent to find it")
            with desk.budget.beyond(MOST_BUDGETS, SHARE):
                search(bench, 1.0)
        desk.budget.overrun(SHARE)

    def _by_tolerances_or_halving(self, bench: Workbench, share: float) -> None:
        desk = self.desk
        if self.wished is None and meets(desk.problem):
            self._by_tolerances(bench, quick=True)
        if not desk.is_enough:
            self._halve(bench, share)
        if not desk.is_enough and self.wished is None and desk.undefined < PATIENCE:
            self._by_tolerances(bench)

    def _by_tolerances(self, bench: Workbench, *, quick: bool = False) -> None:
        """Three runs of an adaptive method with different tolerances; the largest difference of their values is the bar."""
        desk = self.desk
        names = adaptive_reference.candidates(desk.methods)
        for name in [name for name in names if not (quick and desk.methods[name].slow_to_compile)]:
            machine = None if name in self._tried else desk.machine_of(bench, name)
            if machine is None:
                continue
            self._tried.add(name)
            tolerances = adaptive_reference.tolerances(name)
            middle = tolerances[adaptive_reference.MIDDLE]
            if not desk.sampled(machine, machine.configuration(desk.problem.samples, middle)).values:
                continue
            finer, samples, by_samples = self._sampling_of(machine, bench, middle)
            configurations = [machine.configuration(samples, tolerance) for tolerance in tolerances]
            found = [machine.measure(each, desk.budget, finer=finer).values for each in configurations]
            if by_samples is None or any(values is None for values in found):
                continue
            table = np.array(found)
            pairs = [np.abs(one - other) for one, other in itertools.combinations(table, 2)]
            values = table[adaptive_reference.MIDDLE]
            bars = np.max(pairs, axis=0) + by_samples + EPSILON * np.abs(values)
            differences = [float(np.max(pair / scales_of(desk.wanted, values, bars))) for pair in pairs]
            if self._is_better(values, bars):
                desk.take(machine, values, bars, samples, differences, tolerance=middle)
            if desk.is_enough:
                return

    def _sampling_of(self, machine: Machine, bench: Workbench, tolerance: float) -> tuple[float, int, np.ndarray | None]:
        """How many times finer an adaptive method samples, its number of samples, and the change of the values by half."""
        desk, shortest = self.desk, machine.asked_interval
        for wanted in FINER:
            finer, samples = self._sampling(bench, shortest, wanted)
            configuration = machine.configuration(samples, tolerance)
            found = [machine.measure(configuration, desk.budget, finer=part * finer).values for part in (0.5, 1.0)]
            if found[0] is None or found[1] is None:
                return finer, samples, None
            half, values = (np.array(each) for each in found)
            change = np.abs(half - values)
            if np.all(change <= desk.enough * scales_of(desk.wanted, values, change)) or finer < wanted:
                break
        return finer, samples, change

    def _sampling(self, bench: Workbench, shortest: float, finer: float) -> tuple[float, int]:
        """How many times finer a reference samples, and its number of samples; the study's number of samples is set too."""
        desk = self.desk
        asked = desk.problem.span / shortest
        while finer > 2.0 and finer * asked > MOST_SAMPLES:
            finer /= 2.0
        needed = min(max(desk.wanted.samples, 2.0 * asked), float(MOST_SAMPLES))
        desk.change(bench, samples=2 ** math.ceil(math.log2(needed)))
        return finer, 2 ** math.ceil(math.log2(max(desk.problem.samples, finer * asked)))

    def _halve(self, bench: Workbench, share: float) -> None:
        """Halve the steps until the values agree, or the share of the budget is spent."""
        desk = self.desk
        if self._halved is None:
            machine, steps = self._halved_machine(bench)
            self._halved = machine, ValueConvergence(desk.wanted, machine.order, enough=desk.enough), steps
        machine, found, steps = self._halved
        while not found.is_enough and len(found.runs) < MOST_RUNGS and desk.undefined < PATIENCE:
            if found.runs and 2.0 * steps * machine.budget_per_step > desk.budget.left(share):
                break
            desk.budget.check()
            configuration = machine.configuration(steps)
            sample = desk.sampled(machine, configuration)
            steps *= 2
            self._halved = machine, found, steps
            if not sample.values:
                continue
            finer, _ = self._sampling(bench, machine.asked_interval, FINER[0])
            fine = machine.measure(configuration, desk.budget, finer=finer).values
            if fine is not None:
                found.add(sample, np.array(fine))
        if len(found.runs) < 2:
            return
        sample, _ = found.runs[found.best]
        for finer in FINER:
            tried = [machine.measure(sample.configuration, desk.budget, finer=part * finer).values for part in (0.5, 1.0)]
            if tried[0] is None or tried[1] is None:
                return
            values, change = np.array(tried[1]), np.abs(np.array(tried[0]) - np.array(tried[1]))
            if np.all(change <= desk.enough * scales_of(desk.wanted, values, change)):
                break
        bars = found.bars() + change
        if not self._is_better(values, bars):
            return
        desk.take(
            machine,
            values,
            bars,
            desk.problem.samples,
            found.differences(),
            steps=sample.configuration.steps,
            sure=found.is_trusted,
        )

    def _is_better(self, values: np.ndarray, bars: np.ndarray) -> bool:
        """Whether these values are known better than those on the desk, and agree with them within both bars."""
        known = self.desk.reference
        if known is None or not known.trusted:
            return True
        agree = np.all(np.abs(values - np.array(known.values)) <= bars + np.array(known.bars))
        return bool(agree) and float(np.max(bars / np.array(known.scales))) < known.bar

    def _halved_machine(self, bench: Workbench) -> tuple[Machine, int]:
        """The most promising method that the scene allows, and its first number of steps."""
        desk = self.desk
        for method in [desk.methods[self.wished]] if self.wished is not None else for_reference(desk.methods):
            if (machine := desk.machine_of(bench, method.name)) is not None:
                return machine, first_steps(desk.problem, method, desk.own)
        raise MppError("no integrator of the catalogue can serve as a reference for this scene")
