"""Value search: the reference values of a wanted quantity, by the ways in which a reference of positions is found.

Where bodies may meet closely, an adaptive method runs with three tolerances; else the steps of the most promising method are
halved until the values agree. Where spheres touch, event-driven flight, or else the scene's own solver with halved steps, runs
from starts that differ by rounding. Where the values of these runs differ, they are random numbers, and their mean counts.

Reference runs sample FINER times as often as the run verb does. The change of the value with half of these samples is a
part of its bar.
"""

import contextlib
import itertools
import logging
import math
from collections.abc import Callable

import numpy as np

from mpp_taichi.accuracy import adaptive_reference
from mpp_taichi.accuracy.budget import Budget, OutOfTime
from mpp_taichi.accuracy.contact_methods import exact_solvers
from mpp_taichi.accuracy.families import meets
from mpp_taichi.accuracy.methods import StudyMethod, first_steps, for_reference
from mpp_taichi.accuracy.problem import Problem
from mpp_taichi.accuracy.sample import Configuration, Sample
from mpp_taichi.accuracy.store import Store
from mpp_taichi.accuracy.sweep import timed
from mpp_taichi.accuracy.value_reference import EPSILON, MEANING, STUDENT, ValueConvergence, ValueReference, scales_of
from mpp_taichi.accuracy.wanted import Wanted, means, with_runs
from mpp_taichi.accuracy.workbench import Machine, Workbench
from mpp_taichi.errors import BackendError, MppError

log = logging.getLogger(__name__)

DEVICE = ("cpu", "f64")
SHARE = 0.3  # of the budget
MOST_BUDGETS = 4.0
FINER = (4.0, 16.0)  # times the samples of the run verb: the first, and the second where the first does not reach the bar wanted
MOST_SAMPLES = 2**13  # in a reference run; fewer times FINER where the quantity asks for many samples
WELL_KNOWN = 1e-13  # a bar below which no better reference is tried
WITHIN_AIM = 0.05  # of an aim: no better reference is tried below this bar
RUNS = 6  # of a quantity that scatters
SCATTERS = 1e-9  # the least difference, over the value, of runs from shifted starts whose mean is taken
PATIENCE = 3  # runs without a value, each with half of the steps, after which the quantity counts as undefined
MOST_RUNGS = 24


