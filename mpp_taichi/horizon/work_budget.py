"""Work budget: the work that the search for a horizon may take, and the part of the run that it can follow for this."""

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from mpp_taichi.simulation.step_work import work_of_step

if TYPE_CHECKING:
    from mpp_taichi.simulation.simulation import Simulation

SHARE = 0.02  # of the work of the run
LEAST_WORK = 15_000_000  # in units of `step.plans`, tens of milliseconds: about 2 % of what a short run takes with its start
FINE_PART = 0.25  # of the followed part, where the run and its coarse rerun stay together
COARSE_COST, FINE_COST = 0.5, 2.0  # of reruns with steps of 2 dt and dt / 2, over the cost of the same part of the run


@dataclass(frozen=True)
class WorkBudget:
    """The work of one step of the run, and of its whole length; the search may take `share` of it, or `least` if that is more.

    The numbers depend on the scene alone and not on the clock, so that every machine finds the same horizon.
    """

    step: float
    run: float
    share: float
    least: float

    @property
    def steps(self) -> float:
        """Steps of the run, or evaluations of an adaptive method."""
        return self.run / self.step

    @property
    def allowed(self) -> float:
        """Work that the search may take."""
        return max(self.share * self.run, self.least)

    @property
    def part(self) -> float:
        """Part of the run that it and its coarse rerun can be followed, at most 1; FINE_PART of it by the fine rerun.

        The fine rerun is needed only where the other two part, and then it is followed as far as the budget allows.
        """
        return min(1.0, self.allowed / (self.run * (1.0 + COARSE_COST + FINE_COST * FINE_PART)))

    def fine_steps(self, spent: float) -> float:
        """Steps of the run that the fine rerun can be followed, after work of so many steps."""
        return max(0.0, self.allowed / self.step - spent) / FINE_COST

    def with_steps(self, steps: float) -> "WorkBudget":
        """The budget for a run of another number of steps."""
        return replace(self, run=steps * self.step)


def budget_of(simulation: "Simulation", steps: float, share: float, least: float) -> WorkBudget:
    """The budget for a run of so many steps.

    Of a method that chooses its steps it is for so many evaluations, of event-driven flight for so many contacts.
    """
    step = work_of_step(simulation)
    return WorkBudget(step, steps * step, share, least)
