"""Reference search: the reference of a study, or the time at which the positions lose their meaning.

A reference is found by event-driven flight, by an adaptive method where bodies may meet closely, else by repeatedly halved
steps. Where its share of the budget ends before the reference is known well enough, the search goes on for up to MOST_BUDGETS
times the budget: without a reference nothing can be said about positions. The search ends earlier where chaos was found.
"""

import contextlib
import functools
from collections.abc import Callable

from mpp_taichi.accuracy import adaptive_reference, flight_reference
from mpp_taichi.accuracy import chaos as chaos_of
from mpp_taichi.accuracy.budget import Budget, OutOfTime
from mpp_taichi.accuracy.chaos import Chaos
from mpp_taichi.accuracy.contact_methods import exact_solvers
from mpp_taichi.accuracy.families import meets
from mpp_taichi.accuracy.machine import Machine
from mpp_taichi.accuracy.methods import LOOKS, StudyMethod, first_steps, for_reference, leads
from mpp_taichi.accuracy.problem import Problem
from mpp_taichi.accuracy.reference import Convergence, ReferenceSolution, Refinement, converge
from mpp_taichi.accuracy.reference_machines import DEVICE, MOST_BUDGETS, SHARE, machine_of
from mpp_taichi.accuracy.sample import Configuration, Sample
from mpp_taichi.accuracy.scattered_convergence import ScatteredConvergence
from mpp_taichi.accuracy.store import Store
from mpp_taichi.accuracy.sweep import timed
from mpp_taichi.accuracy.workbench import Workbench
from mpp_taichi.errors import MppError

LEAST_SHARE, MOST_SHARE = 0.15, 0.45
END_SHARE = 0.65  # of the budget: no further reference and no chaos is looked for later
CHAOS_SHARE = 0.5  # of the time left until END_SHARE
WELL_KNOWN = 1e-12  # an error bar below which no better reference is tried
WITHIN_AIM = 0.1  # of an aim: no better reference is tried below this error bar
WELL_BEFORE = 0.6  # of the time at which positions lose their meaning: earlier, the effect of round-off is still small
FEWEST_COLLISIONS = 10  # in the part of a run with contacts that is studied
ALIKE = 1.5  # ratio of two Lyapunov times, found with different steps, below which both are trusted


