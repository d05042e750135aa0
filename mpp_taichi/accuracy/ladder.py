"""Ladder: the steps with which one method is tried in turn, from the step at which it costs as much as the scene's setting.

Rung k has N₀ qᵏ steps, with q = √10 for low orders, 2 for orders above 4, whose errors fall too fast for more. Rungs are added
at both ends until the method is no longer stable or accurate at one end, and the error no longer falls at the other. An
adaptive method has at rung k its default tolerance over 10ᵏ, or over √10ᵏ where the error grows with its square.
"""

import math
from dataclasses import dataclass, field

FEWEST_STEPS = 4
COARSEST = 0.3  # an error above which coarser steps are of no interest
GAIN = 1.5  # the least factor by which a rung must reduce the error; otherwise round-off is reached
LOOSEST = 1e-2  # tolerance


def ratio(order: int) -> float:
    """The ratio of the numbers of steps of two neighbouring rungs."""
    return math.sqrt(10.0) if order <= 4 else 2.0


@dataclass(eq=False)
class Ladder:
    """Rungs of one method at one precision.

    anchor       steps of rung 0
    least        steps below which the method is not stable
    floor        the error below which the reference shows nothing
    coarsest     the error above which coarser steps are of no interest
    tolerance    of rung 0 of an adaptive method, which takes `anchor` samples at every rung; else None
    patient      continue where a rung reduces the error little: errors of contacts fall irregularly
    uneven       continue after one such rung: the error of a single number may change its sign, and be small by chance
    """

    integrator: str
    order: int
    anchor: float
    least: float
    floor: float
    errors: dict[int, float] = field(default_factory=dict)
    coarsest: float = COARSEST
    tolerance: float | None = None
    patient: bool = False
    uneven: bool = False
    closed_below: bool = False
    closed_above: bool = False

    def steps(self, rung: int) -> int:
        """The number of steps of a rung."""
        return max(1, round(self.anchor * (ratio(self.order) ** rung if self.tolerance is None else 1.0)))

    def asked(self, rung: int) -> float | None:
        """The tolerance of a rung."""
        return None if self.tolerance is None else self.tolerance / (10.0 if self.order > 2 else math.sqrt(10.0)) ** rung

    def open_rungs(self) -> list[int]:
        """Rungs to be tried next, at most one at each end."""
        if not self.errors:
            if self.closed_above:
                return []
            first = 0
            while self.steps(first) < max(self.least, FEWEST_STEPS):
                first += 1
            return [first]
        below, above = min(self.errors) - 1, max(self.errors) + 1
        coarser = self.asked(below)
        if coarser is not None:
            self.closed_below |= coarser > LOOSEST
        elif self.steps(below) < max(FEWEST_STEPS, self.least) or self.steps(below) == self.steps(below + 1):
            self.closed_below = True
        return [rung for rung, closed in ((below, self.closed_below), (above, self.closed_above)) if not closed]

    def note(self, rung: int, error: float) -> None:
        """Note the error of a rung; infinite for a run that broke off."""
        self.errors[rung] = error
        if rung == min(self.errors) and not error < self.coarsest:
            self.closed_below = True
        if rung == max(self.errors):
            coarser = self.errors.get(rung - 1)
            gained = (
                self.patient or coarser is None or not math.isfinite(coarser) or coarser > COARSEST or error * GAIN < coarser
            )
            before, before_it = self.errors.get(rung - 1, math.inf), self.errors.get(rung - 2, math.inf)
            if self.uneven and not gained and before * GAIN < before_it:
                gained = True
            self.closed_above = error <= self.floor or not gained

    def close(self, rung: int) -> None:
        """Note a rung that is too expensive to be tried, so that no finer rung is tried either."""
        if not self.errors or rung > max(self.errors):
            self.closed_above = True
        if not self.errors or rung < min(self.errors):
            self.closed_below = True