class ValueSearch:
    """Finds the reference values of one study.

    aim        the only error of interest, or None
    problem    the problem with the number of runs and of samples that the quantity needs
    reference  None until it is found
    reason     why there is no value, where a run said so
    """

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
        assert problem.wanted is not None
        self.problem, self.store, self.budget, self.methods = problem, store, budget, methods
        self.wished, self.tell = wished, tell
        self._own = methods[problem.own_method]
        self.aim: float | None = None
        self.reference: ValueReference | None = None
        self.reason = ""
        self.conserves_energy = False
        self._halved: tuple[Machine, ValueConvergence, int] | None = None
        self._undefined = 0

    @property
    def wanted(self) -> Wanted:
        """The quantity."""
        assert self.problem.wanted is not None
        return self.problem.wanted

    @property
    def is_known(self) -> bool:
        """Whether errors can be told."""
        return self.reference is not None and self.reference.trusted

    def find(self, bench: Workbench) -> None:
        """Find the reference; where its share of the budget ends first, go on for up to MOST_BUDGETS budgets.

        Raises:
            OutOfTime: they were spent, and no value is known.
        """
        if self._recall():
            bench.shorten(self.problem)
            return
        search = self._by_tolerances_or_halving if self.problem.spec.contacts is None else self._by_starts
        with contextlib.suppress(OutOfTime):
            search(bench, SHARE)
        if not self._suffices and self._undefined < PATIENCE:
            self.tell(f"the reference needs more than {SHARE:.0%} of the budget: up to {MOST_BUDGETS:g} budgets are spent to find it")
            with self.budget.beyond(MOST_BUDGETS, SHARE):
                search(bench, 1.0)
        self.budget.overrun(SHARE)

    def _recall(self) -> bool:
        known = self.store.notes.get("values")
        if known is None:
            return False
        self.reference = ValueReference(**known)
        self.problem = with_runs(self.problem, runs=self.reference.runs, samples=self.reference.samples)
        return self.is_known

    # Scenes without contacts

    def _by_tolerances_or_halving(self, bench: Workbench, share: float) -> None:
        if self.wished is None and meets(self.problem):
            self._by_tolerances(bench, quick=True)
        if not self._is_enough:
            self._halve(bench, share)
        if not self._is_enough and self.wished is None and self._undefined < PATIENCE:
            self._by_tolerances(bench)

    @property
    def _enough(self) -> float:
        return WELL_KNOWN if self.aim is None else WITHIN_AIM * self.aim

    @property
    def _suffices(self) -> bool:
        """Whether the reference is good enough for the aim, though perhaps not as good as it might be."""
        return self.reference is not None and self.is_known and (self.aim is None or 2.0 * self.reference.bar <= self.aim)

    @property
    def _is_enough(self) -> bool:
        return self.reference is not None and self.reference.trusted and self.reference.bar <= self._enough

    def _by_tolerances(self, bench: Workbench, *, quick: bool = False) -> None:
        """Three runs of an adaptive method with different tolerances; the largest difference of their values is the bar."""
        names = adaptive_reference.candidates(self.methods)
        for name in [name for name in names if not (quick and self.methods[name].slow_to_compile)]:
            machine = self._machine(bench, name)
            if machine is None:
                continue
            tolerances = adaptive_reference.tolerances(name)
            middle = tolerances[adaptive_reference.MIDDLE]
            first = self._run(machine, machine.configuration(self.problem.samples, middle))
            if first is None:
                continue
            finer, samples, by_samples = self._sampling_of(machine, bench, middle, first)
            configurations = [machine.configuration(samples, tolerance) for tolerance in tolerances]
            found = [machine.measure(each, self.budget, finer=finer).values for each in configurations]
            if by_samples is None or any(values is None for values in found):
                continue
            table = np.array(found)
            pairs = [np.abs(one - other) for one, other in itertools.combinations(table, 2)]
            values = table[adaptive_reference.MIDDLE]
            bars = np.max(pairs, axis=0) + by_samples + EPSILON * np.abs(values)
            differences = [float(np.max(pair / scales_of(self.wanted, values, bars))) for pair in pairs]
            self._take(machine, values, bars, samples, differences, tolerance=middle)
            if self._is_enough:
                return

    def _sampling_of(
        self, machine: Machine, bench: Workbench, tolerance: float, shortest: float
    ) -> tuple[float, int, np.ndarray | None]:
        """How many times finer an adaptive method samples, its number of samples, and the change of the values by half of them."""
        for wanted in FINER:
            finer, samples = self._sampling(bench, shortest, wanted)
            configuration = machine.configuration(samples, tolerance)
            found = [machine.measure(configuration, self.budget, finer=part * finer).values for part in (0.5, 1.0)]
            if found[0] is None or found[1] is None:
                return finer, samples, None
            half, values = (np.array(each) for each in found)
            change = np.abs(half - values)
            if np.all(change <= self._enough * scales_of(self.wanted, values, change)) or finer < wanted:
                break
        return finer, samples, change

    def _sampling(self, bench: Workbench, shortest: float, finer: float) -> tuple[float, int]:
        """How many times finer a reference samples, and its number of samples; the study's number of samples is set too."""
        asked = self.problem.span / shortest
        while finer > 2.0 and finer * asked > MOST_SAMPLES:
            finer /= 2.0
        needed = min(max(self.wanted.samples, 2.0 * asked), float(MOST_SAMPLES))
        self._change(bench, samples=2 ** math.ceil(math.log2(needed)))
        return finer, 2 ** math.ceil(math.log2(max(self.problem.samples, finer * asked)))

    def _halve(self, bench: Workbench, share: float) -> None:
        """Halve the steps until the values agree, or the share of the budget is spent."""
        if self._halved is None:
            machine, steps = self._halved_machine(bench)
            self._halved = machine, ValueConvergence(self.wanted, machine.order, enough=self._enough), steps
        machine, found, steps = self._halved
        while not found.is_enough and len(found.runs) < MOST_RUNGS and self._undefined < PATIENCE:
            if found.runs and 2.0 * steps * machine.budget_per_step > self.budget.left(share):
                break
            self.budget.check()
            configuration = machine.configuration(steps)
            shortest = self._run(machine, configuration)
            steps *= 2
            self._halved = machine, found, steps
            if shortest is None:
                continue
            finer, _ = self._sampling(bench, shortest, FINER[0])
            values = machine.measure(configuration, self.budget, finer=finer).values
            if values is not None:
                found.add(self._sample(configuration), np.array(values))
        if len(found.runs) < 2:
            return
        sample, values = found.runs[found.best]
        for finer in FINER:
            tried = [machine.measure(sample.configuration, self.budget, finer=part * finer).values for part in (0.5, 1.0)]
            if tried[0] is None or tried[1] is None:
                return
            half, values = (np.array(each) for each in tried)
            change = np.abs(half - values)
            if np.all(change <= self._enough * scales_of(self.wanted, values, change)):
                break
        bars = found.bars() + change
        known = self.reference
        if known is not None and known.trusted and known.bar <= float(np.max(bars / np.array(known.scales))):
            return
        self._take(
            machine, values, bars, self.problem.samples, found.differences(), steps=sample.configuration.steps, sure=found.is_trusted
        )

    def _halved_machine(self, bench: Workbench) -> tuple[Machine, int]:
        """The most promising method that the scene allows, and its first number of steps."""
        for method in [self.methods[self.wished]] if self.wished is not None else for_reference(self.methods):
            if (machine := self._machine(bench, method.name)) is not None:
                return machine, first_steps(self.problem, method, self._own)
        raise MppError("no integrator of the catalogue can serve as a reference for this scene")

    # Scenes with contacts

    def _by_starts(self, bench: Workbench, share: float) -> None:
        """By event-driven flight, which has no step, or by the scene's own solver with halved steps."""
        exact = next((name for name in exact_solvers() if name in self.methods), None)
        machine = None if exact is None else self._machine(bench, exact)
        if machine is not None and self._fly(machine, bench):
            return
        machine = self._machine(bench, self._own.name)
        if machine is None:
            return
        steps = self.problem.own_steps
        if self._halved is not None:
            steps = self._halved[2]
        levels: list[tuple[np.ndarray, np.ndarray]] = []
        while self._undefined < PATIENCE and len(levels) < MOST_RUNGS:
            if len(levels) > 1 and 3.0 * self.wanted.runs * steps * machine.budget_per_step > self.budget.left(share):
                return
            self.budget.check()
            if not levels:
                self._decide_runs(machine, bench, machine.configuration(steps))
            sample = self._sampled(machine, machine.configuration(steps))
            steps *= 2
            if not sample.values:
                continue
            values, scatter, _ = means(sample.values)
            levels.append((values, scatter))
            if len(levels) > 1:
                # The error of first order that is left is the difference of the last two levels, and less for higher orders.
                differences = np.abs(levels[-1][0] - levels[-2][0])
                bars = differences + STUDENT * scatter / math.sqrt(self.wanted.runs)
                one_sided = [float(np.max(differences / scales_of(self.wanted, values, bars)))]
                runs = {"steps": sample.configuration.steps, "sure": True, "scatters": scatter}
                self._take(machine, values, bars, self.problem.samples, one_sided, **runs)
                within = bool(np.all(differences <= STUDENT * math.sqrt(2.0) * scatter / math.sqrt(self.wanted.runs)))
                if self._is_enough or (self.wanted.runs > 1 and within):
                    return

    def _fly(self, machine: Machine, bench: Workbench) -> bool:
        """By flight; False where it breaks off."""
        configuration = machine.configuration(self.problem.samples)
        if not self._decide_runs(machine, bench, configuration):
            return False
        sample = self._sampled(machine, machine.configuration(self.problem.samples))
        if not sample.values:
            return False
        values, scatter, _ = means(sample.values)
        bars = STUDENT * scatter / math.sqrt(self.wanted.runs)
        if self.wanted.runs == 1:
            beside = [machine.measure(sample.configuration, self.budget, number=number).values for number in (1, 2)]
            if any(each is None for each in beside):
                return False
            bars = np.max(np.abs(np.array(beside) - values), axis=0)
        bars = bars + EPSILON * np.abs(values)
        self._take(machine, values, bars, self.problem.samples, [], sure=True, scatters=scatter)
        return True

    def _decide_runs(self, machine: Machine, bench: Workbench, configuration: Configuration) -> bool:
        """Whether the quantity scatters, by two runs from starts that differ by rounding; False where one has no value."""
        one, other = (machine.measure(configuration, self.budget, number=number) for number in (0, 1))
        self.reason = one.reason or other.reason
        if one.values is None or other.values is None:
            return False
        values = np.array(one.values)
        apart = np.abs(values - np.array(other.values))
        largest = float(np.max(apart / scales_of(self.wanted, values, apart / 8.0)))
        least = SCATTERS if self.aim is None else max(SCATTERS, 0.1 * WITHIN_AIM * self.aim)
        if largest > least:
            self._change(bench, runs=RUNS)
            self.tell(f"{self.wanted.name} scatters by {largest:.0e} with rounding: every setting is run {RUNS} times")
        return True

    # Parts

    def _change(self, bench: Workbench, **changes: int) -> None:
        """Go on with another number of runs or samples."""
        self.problem = with_runs(self.problem, **changes)
        bench.shorten(self.problem)

    def _run(self, machine: Machine, configuration: Configuration) -> float | None:
        """Run once, keep the sample, and return the time between samples that the quantity asks for; None without a value."""
        if not self._sampled(machine, configuration).values:
            return None
        return machine.asked_interval

    def _sampled(self, machine: Machine, configuration: Configuration) -> Sample:
        """The sample of a configuration, which is kept."""
        sample, _ = machine.run(configuration, self.budget)
        timed(machine, sample, self.budget)
        self.store.add(sample)
        self.conserves_energy = self.conserves_energy or sample.energy is not None
        if sample.values:
            self._undefined = 0
        else:
            self._undefined += sample.status == "undefined"
            self.reason = sample.reason
        return sample

    def _sample(self, configuration: Configuration) -> Sample:
        found = self.store.get(configuration)
        assert found is not None
        return found

    def _take(
        self,
        machine: Machine,
        values: np.ndarray,
        bars: np.ndarray,
        samples: int,
        differences: list[float],
        *,
        steps: int = 0,
        tolerance: float | None = None,
        sure: bool | None = None,
        scatters: np.ndarray | None = None,
    ) -> None:
        scales = scales_of(self.wanted, values, bars)
        trusted = bool(np.max(bars / scales) < MEANING) if sure is None else sure
        self.reference = ValueReference(
            self.wanted.name,
            self.wanted.labels,
            values=[float(each) for each in values],
            bars=[float(each) for each in bars],
            scatters=[0.0] * len(values) if scatters is None else [float(each) for each in scatters],
            scales=[float(each) for each in scales],
            runs=self.wanted.runs,
            samples=self.problem.samples,
            trusted=trusted,
            integrator=machine.name,
            steps=steps or samples,
            differences=differences,
            control="" if tolerance is None else machine.integrator.controlled_by,
            tolerance=tolerance,
        )
        self.store.notes["values"] = self.reference.facts()

    def _machine(self, bench: Workbench, name: str) -> Machine | None:
        """The compiled method; None where the scene does not allow it."""
        if name not in self.methods:
            return None
        if name not in bench.machines:
            self.budget.check()  # before the compiler, which is not cut off
        try:
            return bench.machine(name)
        except BackendError:
            raise
        except MppError as error:
            log.info("%s is no reference here: %s", name, error)
            return None
