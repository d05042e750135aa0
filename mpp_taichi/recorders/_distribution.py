"""Distribution: the histogram of a quantity that every particle has, beside the distribution that theory gives."""

import math
from typing import Protocol

import numpy as np

from mpp_taichi.kinetic_theory.speeds import component_density, kinetic_temperature, speed_density, speed_scale
from mpp_taichi.plots import Histogram
from mpp_taichi.quantities._base import OfEach, RunSample
from mpp_taichi.quantities._particles import free_rows
from mpp_taichi.scene.expressions import ExpressionError, Formula
from mpp_taichi.scene.spec import ComponentSpec, SceneSpec
from mpp_taichi.snapshot import Snapshot

CURVE_POINTS = 120
REACH = 3.0  # of a histogram of speeds at least, in units of b; beyond it are 10⁻⁴ of the particles
ROOM = 0.05  # of the span, beyond the outermost values


def theory_at(formula: Formula, time: float, x: float) -> float:
    """A formula of theory at one time and one value of the quantity along x; NaN where it has no value."""
    try:
        with np.errstate(all="ignore"):
            return float(formula(1, t=time, x=x)[0])
    except ExpressionError:
        return math.nan


class Law(Protocol):
    """A distribution by theory; `has_reach` where the histogram is drawn from zero up to a `reach` at least."""

    has_reach: bool

    def see(self, sample: RunSample, *, anew: bool) -> None:
        """Take what the law needs from a sample; `anew` forgets the samples before."""

    def reach(self, snapshot: Snapshot) -> float:
        """The size up to which the histogram is drawn at least."""

    def density(self, value: np.ndarray) -> np.ndarray:
        """The probability density at each value, per unit of the quantity."""


class FormulaLaw:
    """A density that is a formula over the time t and the quantity x; the values alone decide what is drawn."""

    has_reach = False

    def __init__(self, formula: Formula) -> None:
        """Keep the formula."""
        self._formula, self._time = formula, 0.0

    def see(self, sample: RunSample, *, anew: bool) -> None:
        """Keep the time of the last sample."""
        self._time = sample.time

    def reach(self, snapshot: Snapshot) -> float:
        """None."""
        return 0.0

    def density(self, value: np.ndarray) -> np.ndarray:
        """The formula; NaN, which is not drawn, where it has no value."""
        return np.array([theory_at(self._formula, self._time, each) for each in value])


class MaxwellBoltzmann:
    """Maxwell and Boltzmann's distribution of the speeds, or of one component of the velocities, at a kinetic temperature.

    Where masses differ it is the mean over the particles.
    """

    has_reach = True

    def __init__(self, spec: SceneSpec, entry: ComponentSpec) -> None:
        """`entry` names the speed or the velocity whose distribution is drawn."""
        self._of, self._along, self._dimensions = entry.parameters["of"], entry.name == "velocity", spec.dimensions
        self._temperatures: list[float] = []

    def see(self, sample: RunSample, *, anew: bool) -> None:
        """Note the temperature and the masses; the density is drawn for the mean of all temperatures that were noted."""
        if anew:
            self._temperatures.clear()
        temperature, self._masses, self._numbers = self._measure(sample.snapshot)
        self._temperatures.append(temperature)

    def _measure(self, snapshot: Snapshot) -> tuple[float, np.ndarray, np.ndarray]:
        """k T, the different masses, and the number of particles of each."""
        rows = free_rows(self._of, snapshot)
        rows = rows[snapshot.present[rows]]
        masses, counts = np.unique(snapshot.mass[rows], return_counts=True)
        return kinetic_temperature(snapshot.velocity[rows], snapshot.mass[rows], self._dimensions), masses, counts

    def reach(self, snapshot: Snapshot) -> float:
        """The speed below which almost all particles are."""
        temperature, masses, _ = self._measure(snapshot)
        return REACH * float(np.max(speed_scale(masses, temperature), initial=0.0)) if temperature > 0.0 else 0.0

    def density(self, value: np.ndarray) -> np.ndarray:
        """f of each value."""
        temperature = float(np.mean(self._temperatures))
        if not temperature > 0.0:
            return np.zeros_like(value)
        scales = [float(speed_scale(mass, temperature)) for mass in self._masses]
        if self._along:
            curves = [component_density(value, scale) for scale in scales]
        else:
            curves = [speed_density(np.maximum(value, 0.0), scale, self._dimensions) for scale in scales]
        return np.average(curves, axis=0, weights=self._numbers)


class Distribution:
    """Fills a histogram: with the last sample, or from `after` on with all samples together, and before it with none."""

    def __init__(self, plot: Histogram, quantity: OfEach, after: float | None, law: Law | None) -> None:
        """`law` is the distribution by theory."""
        self._plot, self._quantity, self._after, self._law = plot, quantity, after, law
        self.restart()

    def restart(self) -> None:
        """Forget every sample."""
        self._counts: np.ndarray | None = None
        self._seen = 0
        self._plot.clear()

    def add(self, sample: RunSample) -> None:
        """Count the values of a sample; a sample before `after` leaves the histogram empty."""
        if self._after is not None and sample.time < self._after:
            return
        values = self._quantity.each(sample)
        values = values[np.isfinite(values)]
        edges = self._edges(values, sample)
        counts, _ = np.histogram(values, edges)
        seen = len(values)
        together = self._after is not None
        goes_on = together and self._counts is not None
        if goes_on:
            counts, seen = self._counts + counts, self._seen + seen
        self._counts, self._seen = counts if together else None, seen
        curve = theory = np.zeros(0)
        if self._law is not None:
            self._law.see(sample, anew=not goes_on)
            curve = np.linspace(edges[0], edges[-1], CURVE_POINTS)
            theory = self._law.density(curve)
        self._plot.show(edges, counts / (max(seen, 1) * (edges[1] - edges[0])), curve, theory)

    def _edges(self, values: np.ndarray, sample: RunSample) -> np.ndarray:
        """The edges of the bins so far; new edges, and a histogram that begins anew, where a value lies outside."""
        edges = self._plot.edges
        low, high = float(np.min(values, initial=0.0)), float(np.max(values, initial=0.0))
        law = self._law if self._law is not None and self._law.has_reach else None
        if law is None and len(values):
            low, high = float(values.min()), float(values.max())
        if len(edges) and edges[0] <= low and high <= edges[-1]:
            return edges
        if law is not None:
            reach = law.reach(sample.snapshot)
            low, high = (min(low, -reach) if low < 0.0 else low), max(high, reach)
        room = ROOM * (high - low) or 0.5 * abs(high) or 0.5
        self._counts = None
        return np.linspace(low - room if low < 0.0 else max(low - room, 0.0), high + room, self._plot.bins + 1)
