"""Sweep: the rungs of many ladders on one workbench; then repeats, interleaved, for the times.

The scene's own method begins. Then every method that is made for the scene's kind has two rungs, then one method of each
family, and only then the cheapest rung of any ladder is next. Where one error is aimed at, methods that are far slower than
the fastest that reached it are left: of families that are far slower no other method is compiled.
"""

import logging
import math
import statistics
from collections.abc import Callable, Collection, Iterable

from mpp_taichi.accuracy.budget import Budget
from mpp_taichi.accuracy.contact_methods import exact_solvers
from mpp_taichi.accuracy.families import representatives
from mpp_taichi.accuracy.force_solvers import by_tree
from mpp_taichi.accuracy.joules import LEAST_SECONDS, joules_of
from mpp_taichi.accuracy.ladder import Ladder
from mpp_taichi.accuracy.machine import Machine
from mpp_taichi.accuracy.methods import StudyMethod, rank
from mpp_taichi.accuracy.sample import Configuration, Sample
from mpp_taichi.accuracy.store import Store
from mpp_taichi.accuracy.workbench import Workbench
from mpp_taichi.device.energy_counters import energy_counters
from mpp_taichi.errors import BackendError, MppError, PrecisionError

log = logging.getLogger(__name__)

REPEATS = 5
LONG_SECONDS = 0.2  # of a run whose time is used although samples were taken on the way
DEAREST = 0.12  # part of the budget that one run may take
LONGEST_COMPILE = 4.0  # ratio of the compile time of a method that says it is slow to that of others
COMPILE_SECONDS = 1.0  # of a simple method, until one has been compiled
LONG_COMPILE = 1.5  # ratio of the compile times of implicit and adaptive methods to the compile times of other methods
FIRST_ORDER_LAST = 8.0  # methods of first order are begun late, as if they cost this many times as much
LAST_STAGE = 3
TRIAL_SHARE = 0.92  # of the whole budget, in which every family has its trial, whatever the share of the sweep is
CLIMBING_SHARE = 0.2  # of the share of a sweep, in which nothing more is compiled
TRIAL_RUNGS = 2  # of a ladder, until every family has been tried
WORTH = 4.0  # times the shortest time in which an aim was reached: slower runs, and methods of slower families, are left out
HOPELESS = 100.0  # a rung is skipped when another row is as good with fewer force evaluations by this factor


