"""Study: the cost of accuracy in one scene — reference, chaos, sweep and repeats, within a budget of wall time."""

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from mpp_taichi.accuracy import chaos as chaos_of
from mpp_taichi.accuracy import flight_reference, radau_reference
from mpp_taichi.accuracy.budget import Budget, OutOfTime
from mpp_taichi.accuracy.chaos import Chaos
from mpp_taichi.accuracy.contact_methods import exact_solvers
from mpp_taichi.accuracy.force_solvers import split
from mpp_taichi.accuracy.front import ENERGY_BAR, StudyRow, time_front
from mpp_taichi.accuracy.ladder import COARSEST, Ladder
from mpp_taichi.accuracy.methods import LOOKS, StudyMethod, equal_cost, first_steps, for_reference, methods
from mpp_taichi.accuracy.problem import Problem
from mpp_taichi.accuracy.reference import ReferenceSolution, converge
from mpp_taichi.accuracy.sample import Configuration, MeasuredError, Sample
from mpp_taichi.accuracy.store import Store
from mpp_taichi.accuracy.sweep import StepSweep, timed
from mpp_taichi.accuracy.workbench import Machine, Workbench
from mpp_taichi.errors import BackendError, MppError

log = logging.getLogger(__name__)

REFERENCE = ("cpu", "f64")
REFERENCE_SHARE = 0.3  # of the budget
LEAST_REFERENCE_SHARE = 0.15
CHAOS_SHARE = 0.5  # of the time left for the first backend and precision
FIRST_SHARE = 0.65  # of the budget, until the end of the first backend and precision, where others follow
ALL_SHARE = 0.96  # of the budget; the rest is for writing the report
WORTH_RETURNING = 0.2  # of the budget: a larger rest is spent on ladders that were cut short
REPEATS_SHARE = 0.25  # of the time for a backend and precision
OWN_SHARE = 1.0 / 60.0  # of the budget, for one run with the scene's own setting; only a part of a longer scene is studied
FEWEST_OWN_STEPS = 64
WELL_KNOWN = 1e-12  # an error bar below which no better reference is tried
WITHIN_AIM = 0.1  # of an aim: no better reference is tried below this error bar
WELL_BEFORE = 0.6  # of the time at which positions lose their meaning: earlier, the effect of round-off is still small
FEWEST_COLLISIONS = 10  # in the part of a run with contacts that is studied
AROUND = 100.0  # times an aim: steps with larger errors are not tried
MOST_ROUNDED = 4  # methods that are tried in a second precision: the best of the first
ROUNDED_ERROR = 1e-8  # of runs in f64: above it a run in f32 may be as accurate


@dataclass(frozen=True)
class StudyWishes:
    """The options of a study: integrators to try, None for all, and (backend, precision) pairs in turn.

    quantity   the quantity whose errors are compared, None for a choice by the scene; energies need no reference
    aim        the only error of interest: methods are tried around it, and methods of first order are not tried
    """

    integrators: Sequence[str] | None = None
    devices: Sequence[tuple[str, str]] = (("cpu", "f64"), ("cpu", "f32"))
    reference: str | None = None
    quantity: str | None = None
    aim: float | None = None


