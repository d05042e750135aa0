"""Inspector: samples along a run of the quantities that a scene's `inspect:` names, as plots for its panels."""

from typing import TYPE_CHECKING

import numpy as np

from mpp_taichi.plots import Curves, Histogram, Plot, Samples
from mpp_taichi.quantities._base import Dimension, OfEach, Setting
from mpp_taichi.recorders._distribution import Distribution, FormulaLaw, Law, MaxwellBoltzmann, theory_at
from mpp_taichi.recorders._measured_columns import MeasuredColumns
from mpp_taichi.recorders._simulation_sample import SimulationSample
from mpp_taichi.scene.expressions import Formula
from mpp_taichi.scene.human_units import TimeScale, symbol
from mpp_taichi.scene.spec import ComponentSpec, PanelSpec

if TYPE_CHECKING:
    from mpp_taichi.simulation.simulation import Simulation

THEORY = "theory"


class Inspector:
    """Measures every quantity once in a sample, however many panels show it; no other quantity is computed.

    `plots` holds one plot for each panel: `Curves` and `Histogram`, which grow with every sample.
    """

    def __init__(self, simulation: "Simulation", *, end: float | None = None) -> None:
        """Import and build the quantities; `end` is the time at which the run ends, where that is known.

        Raises:
            SceneError: a quantity is not defined for this scene.
        """
        spec = simulation.spec
        self._setting = Setting(spec, simulation.start)
        self._columns = MeasuredColumns(self._setting)
        self._theories: list[tuple[Formula, int, int]] = []  # formula, column of x, column of the result
        self._histograms: list[Distribution] = []
        self.samples = Samples()
        self._span = None if end is None else (simulation.time, end)
        self.plots: tuple[Plot, ...] = tuple(
            self._panel(panel, f"inspect[{number}]") for number, panel in enumerate(spec.inspect)
        )
        self._step = -1
        self.samples.open(len(self._columns) + 1)  # the last column holds the step

    def restart(self) -> None:
        """Forget every sample."""
        self._step = -1
        self.samples.clear()
        self._columns.restart()
        for histogram in self._histograms:
            histogram.restart()

    def go_back(self, simulation: "Simulation") -> None:
        """Forget the samples after the step to which a simulation has gone back, and all of a histogram of many samples."""
        self._step = simulation.step_count
        self.samples.cut_after(len(self._columns), self._step)
        for histogram in self._histograms:
            histogram.restart()

    def look(self, simulation: "Simulation") -> None:
        """Take a sample, unless there is one of this step."""
        if simulation.step_count == self._step:
            return
        self._step = simulation.step_count
        sample = SimulationSample(simulation)
        row = np.append(self._columns.measure(sample), self._step)
        for formula, x, column in self._theories:
            row[column] = theory_at(formula, sample.time, row[x])
        self.samples.add(row)
        for histogram in self._histograms:
            histogram.add(sample)

    @property
    def names(self) -> tuple[str, ...]:
        """The names of the columns of `samples`, each once."""
        return self._columns.names

    # Panels

    def _panel(self, panel: PanelSpec, key: str) -> Plot:
        if panel.histogram is not None:
            return self._histogram(panel, panel.histogram, f"{key}.histogram")
        x, x_column = self._columns.add(panel.x, f"{key}.x")
        found = [self._columns.add(each, f"{key}.y") for each in panel.y]
        labels, columns = [quantity.label(self._setting) for quantity, _ in found], [column for _, column in found]
        theories = panel.theory if isinstance(panel.theory, tuple) else ()
        for formula, label in zip(theories, labels + [""] * len(theories)):
            columns.append(self._columns.add_empty(f"{THEORY} of {label}" if label else THEORY))
            self._theories.append((formula, x_column, columns[-1]))
        dimensions = {quantity.dimension for quantity, _ in found}
        unit = self._setting.unit(found[0][0].dimension) if len(dimensions) == 1 else ""
        scale = TimeScale(symbol(self._setting.unit(x.dimension)))
        over_time = panel.x.name == "time" and self._span is not None
        if over_time and self._span is not None and self._setting.spec.units is not None:
            scale = TimeScale.of(self._setting.spec.units, self._span[1])
        return Curves(
            title=panel.title,
            x_label=x.label(self._setting),
            x_unit=scale.unit,
            names=tuple(labels),
            y_unit=unit,
            samples=self.samples,
            x_column=x_column,
            y_columns=tuple(columns),
            span=(self._span[0] / scale.size, self._span[1] / scale.size) if over_time and self._span is not None else None,
            logarithmic=panel.logarithmic,
            equal=panel.x.name == "position" and all(each.name == "position" for each in panel.y),
            theories=len(theories),
            x_size=scale.size,
        )

    def _histogram(self, panel: PanelSpec, entry: ComponentSpec, key: str) -> Histogram:
        quantity = self._columns.build(entry, key)
        assert isinstance(quantity, OfEach)
        dimension: Dimension = quantity.dimension
        plot = Histogram(
            title=panel.title,
            x_label=quantity.label(self._setting),
            x_unit=self._setting.unit(dimension),
            has_theory=panel.theory is not None,
            bins=panel.bins,
        )
        law: Law | None = MaxwellBoltzmann(self._setting.spec, entry) if panel.theory is not None else None
        if isinstance(panel.theory, tuple):
            (formula,) = panel.theory
            law = FormulaLaw(formula)
        self._histograms.append(Distribution(plot, quantity, panel.after, law))
        return plot
