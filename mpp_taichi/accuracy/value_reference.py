"""Value reference: the values of a wanted quantity from which the errors of other runs are measured, with their bars."""

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from mpp_taichi.accuracy.measuring import means
from mpp_taichi.accuracy.reference import FALLING, FLOOR, LUCK, MEANING, ROUND_OFF
from mpp_taichi.accuracy.sample import MeasuredError, Sample
from mpp_taichi.accuracy.wanted import Wanted

EPSILON = 2.0**-52
STUDENT = 2.57  # standard errors of a mean of six runs that it exceeds in one of twenty cases (Student's t, five degrees)


@dataclass(frozen=True)
class ValueReference:
    """Values of a quantity, one number for each entry of `expect:`.

    values, bars   of each entry, and the largest error of this value, in the unit of the quantity
    scatters       standard deviation of single runs whose starts differ by rounding; 0 where one run is enough
    scales         by which errors are divided: |value|; 1 for entries that are errors themselves, and for values that are 0
                   within twice their bars, or below 10⁻¹³ without a unit, so that the error is absolute
    runs           of every setting; with more than one, mean values are compared
    samples        in a run of a method that needs no step
    shift          by which the starts of the runs differ, see Wanted; 0 for roundings
    differences    of each pair of runs over the scale, the largest of the entries, coarse to fine
    """

    name: str
    labels: list[str]
    values: list[float]
    bars: list[float]
    scatters: list[float]
    scales: list[float]
    runs: int
    samples: int
    trusted: bool
    integrator: str
    steps: int
    differences: list[float] = field(default_factory=list)
    control: str = ""
    tolerance: float | None = None
    shift: float = 0.0

    @property
    def bar(self) -> float:
        """The largest bar over its scale."""
        return max(bar / scale for bar, scale in zip(self.bars, self.scales))

    @property
    def scatter(self) -> float:
        """The largest scatter of single runs over its scale."""
        return max(scatter / scale for scatter, scale in zip(self.scatters, self.scales))

    def error(self, sample: Sample) -> MeasuredError:
        """The largest error of the entries: |value − reference| / scale, of means where the quantity scatters.

        The bar of a mean of n runs is Student's t times its standard error, scatter / √n, together with the bar of the
        reference.
        """
        if sample.status != "ok" or not sample.values:
            return MeasuredError(None)
        mean, deviation, distinct = means(sample.values)
        found = []
        for k, scale in enumerate(self.scales):
            own = STUDENT * max(float(deviation[k]), self.scatters[k]) / math.sqrt(distinct)
            bar = max(math.hypot(self.bars[k], own), EPSILON * scale)
            found.append(MeasuredError.against(abs(float(mean[k]) - self.values[k]) / scale, bar / scale))
        return max(found, key=lambda error: error.bound)

    @property
    def told(self) -> str:
        """`orbital_period(of=earth, around=sun) = 6.28318530718 ± 4e-15, by taylor in f64, tolerance = 1e-15`."""
        shown = "; ".join(self._value(k) for k in range(min(3, len(self.values))))
        more = f"; and {len(self.values) - 3} more" if len(self.values) > 3 else ""
        how = f"{self.steps:,} steps" if self.tolerance is None else f"{self.control} = {self.tolerance:.2g}"
        each = f", mean of {self.runs} runs" if self.runs > 1 else ""
        sure = "" if self.trusted else ", not shown to have converged"
        return f"{shown}{more}, by {self.integrator} in f64, {how}{each}{sure}"

    def _value(self, number: int) -> str:
        value, bar = self.values[number], self.bars[number]
        digits = 15 if not 0.0 < bar < abs(value) else min(15, max(2, 2 - math.floor(math.log10(bar / abs(value)))))
        return f"{self.labels[number]} = {value:.{digits}g} ± {bar:.0e}"

    def facts(self) -> dict[str, Any]:
        """The reference as plain data."""
        return dict(vars(self))


