"""Trials: runs of the fastest offers with the steps at which they are expected to reach a target."""

import math
import statistics
from dataclasses import dataclass, replace

from mpp_taichi.accuracy.budget import Budget
from mpp_taichi.accuracy.contact_methods import exact_solvers
from mpp_taichi.accuracy.front import QUANTITIES, StudyRow
from mpp_taichi.accuracy.offers import LEAST_POWER, Offer, offers_for
from mpp_taichi.accuracy.sample import Configuration, MeasuredError
from mpp_taichi.accuracy.study import Study
from mpp_taichi.accuracy.workbench import Workbench

SAFETY = 0.7  # of the target: the error for which the step is interpolated
TOO_GOOD = 3.0  # an error smaller than the target by this factor: a coarser step is tried as well
TRIALS = 3  # runs with the chosen step, each corrected by the result of the last
FEWEST_TRIED, MOST_TRIED = 3, 6  # offers that are run, more than the fewest only while TRIALS_SHARE of the budget lasts
COARSER = 1.5  # ratio of the steps of two trials where the error is only known to be within the scatter
ALIKE = 1.5  # ratio of times: offers that seem slower than the best trial by more than this are not run
TRIALS_SHARE = 0.05  # of a budget
POWER_OF_TOLERANCE = {"tolerance": 1.0}  # by the name of the control: of the error of an adaptive method, where it is not known
LARGE_POWER = 2.0  # of the error by other controls
ROUNDS = 8  # in which the trials are timed in turns
REPEATS = 3
LOOKS_OF_ADAPTIVE = 1000  # samples in a run of a method that needs no step


@dataclass(frozen=True)
class Trial:
    """An offer that reached the target: its setting, with its step [time], its error and the seconds of its steps."""

    offer: Offer
    configuration: Configuration
    dt: float
    error: MeasuredError
    seconds: float


class Trials:
    """The trials of one target, made on each workbench while its methods are compiled."""

    def __init__(self, target: float) -> None:
        """Begin without a trial."""
        self.target = target
        self.reached: list[Trial] = []
        self.offers: list[Offer] = []

    def allowed(self, study: Study) -> float:
        """The difference from the reference within which a run reaches the target, whatever the reference's own error is.

        Negative where the error of the reference is as large as the target.
        """
        quantity = study.quantity
        if quantity is None:
            return -1.0
        allowed = study.allowed(self.target, quantity)
        if (values := study.value_reference) is not None:  # of many runs: their bar contains the bar of the reference
            within = allowed - values.bar
            return within if values.runs == 1 or within <= 0.0 else allowed
        return allowed if quantity != QUANTITIES[0] or study.reference is None else allowed - study.reference.bar

    def run(self, study: Study, bench: Workbench) -> None:
        """Try the fastest offers of the methods of a workbench."""
        allowed = self.allowed(study)
        if study.quantity is None or allowed <= 0.0:
            return
        rows = [row for row in study.rows() if _is_candidate(study, row, bench)]
        offers = sorted(offers_for(rows, study.quantity, SAFETY * allowed), key=lambda offer: offer.seconds)
        self.offers += offers
        known, mine = list(self.reached), Budget(TRIALS_SHARE * study.budget.seconds)
        for offer in offers:
            tried = len(self.reached) - len(known)
            best = min((trial.seconds for trial in self.reached), default=math.inf)
            if offer.seconds > ALIKE * best or tried == MOST_TRIED or (tried >= FEWEST_TRIED and mine.left() <= 0.0):
                break
            if (found := try_offer(study, bench, offer, allowed)) is not None:
                self.reached.append(found)
        self.reached = known + timed_in_turns(self.reached[len(known) :], bench, Budget(TRIALS_SHARE * study.budget.seconds))


def timed_in_turns(trials: list[Trial], bench: Workbench, budget: Budget) -> list[Trial]:
    """The trials with the shortest time of each, measured in turns, so that no passing load of the machine decides."""
    seconds = [trial.seconds for trial in trials]
    for _ in range(ROUNDS if len(trials) > 1 else 0):
        for number, trial in enumerate(trials):
            if seconds[number] < budget.left():
                took = bench.machine(trial.configuration.integrator).time(trial.configuration, budget)
                seconds[number] = min(seconds[number], took)
    return [replace(trial, seconds=shortest) for trial, shortest in zip(trials, seconds)]


