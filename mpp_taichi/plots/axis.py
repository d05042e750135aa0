"""An axis: the place of a value on it, ticks at round numbers, and limits that grow so seldom that the eye can follow."""

import math
from dataclasses import dataclass

import numpy as np

ROOM = 0.02  # of the span, beyond the outermost values, so that no curve runs along the edge
STEPS = 8.0  # parts of an axis; its ends are rounded to such a part
FLAT = 1e-3  # of its values, the least span of an axis: values that vary less are constant to the eye
LONGEST_LABEL = 1e5
SHORTEST_LABEL = 1e-3
_SUPERSCRIPTS = str.maketrans("0123456789-", "⁰¹²³⁴⁵⁶⁷⁸⁹⁻")


@dataclass(frozen=True)
class Tick:
    """A tick of an axis: its place, 0…1, and its label."""

    share: float
    label: str


@dataclass(frozen=True)
class Axis:
    """Limits; of a logarithmic axis they are decadic logarithms."""

    low: float
    high: float
    logarithmic: bool = False

    def share(self, values: np.ndarray) -> np.ndarray:
        """The places of values on the axis, 0…1 between the limits; NaN for a value without a logarithm."""
        return (self._of(values) - self.low) / (self.high - self.low)

    def value(self, share: float) -> float:
        """The value at a place of the axis."""
        value = self.low + share * (self.high - self.low)
        return 10.0**value if self.logarithmic else value

    def covers(self, values: np.ndarray) -> bool:
        """Whether every value that has a place lies between the limits."""
        extent = self._extent(values)
        return extent is None or (self.low <= extent[0] and extent[1] <= self.high)

    def spreads(self, values: np.ndarray) -> bool:
        """Whether values differ so much that limits can be chosen for them."""
        low, high = self._extent(values) or (0.0, 0.0)
        return high - low > FLAT * max(abs(low), abs(high))

    @staticmethod
    def above_zero(values: np.ndarray) -> "Axis":
        """From zero to a round number a little above the largest value."""
        largest = max((1.0 + ROOM) * float(np.max(values, initial=0.0)), 1e-300)
        step = round_step(largest / STEPS)
        return Axis(0.0, math.ceil(largest / step) * step)

    def grown(self, values: np.ndarray) -> "Axis":
        """This axis, made longer where these values need more room; `values` must be all values, so that both ends get room."""
        wanted = Axis.of(values, logarithmic=self.logarithmic)
        return Axis(min(self.low, wanted.low), max(self.high, wanted.high), self.logarithmic)

    @staticmethod
    def of(values: np.ndarray, *, logarithmic: bool = False) -> "Axis":
        """The axis that fits these values, with round ends."""
        axis = Axis(0.0, 1.0, logarithmic)
        low, high = axis._extent(values) or (0.0, 1.0)
        if logarithmic:
            return Axis(math.floor(low), max(math.ceil(high), math.floor(low) + 1.0), True)
        if high - low < FLAT * max(abs(low), abs(high)) or high == low:
            room = FLAT * max(abs(low), abs(high)) or 1.0
            low, high = low - room, high + room
        room, step = ROOM * (high - low), round_step((high - low) / STEPS)
        return Axis(math.floor((low - room) / step) * step, math.ceil((high + room) / step) * step)

    def ticks(self, most: int) -> tuple[list[Tick], str]:
        """At most `most` ticks, and the power of ten that is taken out of their labels, `×10⁻³` or nothing."""
        if self.logarithmic:
            low, high = math.ceil(self.low - 1e-9), math.floor(self.high + 1e-9)
            every = max(1, -(-(high - low) // max(most - 1, 1)))
            return [Tick(self._place(n), power_of_ten(n)) for n in range(low, high + 1, every)], ""
        step = round_step((self.high - self.low) / max(most, 1))
        first, last = math.ceil(self.low / step - 1e-9), math.floor(self.high / step + 1e-9)
        largest = max(abs(self.low), abs(self.high))
        power = 0
        if largest >= LONGEST_LABEL or largest < SHORTEST_LABEL * 10.0:
            power = 3 * math.floor(math.log10(largest) / 3.0 + 1e-12) if largest > 0.0 else 0
        digits = max(0, -math.floor(math.log10(step) - power + 1e-9))
        labels = [f"{number * step / 10.0**power:.{digits}f}".replace("-", "−") for number in range(first, last + 1)]
        marks = [Tick(self._place(number * step), label) for number, label in zip(range(first, last + 1), labels)]
        return marks, f"×{power_of_ten(power)}" if power else ""

    def _place(self, value: float) -> float:
        return (value - self.low) / (self.high - self.low)

    def _of(self, values: np.ndarray) -> np.ndarray:
        if not self.logarithmic:
            return values
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.log10(np.where(values > 0.0, values, np.nan))

    def _extent(self, values: np.ndarray) -> tuple[float, float] | None:
        found = self._of(np.asarray(values, dtype=float))
        found = found[np.isfinite(found)]
        return (float(found.min()), float(found.max())) if found.size else None


def round_step(rough: float) -> float:
    """The least of the numbers 1, 2, 5 × 10ⁿ that is not below `rough`."""
    if not (rough > 0.0 and math.isfinite(rough)):
        return 1.0
    decade = 10.0 ** math.floor(math.log10(rough))
    return next(factor * decade for factor in (1.0, 2.0, 5.0, 10.0) if factor * decade >= rough * (1.0 - 1e-9))


def power_of_ten(power: int) -> str:
    """`10⁻³`."""
    return "10" + str(power).translate(_SUPERSCRIPTS)