class StepSweep:
    """One backend and precision of a study; the error of a sample by `error_of` decides the last rung of a ladder."""

    def __init__(
        self,
        bench: Workbench,
        store: Store,
        budget: Budget,
        methods: dict[str, StudyMethod],
        error_of: Callable[[Sample], float],
        *,
        promised: Collection[str] = (),
        aim: float | None = None,
    ) -> None:
        """Begin without a run; `promised` are the methods made for the scene, `aim` the only error of interest."""
        self.promised, self.aim = promised, aim
        self.bench, self.store, self.budget, self.methods, self._error_of = bench, store, budget, methods, error_of
        self.seconds_per_evaluation: dict[bool, float] = {}  # by whether a tree sums
        self.left_out = 0
        self._exact = frozenset(exact_solvers())
        self._names: set[str] = set()
        self._began = 0.0  # part of the budget that was spent before
        self._errors: dict[str, float] = {}

    def configuration(self, ladder: Ladder, rung: int) -> Configuration:
        """The configuration of a run on this workbench."""
        control = self.methods[ladder.integrator].controlled_by
        here = (self.bench.precision, self.bench.backend)
        return Configuration(ladder.integrator, ladder.steps(rung), *here, control, ladder.asked(rung))

    def climb(self, ladders: list[Ladder], *, share: float, first: str) -> None:
        """Run rungs until none is open or the share of the budget is spent; the method `first` begins.

        Raises:
            OutOfTime: all of the budget is spent.
        """
        self._began = self.budget.used
        waiting, self._names = list(ladders), {ladder.integrator for ladder in ladders}
        trial = representatives([self.methods[ladder.integrator] for ladder in ladders])
        while waiting:
            self.budget.check()
            offers = []
            for ladder in list(waiting):
                rungs = self._recall(ladder)
                if not rungs or (ladder.integrator not in trial and not self._is_worth(ladder)):
                    waiting.remove(ladder)
                    continue
                offers += [(self._expected(ladder, rung), ladder, rung) for rung in rungs]
            if not offers:
                return

            def turn(offer: tuple[float, Ladder, int]) -> tuple[int, bool, bool, bool, float, str]:
                seconds, ladder, _ = offer
                stage = self._stage(ladder, first, trial)
                if stage == LAST_STAGE:
                    return stage, False, False, False, seconds * self._dearness(ladder), ladder.integrator
                # The methods that compile fastest begin, whatever was measured: Taichi finds the kernels of an earlier study
                # again where methods are compiled in the same order.
                method = self.methods[ladder.integrator]
                slow = (method.slow_to_compile, method.implicit or method.adaptive, not method.symplectic)
                return stage, *slow, float(method.evaluations), method.name

            seconds, ladder, rung = min(offers, key=turn)
            if self._is_slow(ladder, rung):
                ladder.close(rung)
            elif self._run_seconds(ladder, rung) > DEAREST * self.budget.seconds or seconds > self._left(
                ladder, share, is_trial=turn((seconds, ladder, rung))[0] < LAST_STAGE
            ):
                ladder.close(rung)
                self.left_out += 1
            else:
                self._try(ladder, rung, waiting)

    def repeat(self, *, share: float) -> None:
        """Time every run again, one after another, until each has REPEATS times or the share of the budget is spent."""
        for _ in range(REPEATS):
            for sample in sorted(self._mine(), key=lambda each: each.median_seconds or 0.0):
                name = sample.configuration.integrator
                wanted = sample.status == "ok" and len(sample.seconds) < REPEATS
                expected = sum(sample.seconds[:1]) + (0.0 if self._is_compiled(name) else self._compile_seconds(name))
                if wanted and expected < self.budget.left(share):
                    sample.seconds.append(self.bench.machine(name).time(sample.configuration, self.budget))
                    self.store.save_when_due()  # so that a kill does not cost all repeats

    def weigh(self, *, share: float) -> None:
        """Measure the electrical energy of the runs, where the machine counts it and the share of the budget lasts."""
        if not energy_counters():
            return
        for sample in self._mine():
            name, expected = sample.configuration.integrator, max(LEAST_SECONDS, sample.median_seconds or 0.0)
            wanted = sample.status == "ok" and sample.joules is None and self._is_compiled(name)
            if wanted and expected < self.budget.left(share):
                sample.joules = joules_of(self.bench.machine(name), sample.configuration, self.budget)

    def learn(self, machine: Machine) -> None:
        """Learn the time of a force evaluation from a run."""
        self.seconds_per_evaluation[by_tree(machine.name)] = machine.budget_per_step / machine.evaluations

    def measure(self, configuration: Configuration) -> Sample:
        """Run once, and keep the sample; for a method that the scene does not allow the sample holds the reason."""
        try:
            machine = self.bench.machine(configuration.integrator)
        except MppError as error:
            if isinstance(error, BackendError) and not isinstance(error, PrecisionError):
                raise
            dt = self.bench.problem.span / configuration.steps
            sample = Sample(configuration, dt, status="refused", reason=str(error).splitlines()[0])
        else:
            sample, _ = machine.run(configuration, self.budget)
            timed(machine, sample, self.budget)
            self.learn(machine)
        self.store.add(sample)
        return sample

    # Internals

    def _left(self, ladder: Ladder, share: float, *, is_trial: bool) -> float:
        """The seconds left for a rung: compilations leave a part of the share to the methods that are compiled."""
        if is_trial and self.aim is None:  # a target leaves time for other precisions, in which it may cost half as much
            return self.budget.left(max(share, TRIAL_SHARE))
        climbing = 0.0 if self._is_compiled(ladder.integrator) else CLIMBING_SHARE * (share - self._began)
        return self.budget.left(share - climbing)

    def _stage(self, ladder: Ladder, first: str, trial: Collection[str]) -> int:
        """When a ladder has its turn: the scene's own method, the promised methods, one of each family, then the cheapest."""
        if ladder.integrator == first and not ladder.errors:
            return 0
        if len(ladder.errors) >= TRIAL_RUNGS:
            return LAST_STAGE
        name = ladder.integrator
        if name in self.promised and (self._is_compiled(name) or not self.methods[name].slow_to_compile):
            return 1
        return 2 if name in trial or name in self.promised else LAST_STAGE

    def _is_worth(self, ladder: Ladder) -> bool:
        """Whether a method is to be tried: it has begun, or a method of its family is nearly as fast as the fastest so far."""
        family = self.methods[ladder.integrator].family
        relatives = [each for each in self._mine() if self._family(each) == family]
        if ladder.errors or self.aim is None or ladder.integrator in self.promised or not relatives:
            return True
        return self._best_seconds(relatives) <= WORTH * self._best_seconds(self.store)

    def _is_slow(self, ladder: Ladder, rung: int) -> bool:
        """Whether a rung would take much longer than a run that reached the aim."""
        if self.aim is None or not self._is_compiled(ladder.integrator):
            return False
        machine = self.bench.machine(ladder.integrator)
        return ladder.steps(rung) * machine.seconds_per_step > WORTH * self._best_seconds(self.store)

    def _best_seconds(self, samples: Iterable[Sample]) -> float:
        """The shortest time in which a sample reached the aim; infinite where none did."""
        tried = [each for each in samples if each.configuration.integrator in self._names]  # others are the reference's
        reached = [each for each in tried if self.aim is not None and self._error(each) <= self.aim]
        return min((each.median_seconds or math.inf for each in reached), default=math.inf)

    def _error(self, sample: Sample) -> float:
        key = sample.configuration.key
        if key not in self._errors:  # the reference stays the same during a sweep
            self._errors[key] = self._error_of(sample)
        return self._errors[key]

    def _family(self, sample: Sample) -> str:
        method = self.methods.get(sample.configuration.integrator)
        return "" if method is None else method.family

    def _recall(self, ladder: Ladder) -> list[int]:
        """The open rungs, after the samples of the store have been noted."""
        while True:
            rungs = ladder.open_rungs()
            known = [(rung, self.store.get(self.configuration(ladder, rung))) for rung in rungs]
            found = [(rung, sample) for rung, sample in known if sample is not None]
            if not found:
                return rungs
            rung, sample = found[0]
            if sample.status == "refused":
                return []
            self._note(ladder, rung, sample)

    def _try(self, ladder: Ladder, rung: int, waiting: list[Ladder]) -> None:
        sample = self.measure(self.configuration(ladder, rung))
        log.info("%s: error %.1e", sample.configuration.key, self._error(sample))
        if sample.status == "refused":
            waiting.remove(ladder)
        else:
            self._note(ladder, rung, sample)

    def _note(self, ladder: Ladder, rung: int, sample: Sample) -> None:
        """Note a sample in its ladder, which ends where other methods are as good at far lower cost."""
        error = self._error(sample)
        ladder.note(rung, error)
        # No method with steps can compete with exact flight.
        others = [each for each in self._mine() if each.configuration.integrator not in self._exact]
        if any(sample.evaluations > HOPELESS * each.evaluations and self._error(each) <= error for each in others):
            ladder.closed_above = True

    def _mine(self) -> list[Sample]:
        here = (self.bench.backend, self.bench.precision)
        return [each for each in self.store if (each.configuration.backend, each.configuration.precision) == here]

    def _expected(self, ladder: Ladder, rung: int) -> float:
        """The expected seconds of a rung: one run for the errors, one for the time, and the compilation."""
        compiler = 0.0 if self._is_compiled(ladder.integrator) else self._compile_seconds(ladder.integrator)
        return 2.0 * self._run_seconds(ladder, rung) + compiler

    def _run_seconds(self, ladder: Ladder, rung: int) -> float:
        method, steps = self.methods[ladder.integrator], ladder.steps(rung)
        if self._is_compiled(method.name):
            return steps * self.bench.machine(method.name).budget_per_step
        known = self.seconds_per_evaluation
        guess = max(known.values(), default=0.0)
        return steps * method.evaluations * known.get(by_tree(method.name), guess)

    def _is_compiled(self, name: str) -> bool:
        return name in self.bench.machines

    def _compile_seconds(self, name: str) -> float:
        known = [machine.compile_seconds / self._slowness(machine.name) for machine in self.bench.machines.values()]
        known = known[1:] or known  # the first also holds the start of the device
        return self._slowness(name) * (statistics.median(known) if known else COMPILE_SECONDS)

    def _slowness(self, name: str) -> float:
        """The compile time of a method over that of simple methods, roughly."""
        method = self.methods[name]
        return LONGEST_COMPILE if method.slow_to_compile else LONG_COMPILE if method.implicit or method.adaptive else 1.0

    def _dearness(self, ladder: Ladder) -> float:
        """The rank by which new ladders are begun: the best method of each order comes before the second best."""
        if ladder.errors:
            return 1.0
        return FIRST_ORDER_LAST if ladder.order <= 1 else 1.0 + rank(self.methods, self.methods[ladder.integrator])


def timed(machine: Machine, sample: Sample, budget: Budget) -> None:
    """Measure the time of the steps without samples, where the first measurement included samples."""
    if sample.status == "ok" and sample.seconds and sample.seconds[0] < LONG_SECONDS:
        sample.seconds = [machine.time(sample.configuration, budget)]