class ReferenceSearch:
    """Finds the reference of one study; its results are available at any time.

    aim                the only error of interest, or None
    problem            the part of the scene that is studied: shortened where collisions lose their order by round-off
    reference, chaos   None until they are found
    horizon            time before the end at which positions were found to lose their meaning [time]; None where none was found
    """

    def __init__(
        self,
        problem: Problem,
        store: Store,
        budget: Budget,
        methods: dict[str, StudyMethod],
        *,
        wished: str | None = None,
        aim: float | None = None,
        tell: Callable[[str], None],
    ) -> None:
        """Begin without a reference; `wished` names the only method that may give it."""
        self.problem, self.store, self.budget, self.methods = problem, store, budget, methods
        self.wished, self.tell = wished, tell
        self._own = methods[problem.own_method]
        self.aim = aim
        self.reference: ReferenceSolution | None = None
        self.chaos: Chaos | None = None
        self.conserves_energy = False
        self._runs: tuple[Machine, Refinement] | None = None
        self._share = SHARE
        self._tried: set[str] = set()
        self._lyapunov_is_trusted = False

    @property
    def horizon(self) -> float | None:
        """See the class."""
        if self.reference is None or self.reference.positions_mean_something:
            return None
        if self.reference.horizon is not None:
            return self.reference.horizon
        found = None if self.chaos is None else self.chaos.horizon(DEVICE[1])
        return found if found is not None and self._lyapunov_is_trusted and found < self.problem.span else None

    def find(self, bench: Workbench) -> None:
        """Find the reference of the scene, or the time at which its positions lose their meaning.

        Raises:
            OutOfTime: MOST_BUDGETS times the budget were spent, and neither is known.
        """
        if not (self._recall() or self._fly(bench) or self._within_share(bench)):
            share = f"{self._share:.0%} of the budget"
            self.tell(f"the reference needs more than {share}: up to {MOST_BUDGETS:g} budgets are spent to find it")
            with self.budget.beyond(MOST_BUDGETS, self._share):
                settled = (self.wished is None or leads(self.problem)) and self._by_adaptive(bench)
                if not (settled or self._by_chaos(bench) or leads(self.problem)):
                    self._halve(bench, share=1.0)
        if self.reference is not None and self.reference.integrator not in exact_solvers():
            self._take(self._finer(bench, self.reference))
        self.budget.overrun(self._share)

    @property
    def _enough(self) -> float:
        """An error bar below which no better reference is tried."""
        return WELL_KNOWN if self.aim is None else WITHIN_AIM * self.aim

    @property
    def is_settled(self) -> bool:
        """Whether positions can be compared, or are known to have no meaning at the end."""
        known = self.reference is not None and self.reference.positions_mean_something
        return known or self.horizon is not None

    # The ways to a reference: each returns whether the search is settled

    def _recall(self) -> bool:
        """Take the reference and the chaos that the store has."""
        known, chaos = self.store.notes.get("reference"), self.store.notes.get("chaos")
        if chaos is not None:
            self.chaos = Chaos(chaos["lyapunov_time"], chaos["rise"], chaos["span"])
            self._lyapunov_is_trusted = bool(self.store.notes.get("chaos_is_trusted"))
        if known is None:
            return False
        asked = (known["control"], known["tolerance"])
        kept = self.store.get(Configuration(known["integrator"], known["steps"], DEVICE[1], DEVICE[0], *asked))
        if kept is None or kept.end is None:
            return False
        self.reference = ReferenceSolution(**known, end=kept.end)
        self.conserves_energy = kept.energy is not None
        return self.is_settled

    def _fly(self, bench: Workbench) -> bool:
        """Use exact flight as the reference, over the part of the run in which round-off does not decide the collisions.

        Where too little happens in that part, it is the whole, for energies.
        """
        exact = next((name for name in exact_solvers() if name in self.methods), None)
        machine, whole = None if exact is None else self._machine(bench, exact), self.problem
        if machine is None:
            return False
        while (found := flight_reference.fly(machine, self.budget)) is not None:
            reference, sample = found
            part = WELL_BEFORE * reference.meaning if reference.meaning else self.problem.span / LOOKS
            if reference.trusted or sample.evaluations < FEWEST_COLLISIONS or self.aim is not None:
                break
            self._look_at(bench, self.problem.shortened(part))
        if found is not None and not reference.trusted:
            self._look_at(bench, whole)
            found = flight_reference.fly(machine, self.budget)
        if found is None:
            return False
        reference, sample = found
        self._add(machine, sample)
        self._take(reference)
        if self.problem.span < whole.span:
            self.tell(f"studying the first t = {self.problem.span:.6g}, in which no round-off grows to be seen")
        return True

    def _within_share(self, bench: Workbench) -> bool:
        """Halve the steps within a share of the budget, then try the adaptive method, and look for chaos.

        Where bodies may meet closely, equal steps converge late: there an adaptive method that compiles fast comes first.
        """
        with contextlib.suppress(OutOfTime):
            if leads(self.problem):
                return self._by_adaptive(bench)
            if self.wished is None and meets(self.problem) and self._by_adaptive(bench, quick=True):
                return True
            # However long the compiler took, some time must be left to halve a step twice.
            self._share = min(max(SHARE, self.budget.used + LEAST_SHARE), MOST_SHARE)
            self._halve(bench, share=self._share)
            return self.is_settled or (self.wished is None and self._by_adaptive(bench)) or self._by_chaos(bench)
        return False

    def _by_adaptive(self, bench: Workbench, *, quick: bool = False) -> bool:
        """The reference by an adaptive method, or the horizon that it finds; `quick`: without methods that compile slowly."""
        names = adaptive_reference.candidates(self.methods)
        for name in [name for name in names if not (quick and self.methods[name].slow_to_compile)]:
            machine = None if name in self._tried else self._machine(bench, name)
            if machine is None or self._costs_too_much(machine):
                continue
            self._tried.add(name)
            found = adaptive_reference.alone(machine, self.budget, add=functools.partial(self._add, machine))
            if found is not None and (found.positions_mean_something or found.horizon is not None):
                self._take(found)
                return True
            if found is not None and self.reference is None and leads(self.problem):  # there is no other way to a reference
                self._take(found)
        return False

    def _by_chaos(self, bench: Workbench) -> bool:
        """A horizon by the Lyapunov time, where two measurements with different steps agree."""
        if self.chaos is not None or self.reference is None or self.problem.has_contacts:
            return False
        method = self.methods[self.reference.integrator]
        machine, steps = bench.machine(method.name), max(chaos_of.PIECES, self.reference.steps // 4)
        # Two neighbouring trajectories, with all steps and with half of them.
        if 2.0 * 1.5 * steps * machine.budget_per_step > self.budget.left(END_SHARE):
            return False
        coarse, fine = (chaos_of.measure(machine, count, self.reference.size, self.budget) for count in (steps // 2, steps))
        self._note_chaos(fine)
        both = [found.lyapunov_time for found in (coarse, fine) if found.lyapunov_time is not None]
        if len(both) == 2 and max(both) < ALIKE * min(both):
            self._lyapunov_is_trusted = self.store.notes["chaos_is_trusted"] = True
        return self.is_settled

    # Parts

    def _halve(self, bench: Workbench, *, share: float) -> None:
        """Halve the steps until the reference is known well enough, or the share of the budget is spent."""
        if self._runs is None:
            machine, steps = self._halved_machine(bench)
            known = self.store.notes.get("reference")
            if known is not None and known["integrator"] == machine.name:
                steps = max(steps, known["steps"] // 2)
            kind = ScatteredConvergence if self.problem.has_contacts else Convergence
            self._runs = machine, kind(machine.order, steps, enough=0.0 if self.aim is None else self._enough)
        machine, runs = self._runs
        try:
            converge(runs, machine, self.budget, share=share, add=lambda sample: self._add(machine, sample))
        finally:
            if runs.runs:
                self._take(runs.reference())

    def _finer(self, bench: Workbench, known: ReferenceSolution) -> ReferenceSolution:
        """Replace the reference by that of an adaptive method, where round-off limits the known one and time is left."""
        for name in adaptive_reference.candidates(self.methods):
            if self.wished is not None or not known.trusted or known.bar <= self._enough or 2.0 * self.budget.used > END_SHARE:
                return known
            machine = None if name in self._tried or name == known.integrator else self._machine(bench, name)
            if machine is not None and not self._costs_too_much(machine):
                self._tried.add(name)
                add = functools.partial(self._add, machine)
                known = adaptive_reference.finer(machine, known, self.budget, add=add)
        return known

    def _costs_too_much(self, machine: Machine) -> bool:
        needed = len(adaptive_reference.tolerances(machine.name)) * LOOKS * machine.budget_per_step
        return needed > self.budget.left(END_SHARE)

    def _machine(self, bench: Workbench, name: str) -> Machine | None:
        """See machine_of."""
        return machine_of(bench, name, self.methods, self.budget)

    def _halved_machine(self, bench: Workbench) -> tuple[Machine, int]:
        """The most promising method that the scene allows, and its first number of steps."""
        promising = [self._own] if self.problem.compares_solvers else for_reference(self.methods)
        if self.wished is not None:
            promising = [self.methods[self.wished]]
        for method in promising:
            if (machine := self._machine(bench, method.name)) is not None:
                return machine, first_steps(self.problem, method, self._own)
        raise MppError("no integrator of the catalogue can serve as a reference for this scene")

    def _look_at(self, bench: Workbench, problem: Problem) -> None:
        """Study this part of the run from now on."""
        self.problem = problem
        bench.shorten(problem)
        self.store.span = problem.span

    def _add(self, machine: Machine, sample: Sample) -> None:
        timed(machine, sample, self.budget)
        self.store.add(sample)
        self.conserves_energy = sample.energy is not None

    def _take(self, reference: ReferenceSolution) -> None:
        self.reference = reference
        self.store.notes["reference"] = reference.facts()

    def _note_chaos(self, chaos: Chaos) -> None:
        self.chaos = chaos
        self.store.notes["chaos"] = vars(chaos)

    def find_chaos(self, bench: Workbench) -> None:
        """Measure the Lyapunov time, for the report, where the budget allows it."""
        if self.chaos is not None or self.reference is None or self.problem.has_contacts:
            return
        machine, steps = bench.machine(self.reference.integrator), chaos_of.PIECES
        if self.reference.tolerance is None:
            method = self.methods[self.reference.integrator]
            steps = max(first_steps(self.problem, method, self._own), self.reference.steps // 4, steps)
        if 2.0 * steps * machine.budget_per_step < CHAOS_SHARE * self.budget.left(END_SHARE):
            self._note_chaos(chaos_of.measure(machine, steps, self.reference.size, self.budget))
