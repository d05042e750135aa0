"""Phase studies: the cost of accuracy in each phase of a timeline alone, from the state with which the reference begins it.

The methods that are compiled for the whole run are run over each phase, in f64 on the CPU. Errors of earlier phases are not
part of the errors of a phase, and the size of the system is its size in this phase.
"""

from collections.abc import Callable
from dataclasses import dataclass

from mpp_taichi.accuracy.budget import Budget
from mpp_taichi.accuracy.contact_methods import exact_solvers
from mpp_taichi.accuracy.problem import Problem
from mpp_taichi.accuracy.store import Store
from mpp_taichi.accuracy.stretches import Stretch
from mpp_taichi.accuracy.study import Study, StudyWishes
from mpp_taichi.accuracy.workbench import Workbench

MOST_PHASES = 12  # that are studied: those that take the most steps


@dataclass(frozen=True, eq=False)
class PhaseStudy:
    """A phase and its study."""

    stretch: Stretch
    study: Study

    @property
    def told(self) -> str:
        """`phase 2, t = 3 to 7.3, after forces.linear_drag.coefficient`."""
        changed = f", after {', '.join(self.stretch.changes)}" if self.stretch.changes else ""
        return f"phase {self.stretch.number + 1}, t = {self.stretch.began:.6g} to {self.stretch.ended:.6g}{changed}"


def chosen_phases(problem: Problem) -> list[Stretch]:
    """The phases to be studied, in the order of time; none where there is only one."""
    if len(problem.stretches) == 1:
        return []
    longest = sorted(problem.stretches, key=lambda stretch: -stretch.share)[:MOST_PHASES]
    return sorted(longest, key=lambda stretch: stretch.began)


class PhaseStudies:
    """The studies of the phases of one study: `run` them while its methods are compiled."""

    def __init__(self, tell: Callable[[str], None] = lambda _: None) -> None:
        """Begin without a phase."""
        self.found: list[PhaseStudy] = []
        self._tell = tell

    def run(self, whole: Study, bench: Workbench, share: float) -> None:
        """Study the phases by the compiled methods until a share of the budget of the whole study is spent.

        Raises:
            OutOfTime: the budget ended while the reference was followed to the begins of the phases.
        """
        problem, reference, budget = whole.problem, whole.reference, whole.budget
        chosen = chosen_phases(problem)
        if not chosen or reference is None or not reference.positions_mean_something:
            return
        machine = bench.machine(reference.integrator)
        _, trace = machine.run(machine.configuration(reference.steps, reference.tolerance), budget, follow=True)
        if trace is None:
            return
        begins = dict(zip((stretch.number for stretch in problem.stretches), trace.begins))
        names = [name for name in whole.methods if name in bench.machines and name not in exact_solvers()]
        halved = reference.integrator if reference.tolerance is None and reference.integrator in names else None
        wishes = StudyWishes(names, ((bench.backend, bench.precision),), reference=halved)
        try:
            for done, stretch in enumerate(chosen):
                seconds = budget.left(share) / (len(chosen) - done)
                if seconds <= 0.0:
                    whole.leave_out(f"the budget ended before phase {stretch.number + 1} was studied alone")
                    return
                part = problem.of_stretch(stretch, *begins[stretch.number])
                bench.shorten(part)
                known = {**whole.store.known, "scene": part.identity(), "asked_span": part.span}
                store = Store(whole.store.folder.parent, known)
                found = PhaseStudy(stretch, Study(part, store, Budget(seconds, budget.look, budget.clock), wishes))
                self._tell(found.told)
                self.found.append(found)
                found.study.run_within(bench)
        finally:
            bench.shorten(problem)
