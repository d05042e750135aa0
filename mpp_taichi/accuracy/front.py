"""Front: rows that no other row beats in both error and cost, and the cost of ten times less error along them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from mpp_taichi.accuracy.sample import MeasuredError, Sample

QUANTITIES = ("position", "energy")
LEAST_ROWS = 3  # of a front whose price of a digit is computed
COARSEST = 1.0  # an error from which a row is on no front, however cheap it is
ENERGY_BAR = 1e-15  # relative rounding error of a sum of energies


@dataclass(frozen=True, eq=False)
class StudyRow:
    """A sample with its errors, as far as the reference shows them."""

    sample: Sample
    position: MeasuredError  # largest over the particles, relative to the size of the system
    position_rms: MeasuredError
    energy: MeasuredError
    momentum: MeasuredError
    angular_momentum: MeasuredError
    is_own: bool = False
    wanted: MeasuredError = MeasuredError(None)  # of the wanted quantity of `expect:`

    def error(self, quantity: str) -> MeasuredError:
        """The error of one of QUANTITIES; for every other name, the error of the wanted quantity."""
        return {"position": self.position, "energy": self.energy}.get(quantity, self.wanted)

    @property
    def seconds(self) -> float | None:
        """The median time of the repeats."""
        return self.sample.median_seconds


def front(points: Sequence[tuple[float, float]]) -> list[int]:
    """Indices of the points (error, cost) for which no other point is as good in both and better in one; by falling error."""
    kept: list[int] = []
    least = math.inf
    for index in sorted(range(len(points)), key=lambda index: (points[index][1], points[index][0])):
        error, cost = points[index]
        if not (math.isfinite(error) and math.isfinite(cost)):
            continue
        twin = bool(kept) and points[kept[-1]] == (error, cost)
        if error < least or twin:
            kept.append(index)
            least = error
    return kept


def time_front(rows: Sequence[StudyRow], quantity: str) -> list[StudyRow]:
    """The front in error and median seconds, coarse to fine."""
    told = [row for row in rows if _counts(row, quantity) and row.seconds is not None]
    return [told[index] for index in front([(row.error(quantity).bound, row.seconds or math.inf) for row in told])]


def evaluation_front(rows: Sequence[StudyRow], quantity: str) -> list[StudyRow]:
    """The front in error and force evaluations, coarse to fine; evaluations of one precision and backend cost alike."""
    told = [row for row in rows if _counts(row, quantity)]
    return [told[index] for index in front([(row.error(quantity).bound, float(row.sample.evaluations)) for row in told])]


def _counts(row: StudyRow, quantity: str) -> bool:
    return row.sample.status == "ok" and row.error(quantity).bound < COARSEST


def price_of_a_digit(errors: Sequence[float], costs: Sequence[float]) -> float | None:
    """The factor by which the cost grows where the error falls to a tenth: 10^s, s the slope of log cost on −log error.

    The slope is found by least squares. None for fewer than LEAST_ROWS points, or for equal errors.
    """
    if len(errors) < LEAST_ROWS:
        return None
    x = [-math.log10(error) for error in errors]
    y = [math.log10(cost) for cost in costs]
    middle_x, middle_y = sum(x) / len(x), sum(y) / len(y)
    spread = sum((each - middle_x) ** 2 for each in x)
    if spread == 0.0:
        return None
    return 10.0 ** (sum((a - middle_x) * (b - middle_y) for a, b in zip(x, y)) / spread)
