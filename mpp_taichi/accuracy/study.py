"""Study: the cost of accuracy in one scene — reference, chaos, sweep and repeats, within a budget of processor time."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from mpp_taichi.accuracy.budget import Budget, OutOfTime
from mpp_taichi.accuracy.chaos import ROUND_OFF, Chaos
from mpp_taichi.accuracy.compared import Compared
from mpp_taichi.accuracy.contact_methods import exact_solvers
from mpp_taichi.accuracy.families import promised
from mpp_taichi.accuracy.force_solvers import split
from mpp_taichi.accuracy.front import ENERGY_BAR, QUANTITIES, StudyRow, time_front
from mpp_taichi.accuracy.ladder import COARSEST, Ladder
from mpp_taichi.accuracy.methods import StudyMethod, equal_cost, methods
from mpp_taichi.accuracy.problem import Problem
from mpp_taichi.accuracy.reference import ReferenceSolution
from mpp_taichi.accuracy.reference_machines import DEVICE as REFERENCE
from mpp_taichi.accuracy.reference_search import ReferenceSearch
from mpp_taichi.accuracy.sample import Configuration, MeasuredError, Sample
from mpp_taichi.accuracy.store import Store
from mpp_taichi.accuracy.sweep import StepSweep
from mpp_taichi.accuracy.value_reference import ValueReference
from mpp_taichi.accuracy.value_search import ValueSearch
from mpp_taichi.accuracy.workbench import Workbench
from mpp_taichi.errors import BackendError

FIRST_SHARE_OF_FEW = 0.8  # the same for few particles, for which f32 gains no time
FIRST_SHARE = 0.65  # of the budget, until the end of the first backend and precision, where others follow
ALL_SHARE = 0.96  # of the budget; the rest is for writing the report
OWN_PART = 0.6  # of the share of a backend and precision, where other work follows
SMALL_RUN = 0.01  # seconds of a run with the scene's own setting: the scenes with shorter runs are small
WORTH_RETURNING = 0.2  # of the budget: a larger rest is spent on ladders that were cut short
REPEATS_SHARE_OF_AIM = 0.1
REPEATS_SHARE = 0.25  # of the time for a backend and precision
OWN_SHARE = 1.0 / 60.0  # of the budget, for one run with the scene's own setting; only a part of a longer scene is studied
FEWEST_OWN_STEPS = 64
AROUND = 100.0  # times an aim: steps with larger errors are not tried
MOST_ROUNDED = 4  # methods that are tried in a second precision: the best of the first
FEWEST_ROUNDED = 16  # particles, below which f32 is as slow as f64
ROUNDED_ERROR = 1e-8  # of runs in f64: above it a run in f32 may be as accurate


@dataclass(frozen=True)
class StudyWishes:
    """The options of a study: integrators to try, None for all, and (backend, precision) pairs in turn.

    quantity   the quantity whose errors are compared, None for a choice by the scene; energies need no reference
    aim        the only error of interest: methods are tried around it, and methods of first order are not tried
    small      the budget of a small scene, in place of the given budget, None for the given budget [s]
    """

    integrators: Sequence[str] | None = None
    devices: Sequence[tuple[str, str]] = (("cpu", "f64"), ("cpu", "f32"))
    reference: str | None = None
    quantity: str | None = None
    aim: float | None = None
    small: float | None = None


class Study:
    """Runs as many samples as a budget allows; its results are available at any time.

    `tell` is given a line for a person whenever something new begins.
    """

    def __init__(
        self,
        problem: Problem,
        store: Store,
        budget: Budget,
        wishes: StudyWishes,
        tell: Callable[[str], None] = lambda _: None,
        after_sweep: Callable[["Study", Workbench], None] = lambda *_: None,
        then: Callable[["Study", Workbench, float], None] | None = None,
    ) -> None:
        """Begin without a run; the store may hold the span over which the scene was studied before.

        `after_sweep` is called with each workbench at the end of its runs, while its methods are compiled. `then` is called
        after the runs on the CPU in f64, and may go on there until a share of the budget is spent.
        """
        self._after_sweep, self._then = after_sweep, then
        self.whole = problem.span
        self.problem = problem if store.span is None or problem.wanted else problem.shortened(store.span)
        self.store, self.budget, self.wishes, self.tell = store, budget, wishes, tell
        self.methods = methods(problem, wishes.integrators or ())
        self.own = self.methods[problem.own_method]
        parts = (self.problem, store, budget, self.methods)
        self.search = ReferenceSearch(*parts, wished=wishes.reference, tell=tell)
        self.values = None if problem.wanted is None else ValueSearch(*parts, wished=wishes.reference, tell=tell)
        self.status = "unfinished"
        self.cut: dict[tuple[str, str], int] = {}  # ladders of steps that the budget cut short
        self._remarks: list[str] = []
        self._keeps_energy = False

    def run(self) -> None:
        """Run the study; after the end of the budget, or an exception, the next call continues it."""
        try:
            self._go()
            self.status = "complete" if not self.remarks else "partial"
        except OutOfTime:
            self.status = "out of time"
        finally:
            self.store.save()

    def run_within(self, bench: Workbench) -> None:
        """Run the study with the compiled methods of a workbench, whose device is the only one."""
        try:
            self.store.span = self.problem.span
            self.search.find(bench)
            self._sweep(bench, self._names(), begin=0.0, end=1.0)
            self.status = "complete" if not self.remarks else "partial"
        except OutOfTime:
            self.status = "out of time"
        finally:
            self.store.save()

    def leave_out(self, remark: str) -> None:
        """Note a part of the study that was left out."""
        self._remarks.append(remark)

    # Results

    @property
    def remarks(self) -> list[str]:
        """The parts of the study that were left out, one line each."""
        short = [
            f"{' '.join(device)}: the budget cut {count} ladders of steps short" for device, count in self.cut.items() if count
        ]
        return [*self._remarks, *short]

    @property
    def reference(self) -> ReferenceSolution | None:
        """The positions from which errors are measured."""
        return self.search.reference

    @property
    def value_reference(self) -> ValueReference | None:
        """The values of the wanted quantity from which its errors are measured."""
        return None if self.values is None else self.values.desk.reference

    @property
    def chaos(self) -> Chaos | None:
        """The separation of neighbouring trajectories."""
        return self.search.chaos

    @property
    def conserves_energy(self) -> bool:
        """Whether the scene keeps its energy, as far as a run has shown it."""
        return (
            self._keeps_energy
            or self.search.conserves_energy
            or (self.values is not None and self.values.desk.conserves_energy)
        )

    @property
    def quantity(self) -> str | None:
        """The quantity that is compared, or None where nothing can be compared.

        Energies where the wishes say so, or where they name no quantity and a time before the end was found at which positions
        lose their meaning; else positions, once their reference is known. A wanted quantity once its values are known. Nothing
        takes the place of the positions for which a scene with contacts has a target: its energy does not tell how well
        contacts are found.
        """
        return self._compared.quantity

    @property
    def reason(self) -> str:
        """Why this quantity is compared, or why nothing can be compared; one clause for a person."""
        return self._compared.reason

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
        return self.problem.samples if self.own.adaptive else self.problem.own_steps

    @property
    def _compared(self) -> Compared:
        wishes = self.wishes
        return Compared(self.problem, self.search, self.values, wishes.quantity, wishes.aim is not None, self.conserves_energy)

    def _row(self, sample: Sample, is_own: bool) -> StudyRow:
        position = position_rms = MeasuredError(None)
        if self.reference is not None and self.reference.positions_mean_something:
            position, position_rms = self.reference.errors(sample)
        kept = (sample.energy, sample.momentum, sample.angular_momentum)
        energy, momentum, angular_momentum = (MeasuredError.against(error, ENERGY_BAR) for error in kept)
        wanted = MeasuredError(None) if self.value_reference is None else self.value_reference.error(sample)
        return StudyRow(sample, position, position_rms, energy, momentum, angular_momentum, is_own, wanted)

    def error(self, sample: Sample, quantity: str) -> MeasuredError:
        """The error of a sample in one of QUANTITIES; infinite for a run that broke off."""
        return self._row(sample, False).error(quantity) if sample.status == "ok" else MeasuredError(None)

    def _error(self, sample: Sample) -> float:
        return float("inf") if self.quantity is None else self.error(sample, self.quantity).bound

    def allowed(self, target: float, quantity: str) -> float:
        """The error that is allowed for the part of the run that is studied, where a target is set for the whole run.

        Errors of positions grow up to quadratically, errors of energies linearly. A wanted quantity belongs to the whole run.
        """
        part = self.problem.span / self.whole
        return target * part ** (2 if quantity == "position" else 1)

    @property
    def _aim(self) -> float | None:
        """The only error of interest in the part of the run that is studied, or None."""
        aim = self.wishes.aim
        return None if aim is None else self.allowed(aim, self.quantity or self.wishes.quantity or QUANTITIES[0])

    # Stages of the study

    def _go(self) -> None:
        with Workbench(self.problem, backend=REFERENCE[0], precision=REFERENCE[1]) as bench:
            if self.wishes.small is not None and self._is_small(bench):
                self.budget.seconds = self.wishes.small
            if self.values is None:
                self._choose_span(bench)
            if self.values is not None:
                self._find_values(bench, self.values)
            elif self.wishes.quantity == "energy":
                self._keeps_energy = bench.machine(self.own.name).conserves_energy
            else:
                self._find_reference(bench)
            if self.quantity is None:
                return
            first, *others = self.wishes.devices
            if first == REFERENCE:
                end = self._first_share(others)
                self._sweep(bench, self._names(), begin=0.0, end=end if self._then is None else OWN_PART * end)
                if self._then is not None:
                    self._then(self, bench, end)
                    self.budget.overrun(end)
        self._sweep_each([device for device in self.wishes.devices if device != REFERENCE and self._is_worth(device[1])])
        if (
            self.wishes.aim is None
            and any(self.cut.values())
            and self.budget.left(ALL_SHARE) > WORTH_RETURNING * self.budget.seconds
        ):
            self._sweep_each([device for device in self.wishes.devices if self.cut.get(device)])

    def _find_reference(self, bench: Workbench) -> None:
        try:
            self.search.aim = self._aim
            self.search.find(bench)
            if self.wishes.aim is None:
                self.search.find_chaos(bench)
        finally:
            self.problem = self.search.problem
        if self.reference is not None:
            self.tell(f"reference: {self.reference.told}")
        if self.quantity is None:
            self._remarks.append(self.reason)
        elif self.quantity == "energy":
            self.tell(f"energies are compared: {self.reason}")

    def _find_values(self, bench: Workbench, values: ValueSearch) -> None:
        values.desk.aim = self._aim
        try:
            values.find(bench)
        finally:
            self.problem = values.desk.problem
        if values.desk.reference is not None:
            self.tell(f"reference: {values.desk.reference.told}")
        if self.quantity is None:
            self._remarks.append(self.reason)

    def _first_share(self, others: Sequence[tuple[str, str]]) -> float:
        """The share of the budget at the end of the first backend and precision."""
        if not any(self._is_worth(precision) for _, precision in others):
            return ALL_SHARE
        return FIRST_SHARE_OF_FEW if self.problem.start.particle_count < FEWEST_ROUNDED else FIRST_SHARE

    def _is_worth(self, precision: str) -> bool:
        """Whether runs of a precision other than f64 may reach the aim, and may be faster; or none is in f64."""
        aim = self._aim
        if aim is None or REFERENCE not in self.wishes.devices:
            return True
        return aim > ROUND_OFF.get(precision, 0.0) and self.problem.start.particle_count >= FEWEST_ROUNDED

    def _sweep_each(self, devices: Sequence[tuple[str, str]]) -> None:
        """Divide the remaining budget among backends and precisions; a backend that does not start is left out."""
        for number, (backend, precision) in enumerate(devices):
            begin = self.budget.used
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
        if self.problem.compares_solvers:
            return [name for name in self.methods if name not in exact_solvers()]
        is_stiff = any(method.fewest_steps > 1 for method in self.methods.values())
        least = 1 if self.wishes.aim is None else 2
        stepped = {name: method for name, method in self.methods.items() if name not in exact_solvers()}
        suits = [name for name, method in stepped.items() if (is_stiff or not method.implicit) and method.order >= least]
        return list(dict.fromkeys((self.own.name, *suits)))

    def _best_names(self) -> list[str]:
        """Methods for another precision: the wanted methods, else the scene's own and the front's where rounding permits."""
        if self.wishes.integrators is not None:
            return self._names()
        found = [self.own.name] if self.wishes.aim is None else []
        for row in time_front(self.rows(), self.quantity or "energy"):
            if row.error(self.quantity or "energy").bound > ROUNDED_ERROR:
                found.append(row.sample.configuration.integrator)
        return list(dict.fromkeys(found))[:MOST_ROUNDED]

    def _choose_span(self, bench: Workbench) -> None:
        """Shorten a scene that takes too long for dozens of runs; the store remembers the span, whatever the next budget is."""
        if self.store.span is None:
            own_seconds = self._own_seconds(bench)
            allowed = OWN_SHARE * self.budget.seconds
            if own_seconds > allowed and not self._needs_whole:
                least = min(1.0, FEWEST_OWN_STEPS / self.problem.own_steps)
                part = max(least, allowed / own_seconds)
                self.problem = self.search.problem = self.problem.shortened(self.problem.span * part)
                bench.shorten(self.problem)
            self.store.span = self.problem.span
        if self.problem.span < self.whole:
            self.tell(
                f"studying the first t = {self.problem.span:.6g} of {self.whole:.6g}: all of it does not fit the budget often"
            )

    def _is_small(self, bench: Workbench) -> bool:
        """Whether all runs of a study are short: positions are compared, in one phase, and the scene's own run is short."""
        return self.values is None and len(self.problem.stretches) == 1 and self._own_seconds(bench) < SMALL_RUN

    def _own_seconds(self, bench: Workbench) -> float:
        """The seconds of a run with the scene's own setting, by direct sums as the reference."""
        return self._own_steps * bench.machine(split(self.own.name)[0]).budget_per_step

    @property
    def _needs_whole(self) -> bool:
        """Whether a target is only for the whole run: contacts and later phases do not follow from its first part."""
        return self.wishes.aim is not None and (self.problem.has_contacts or len(self.problem.stretches) > 1)

    def _sweep(self, bench: Workbench, names: list[str], *, begin: float, end: float) -> None:
        if self.quantity is None:
            return
        self.tell(f"{bench.backend} {bench.precision}: {', '.join(names)}")
        known = (self.store, self.budget, self.methods, self._error)
        sweep = StepSweep(bench, *known, promised=promised(self.problem, self.methods), aim=self._aim)
        for machine in bench.machines.values():
            sweep.learn(machine)
        ladders = [self._ladder(self.methods[name]) for name in names]
        repeats = REPEATS_SHARE if self.wishes.aim is None else REPEATS_SHARE_OF_AIM
        try:
            sweep.climb(ladders, share=end - repeats * (end - begin), first=self.own.name)
            sweep.repeat(share=end)
            sweep.weigh(share=end)
        except OutOfTime:  # what was measured is used all the same
            self.cut[bench.backend, bench.precision] = sum(bool(ladder.open_rungs()) for ladder in ladders)
            self._after_sweep(self, bench)
            raise
        self.store.save()
        self.cut[bench.backend, bench.precision] = sweep.left_out
        self._after_sweep(self, bench)

    def _ladder(self, method: StudyMethod) -> Ladder:
        anchor = equal_cost(self.problem, method, self.own)
        floor = ENERGY_BAR
        if self.quantity == "position" and self.reference is not None:
            floor = self.reference.bar
        elif self.value_reference is not None:
            floor = self.value_reference.bar
        coarsest = COARSEST
        if (aim := self._aim) is not None:
            floor, coarsest = max(floor, aim), min(COARSEST, AROUND * aim)
        fewest = float(method.fewest_steps)
        patient, tolerance = self.problem.has_contacts, method.tolerance
        steps = (method.name, method.order, anchor, fewest)
        return Ladder(*steps, floor, coarsest=coarsest, tolerance=tolerance, patient=patient, uneven=self.values is not None)