class Study:
    """Runs as many samples as a budget allows; its results are available at any time.

    `tell` is given a line for a person whenever something new begins.
    """

    def __init__(
        self, problem: Problem, store: Store, budget: Budget, wishes: StudyWishes, tell: Callable[[str], None] = lambda _: None
    ) -> None:
        """Begin without a run; the store may hold the span over which the scene was studied before."""
        self.whole = problem.span
        self.problem = problem if store.span is None else problem.shortened(store.span)
        self.store, self.budget, self.wishes, self.tell = store, budget, wishes, tell
        self.methods = methods(problem, wishes.integrators or ())
        self.own = self.methods[problem.own_method]
        self.reference: ReferenceSolution | None = None
        self.chaos: Chaos | None = None
        self.status = "unfinished"
        self.cut: dict[tuple[str, str], int] = {}  # ladders of steps that the budget cut short
        self._remarks: list[str] = []
        self.conserves_energy = False

    def run(self) -> None:
        """Run the study; after the end of the budget, or an exception, the next call continues it."""
        try:
            self._go()
            self.status = "complete" if not self.remarks else "partial"
        except OutOfTime:
            self.status = "out of time"
        finally:
            self.store.save()

    # Results

    @property
    def remarks(self) -> list[str]:
        """The parts of the study that were left out, one line each."""
        short = [
            f"{' '.join(device)}: the budget cut {count} ladders of steps short" for device, count in self.cut.items() if count
        ]
        return [*self._remarks, *short]

    @property
    def quantity(self) -> str | None:
        """The quantity that is compared: positions where their final values have a meaning, else a conserved energy."""
        asked = self.wishes.quantity
        if asked != "energy" and self.reference is not None and self.reference.positions_mean_something:
            return "position"
        return "energy" if self.conserves_energy and asked != "position" else None

    def rows(self) -> list[StudyRow]:
        """Every sample with its errors, as far as the reference shows them; in the order of method, precision and step."""
        own = self.own_configuration.key
        made = sorted(self.store, key=lambda each: (each.configuration.integrator, each.configuration.precision, -each.dt))
        return [self._row(sample, sample.configuration.key == own) for sample in made]

    @property
    def own_configuration(self) -> Configuration:
        """The scene's own setting."""
        own = self.own
        return Configuration(own.name, self._own_steps, REFERENCE[1], REFERENCE[0], own.controlled_by, own.tolerance)

    @property
    def _own_steps(self) -> int:
        return LOOKS if self.own.adaptive else self.problem.own_steps

    def _row(self, sample: Sample, is_own: bool) -> StudyRow:
        position = position_rms = MeasuredError(None)
        if self.reference is not None and self.reference.positions_mean_something:
            position, position_rms = self.reference.errors(sample)
        kept = (sample.energy, sample.momentum, sample.angular_momentum)
        energy, momentum, angular_momentum = (MeasuredError.against(error, ENERGY_BAR) for error in kept)
        return StudyRow(sample, position, position_rms, energy, momentum, angular_momentum, is_own)

    def error(self, sample: Sample, quantity: str) -> MeasuredError:
        """The error of a sample in one of QUANTITIES; infinite for a run that broke off."""
        return self._row(sample, False).error(quantity) if sample.status == "ok" else MeasuredError(None)

    def _error(self, sample: Sample) -> float:
        return float("inf") if self.quantity is None else self.error(sample, self.quantity).bound

    # Stages of the study

    def _go(self) -> None:
        with Workbench(self.problem, backend=REFERENCE[0], precision=REFERENCE[1]) as bench:
            self._choose_span(bench)
            if self.wishes.quantity == "energy":
                self.conserves_energy = bench.machine(self.own.name).simulation.phase.conserves_energy
            else:
                self._find_reference(bench)
                self._find_chaos(bench)
            first, *others = self.wishes.devices
            if first == REFERENCE:
                self._sweep(bench, self._names(), begin=0.0, end=FIRST_SHARE if others else ALL_SHARE)
        if self.quantity is None:
            return
        self._sweep_each([device for device in self.wishes.devices if device != REFERENCE])
        if any(self.cut.values()) and self.budget.left(ALL_SHARE) > WORTH_RETURNING * self.budget.seconds:
            self._sweep_each([device for device in self.wishes.devices if self.cut.get(device)])

    def _sweep_each(self, devices: Sequence[tuple[str, str]]) -> None:
        """Divide the remaining budget among backends and precisions; a backend that does not start is left out."""
        for number, (backend, precision) in enumerate(devices):
            begin = self.budget.spent / self.budget.seconds
            end = begin + (ALL_SHARE - begin) / (len(devices) - number)
            names = self._names() if (backend, precision) == REFERENCE else self._best_names()
            try:
                with Workbench(self.problem, backend=backend, precision=precision) as bench:
                    self._sweep(bench, names, begin=begin, end=end)
            except BackendError as error:
                self._remarks.append(f"{backend} {precision}: {error}")
                self.tell(self._remarks[-1])

    def _names(self) -> list[str]:
        """The wanted methods; else all methods, implicit methods only where springs or drag limit the steps of others."""
        if self.wishes.integrators is not None:
            return [name for name in self.methods if name in self.wishes.integrators]
        if self.problem.spec.contacts is not None:
            return [name for name in self.methods if name not in exact_solvers()]
        is_stiff = any(method.fewest_steps > 1 for method in self.methods.values())
        least = 1 if self.wishes.aim is None else 2
        suits = [name for name, method in self.methods.items() if (is_stiff or not method.implicit) and method.order >= least]
        return list(dict.fromkeys((self.own.name, *suits)))

    def _best_names(self) -> list[str]:
        """Methods for another precision: the wanted methods, else the scene's own and the front's where rounding permits."""
        if self.wishes.integrators is not None:
            return self._names()
        found = [self.own.name]
        for row in time_front(self.rows(), self.quantity or "energy"):
            if row.error(self.quantity or "energy").bound > ROUNDED_ERROR:
                found.append(row.sample.configuration.integrator)
        return list(dict.fromkeys(found))[:MOST_ROUNDED]

    def _choose_span(self, bench: Workbench) -> None:
        """Shorten a scene that takes too long for dozens of runs; the store remembers the span, whatever the next budget is."""
        if self.store.span is None:
            machine = bench.machine(split(self.own.name)[0])  # the reference is without a tree
            own_seconds = self._own_steps * machine.seconds_per_step
            allowed = OWN_SHARE * self.budget.seconds
            if own_seconds > allowed:
                least = min(1.0, FEWEST_OWN_STEPS / self.problem.own_steps)
                self._look_at(bench, self.problem.shortened(self.problem.span * max(least, allowed / own_seconds)))
            self.store.span = self.problem.span
        if self.problem.span < self.whole:
            self.tell(
                f"studying the first t = {self.problem.span:.6g} of {self.whole:.6g}: all of it does not fit the budget often"
            )

    def _find_reference(self, bench: Workbench) -> None:
        known = self.store.notes.get("reference")
        if known is not None and known["trusted"]:
            asked = (known["control"], known["tolerance"])
            kept = self.store.get(Configuration(known["integrator"], known["steps"], REFERENCE[1], REFERENCE[0], *asked))
            if kept is not None and kept.end is not None:
                self.reference = ReferenceSolution(**known, end=kept.end)
                self.conserves_energy = kept.energy is not None
                return
        exact = next((name for name in exact_solvers() if name in self.methods), None)
        if exact is not None and self._fly(bench, exact):
            return
        machine, steps = self._reference_machine(bench)
        if known is not None and known["integrator"] == machine.name:
            steps = max(steps, known["steps"] // 2)

        def add(sample: Sample) -> None:
            timed(machine, sample, self.budget)
            self.store.add(sample)
            self.conserves_energy = sample.energy is not None

        # However long the compiler took, some time must be left to halve a step twice.
        share = max(REFERENCE_SHARE, self.budget.spent / self.budget.seconds + LEAST_REFERENCE_SHARE)
        found = converge(machine, steps, self.budget, share=share, add=add)
        if found.runs:
            self.reference = self._finer(bench, found.reference())
            self.store.notes["reference"] = self.reference.facts()
            self.tell(f"reference: {self.reference.told}")
            if not self.reference.trusted:
                self._remarks.append(
                    "the reference was not shown to have converged; a longer budget, or a second call, goes on"
                )

    def _fly(self, bench: Workbench, exact: str) -> bool:
        """Use exact flight as the reference, over the part of the run in which round-off does not decide the collisions.

        Where too little happens in that part, it is the whole, for energies. Whether the scene can be flown at all.
        """
        try:
            machine, whole = bench.machine(exact), self.problem
        except BackendError:
            raise
        except MppError as error:
            self.tell(f"no event-driven flight here: {error}")
            return False
        while (found := flight_reference.fly(machine, self.budget)) is not None:
            reference, sample = found
            part = WELL_BEFORE * reference.meaning if reference.meaning else self.problem.span / LOOKS
            if reference.trusted or sample.evaluations < FEWEST_COLLISIONS:
                break
            self._look_at(bench, self.problem.shortened(part))
        if found is not None and not reference.trusted:
            self._look_at(bench, whole)
            found = flight_reference.fly(machine, self.budget)
        if found is None:
            return False
        self.reference, sample = found
        timed(machine, sample, self.budget)
        self.store.add(sample)
        self.conserves_energy = sample.energy is not None
        self.store.notes["reference"] = self.reference.facts()
        self.tell(f"reference: {self.reference.told}")
        if self.problem.span < whole.span:
            self.tell(f"studying the first t = {self.problem.span:.6g}, in which no round-off grows to be seen")
        return True

    def _look_at(self, bench: Workbench, problem: Problem) -> None:
        """Study this part of the run from now on."""
        self.problem = problem
        bench.shorten(problem)
        self.store.span = problem.span

    def _finer(self, bench: Workbench, known: ReferenceSolution) -> ReferenceSolution:
        """Replace the reference by the solution of `radau_reference`, where round-off limits the known one and time is left."""
        enough = WELL_KNOWN if self.wishes.aim is None else self.wishes.aim * WITHIN_AIM
        if not known.trusted or known.bar <= enough or radau_reference.method() not in self.methods:
            return known
        if self.wishes.reference is not None or 2.0 * self.budget.spent > FIRST_SHARE * self.budget.seconds:
            return known
        try:
            machine = bench.machine(radau_reference.method())
        except BackendError:
            raise
        except MppError as error:
            log.info("%s is no reference here: %s", radau_reference.method(), error)
            return known

        def add(sample: Sample) -> None:
            timed(machine, sample, self.budget)
            self.store.add(sample)

        if len(radau_reference.TOLERANCES) * LOOKS * machine.seconds_per_step > self.budget.left(FIRST_SHARE):
            return known
        return radau_reference.finer(machine, known, self.budget, add=add)

    def _reference_machine(self, bench: Workbench) -> tuple[Machine, int]:
        """The most promising method that the scene allows."""
        promising = for_reference(self.methods) if self.problem.spec.contacts is None else [self.own]
        if self.wishes.reference is not None:
            promising = [self.methods[self.wishes.reference]]
        for method in promising:
            try:
                return bench.machine(method.name), first_steps(self.problem, method, self.own)
            except BackendError:
                raise
            except MppError as error:
                log.info("%s is no reference here: %s", method.name, error)
        raise MppError("no integrator of the catalogue can serve as a reference for this scene")

    def _find_chaos(self, bench: Workbench) -> None:
        known = self.store.notes.get("chaos")
        if known is not None:
            self.chaos = Chaos(known["lyapunov_time"], known["rise"], known["span"])
            return
        if self.reference is None or self.problem.spec.contacts is not None:
            return
        if self.reference.tolerance is None:
            method = self.methods[self.reference.integrator]
            steps = max(first_steps(self.problem, method, self.own), self.reference.steps // 4)
            machine = bench.machine(method.name)
        else:
            machine, steps = self._reference_machine(bench)
        if 2.0 * max(steps, chaos_of.PIECES) * machine.seconds_per_step < CHAOS_SHARE * self.budget.left(FIRST_SHARE):
            self.chaos = chaos_of.measure(machine, steps, self.reference.size, self.budget)
            self.store.notes["chaos"] = vars(self.chaos)

    def _sweep(self, bench: Workbench, names: list[str], *, begin: float, end: float) -> None:
        if self.quantity is None:
            return
        self.tell(f"{bench.backend} {bench.precision}: {', '.join(names)}")
        sweep = StepSweep(bench, self.store, self.budget, self.methods, self._error)
        for machine in bench.machines.values():
            sweep.learn(machine)
        ladders = [self._ladder(self.methods[name]) for name in names]
        sweep.climb(ladders, share=end - REPEATS_SHARE * (end - begin), first=self.own.name)
        sweep.repeat(share=end)
        self.store.save()
        self.cut[bench.backend, bench.precision] = sweep.left_out

    def _ladder(self, method: StudyMethod) -> Ladder:
        anchor = equal_cost(self.problem, method, self.own)
        floor = ENERGY_BAR
        if self.quantity == "position" and self.reference is not None:
            floor = self.reference.bar
        coarsest = COARSEST
        if self.wishes.aim is not None:
            floor, coarsest = max(floor, self.wishes.aim), min(COARSEST, AROUND * self.wishes.aim)
        fewest = float(method.fewest_steps)
        patient, tolerance = self.problem.spec.contacts is not None, method.tolerance
        steps = (method.name, method.order, anchor, fewest)
        return Ladder(*steps, floor, coarsest=coarsest, tolerance=tolerance, patient=patient)
