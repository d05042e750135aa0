"""Sweep: the rungs of many ladders on one workbench, the cheapest first; then repeats, interleaved, for the times."""

import logging
from collections.abc import Callable

from mpp_taichi.accuracy.budget import Budget
from mpp_taichi.accuracy.contact_methods import exact_solvers
from mpp_taichi.accuracy.force_solvers import by_tree
from mpp_taichi.accuracy.ladder import Ladder
from mpp_taichi.accuracy.methods import StudyMethod, rank
from mpp_taichi.accuracy.sample import Configuration, Sample
from mpp_taichi.accuracy.store import Store
from mpp_taichi.accuracy.workbench import Machine, Workbench
from mpp_taichi.errors import BackendError, MppError, PrecisionError

log = logging.getLogger(__name__)

REPEATS = 5
LONG_SECONDS = 0.2  # of a run whose time is used although samples were taken on the way
DEAREST = 0.12  # part of the budget that one run may take
LONG_COMPILE = 8.0  # ratio of the compile times of implicit and adaptive methods to the compile times of other methods
FIRST_ORDER_LAST = 8.0  # methods of first order are begun late, as if they cost this many times as much
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
    ) -> None:
        """Begin without a run."""
        self.bench, self.store, self.budget, self.methods, self.error_of = bench, store, budget, methods, error_of
        self.seconds_per_evaluation: dict[bool, float] = {}  # by whether a tree sums
        self.left_out = 0

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
        waiting = list(ladders)
        while waiting:
            self.budget.check()
            offers = []
            for ladder in list(waiting):
                rungs = self._recall(ladder)
                if not rungs:
                    waiting.remove(ladder)
                offers += [(self._expected(ladder, rung), ladder, rung) for rung in rungs]
            if not offers:
                return
            begun = [offer for offer in offers if offer[1].integrator == first and not offer[1].errors]
            seconds, ladder, rung = min(begun or offers, key=lambda offer: offer[0] * self._dearness(offer[1]))
            dear = self._run_seconds(ladder, rung) > DEAREST * self.budget.seconds
            if dear or seconds > self.budget.left(share):
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

    def learn(self, machine: Machine) -> None:
        """Learn the time of a force evaluation from a run."""
        self.seconds_per_evaluation[by_tree(machine.name)] = machine.seconds_per_step / machine.evaluations

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
        log.info("%s: error %.1e", sample.configuration.key, self.error_of(sample))
        if sample.status == "refused":
            waiting.remove(ladder)
        else:
            self._note(ladder, rung, sample)

    def _note(self, ladder: Ladder, rung: int, sample: Sample) -> None:
        """Note a sample in its ladder, which ends where other methods are as good at far lower cost."""
        error = self.error_of(sample)
        ladder.note(rung, error)
        others = [
            each for each in self._mine() if each.configuration.integrator not in exact_solvers()
        ]  # no method with steps can compete with exact flight
        if any(sample.evaluations > HOPELESS * each.evaluations and self.error_of(each) <= error for each in others):
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
            return steps * self.bench.machine(method.name).seconds_per_step
        known = self.seconds_per_evaluation
        guess = max(known.values(), default=0.0)
        return steps * method.evaluations * known.get(by_tree(method.name), guess)

    def _is_compiled(self, name: str) -> bool:
        return name in self.bench.machines

    def _compile_seconds(self, name: str) -> float:
        slow = LONG_COMPILE if self.methods[name].implicit or self.methods[name].adaptive else 1.0
        return slow * self.bench.expected_compile_seconds()

    def _dearness(self, ladder: Ladder) -> float:
        """The rank by which new ladders are begun: the best method of each order comes before the second best."""
        if ladder.errors:
            return 1.0
        return FIRST_ORDER_LAST if ladder.order <= 1 else 1.0 + rank(self.methods, self.methods[ladder.integrator])


def timed(machine: Machine, sample: Sample, budget: Budget) -> None:
    """Measure the time of the steps without samples, where the first measurement included samples."""
    if sample.status == "ok" and sample.seconds and sample.seconds[0] < LONG_SECONDS:
        sample.seconds = [machine.time(sample.configuration, budget)]