def scales_of(wanted: Wanted, values: np.ndarray, bars: np.ndarray) -> np.ndarray:
    """The scale of each entry, see ValueReference."""
    scales = np.abs(values)
    for k, value in enumerate(np.abs(values)):
        nothing = value <= 2.0 * bars[k] or (wanted.is_pure_number(k) and value < ROUND_OFF)
        if wanted.is_absolute(k) or nothing:
            scales[k] = 1.0
    return scales


class ValueConvergence:
    """Values of runs with repeatedly halved steps: `add` each run, until the differences are small: `is_enough`.

    A difference of two numbers may be 0 by chance, where that of all positions would not be. So the differences d count as
    falling no faster than before: the bar of the last is at least d₋₁² / d₋₂, or 2^−(order + 1) d₋₁ where d₋₂ is not known.
    Apart from this the best pair of runs gives the reference, and the bar, as in `reference.Convergence`.

    enough   an error bar over the scale, below which no finer run is wanted
    """

    def __init__(self, wanted: Wanted, order: int, *, enough: float) -> None:
        """Begin without a run."""
        self.wanted, self.order, self.enough = wanted, order, enough
        self.runs: list[tuple[Sample, np.ndarray]] = []

    def add(self, sample: Sample, values: np.ndarray) -> None:
        """Add the next run, of twice the steps."""
        self.runs.append((sample, values))

    def differences(self) -> list[float]:
        """Of each pair of runs, the largest over the entries, over the scale."""
        return [float(np.max(row)) for row in self._differences() / self._scales()]

    @property
    def is_enough(self) -> bool:
        """Whether finer runs would show nothing new."""
        if len(self.runs) < 3:
            return False
        found = self.differences()
        if found[-2] < FLOOR and found[-1] > found[-2] / FALLING:
            return True
        rises = len(found) > 2 and found[-3] < found[-2] < found[-1]
        return self.is_trusted and (rises or float(np.max(self.bars() / self._scales())) <= self.enough)

    @property
    def best(self) -> int:
        """The number of the finer run of the pair that agrees best."""
        found = self.differences()
        return 1 + min(range(len(found)), key=found.__getitem__, default=-1)

    @property
    def is_trusted(self) -> bool:
        """Whether convergence was seen."""
        found, best = self.differences(), self.best - 1
        if len(found) < 2 or not found[best] < MEANING:
            return False
        return (best > 0 and found[best - 1] >= FALLING * found[best]) or max(found[-2:]) < FLOOR

    def bars(self) -> np.ndarray:
        """The bar of each entry."""
        best = self.best - 1
        if best < 0:
            return np.full(len(self.wanted.entries), math.inf)
        here, values = self._differences()[best], self.runs[best + 1][1]
        bars = np.maximum(here, EPSILON * np.abs(values))
        if best > 0:
            before = self._differences()[best - 1]
            slow = before < FALLING * here
            fall = before / np.maximum(self._differences()[best - 2], 1e-300) if best > 1 else 0.5 ** (self.order + 1)
            bars = np.maximum(bars, before * np.minimum(fall, 1.0))
            bars = np.where(slow, np.maximum(before, here / np.maximum(before / np.maximum(here, 1e-300) - 1.0, 0.1)), bars)
            rounding = (here < FLOOR * np.abs(values)) & (before < FLOOR * np.abs(values))
            bars = np.where(rounding & ~slow, np.minimum(np.maximum(before, bars), LUCK * bars), bars)
        for _, later in self.runs[best + 2 :]:
            bars = np.maximum(bars, np.abs(later - values))
        return bars

    def _differences(self) -> np.ndarray:
        table = np.array([values for _, values in self.runs])
        return np.abs(np.diff(table, axis=0))

    def _scales(self) -> np.ndarray:
        last = self.runs[-1][1]
        here = self._differences()[-1] if len(self.runs) > 1 else np.zeros(len(last))
        return scales_of(self.wanted, last, here)