def as_run(study: Study, target: float) -> Trial | None:
    """The fastest run of the study that reaches a target as it is; None where none does.

    Where the error of the reference is a large part of the target, no step can be interpolated, yet the run of the reference
    itself may reach the target, as its error is at most its bar.
    """
    quantity = study.quantity or QUANTITIES[0]
    allowed, names = study.allowed(target, quantity), study.wishes.integrators or study.methods
    best: Trial | None = None
    for row in study.rows():
        made, seconds, error = row.sample.configuration, row.seconds, row.error(quantity)
        ok = row.sample.status == "ok" and made.integrator in names and (made.backend, made.precision) in study.wishes.devices
        if ok and seconds is not None and error.bound <= allowed and (best is None or seconds < best.seconds):
            dt = _step(study, made)
            offer = Offer(made.integrator, made.precision, made.backend, made.fineness, seconds)
            best = Trial(offer, made, dt, error, seconds)
    return best


def _step(study: Study, configuration: Configuration) -> float:
    """The step of the run for which a setting is chosen [time]; of a method that needs none, the time between two samples."""
    needs_none = configuration.tolerance is not None or configuration.integrator in exact_solvers()
    if study.values is not None or not needs_none:
        return study.problem.span / configuration.steps
    return study.whole / LOOKS_OF_ADAPTIVE


def _is_candidate(study: Study, row: StudyRow, bench: Workbench) -> bool:
    """Whether a run was made on a workbench, with a method that may be chosen; runs of the reference are in the store too."""
    configuration = row.sample.configuration
    here = (configuration.backend, configuration.precision) == (bench.backend, bench.precision)
    return here and configuration.integrator in (study.wishes.integrators or study.methods)


def try_offer(study: Study, bench: Workbench, offer: Offer, allowed: float) -> Trial | None:
    """Run an offer, again with a finer or coarser step if its error is too large or far too small; None if it fails.

    Where means are compared, a bound is mostly scatter, and does not tell the step that would just reach the target: coarser
    steps are tried until one does not reach it.
    """
    method, fineness, quantity = study.methods[offer.integrator], offer.fineness, study.quantity or QUANTITIES[0]
    # Where a budget ended early, all known runs may reach the target, with the tolerances of the reference even by far.
    power = (offer.power or POWER_OF_TOLERANCE.get(method.controlled_by, LARGE_POWER)) if method.adaptive else method.order
    budget = Budget(study.budget.seconds)
    scatters = study.value_reference is not None and study.value_reference.runs > 1
    reached: tuple[float, Trial] | None = None
    before: tuple[float, float] | None = None  # fineness and error of the last run
    machine = bench.machine(offer.integrator)
    for _ in range(TRIALS + scatters):
        steps, tolerance = (study.problem.samples, 1.0 / fineness) if method.adaptive else (math.ceil(fineness), None)
        configuration = machine.configuration(steps, tolerance)
        sample, _ = machine.run(configuration, budget)
        error = study.error(sample, quantity)
        if sample.status == "ok" and error.bound <= allowed:
            dt = _step(study, configuration)
            if reached is None or fineness < reached[0]:
                seconds = statistics.median(machine.time(configuration, budget) for _ in range(REPEATS))
                reached = fineness, Trial(offer, configuration, dt, error, seconds)
        if offer.integrator in exact_solvers():
            break  # it has no step
        if scatters and not method.adaptive and error.value is None and error.bound <= allowed:
            coarser = max(fineness / COARSER, float(method.fewest_steps))
            if coarser == fineness:
                break
            fineness = coarser
            continue
        is_close = allowed / TOO_GOOD < error.bound <= allowed
        if not math.isfinite(error.bound) or is_close or (reached and error.bound > allowed and not method.adaptive):
            break
        if method.adaptive and before is not None and (measured := _power(before, (fineness, error.bound))) is not None:
            power = measured
        before = fineness, error.bound
        wanted = fineness * (error.bound / (SAFETY * allowed)) ** (1.0 / power)
        if not method.adaptive:
            wanted = max(wanted, float(method.fewest_steps))  # a coarser step would be unstable
        if wanted == fineness:
            break
        fineness = wanted
    return reached and reached[1]


def _power(one: tuple[float, float], other: tuple[float, float]) -> float | None:
    """The power of the fineness with which the error falls between two runs (fineness, error); None where it does not fall."""
    power = math.log(other[1] / one[1]) / math.log(one[0] / other[0])
    return power if power > LEAST_POWER else None
