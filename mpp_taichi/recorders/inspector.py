"""Inspector: the quantities that a scene's `inspect:` names, sampled along a run, as what its panels plot."""

import math
import re
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from mpp_taichi import component
from mpp_taichi.errors import SceneError
from mpp_taichi.plots import Curves, Histogram, Plot, Samples
from mpp_taichi.quantities._base import Dimension, NoResultError, OfEach, Quantity, Setting
from mpp_taichi.recorders._distribution import Distribution, Gas
from mpp_taichi.scene.expressions import ExpressionError, Formula
from mpp_taichi.scene.spec import ComponentSpec, PanelSpec
from mpp_taichi.snapshot import Snapshot

if TYPE_CHECKING:
    from mpp_taichi.simulation.simulation import Simulation

THEORY = "theory"


class SimulationLook:
    """A simulation at one moment; what costs something is computed when it is first asked for."""

    def __init__(self, simulation: "Simulation") -> None:
        """Good until the simulation goes on."""
        self._simulation = simulation
        self.time, self.phase_number, self.phase_energy = simulation.time, simulation.phase_number, simulation.phase_energy

    @cached_property
    def snapshot(self) -> Snapshot:
        """The particles, with the masses that the device keeps."""
        snapshot = self._simulation.snapshot()
        return replace(snapshot, mass=self._simulation.state.as_kept(snapshot.mass))

    @cached_property
    def potential_energy(self) -> float:
        """Of all forces that have one."""
        return self._simulation.phase.energy_meter.potential_energy(self.time)


class Inspector:
    """Samples every quantity once at a look, however many panels show it; nothing is computed that no panel asks for.

    `plots` are what there is to draw, one for each panel: `Curves` and `Histogram`, which grow with every look.
    """

    def __init__(self, simulation: "Simulation", *, end: float | None = None) -> None:
        """Import and build what is named; `end` is the time at which the run ends, where that is known.

        Raises:
            SceneError: a quantity is not defined for this scene.
        """
        spec = simulation.spec
        self._setting = Setting(spec, simulation.start)
        self._made: dict[tuple[str, str], tuple[Quantity, int]] = {}
        self._measured: list[Quantity] = []
        self._theories: list[tuple[Formula, int, int]] = []  # formula, column of x, column of the result
        self._histograms: list[Distribution] = []
        self._names: list[str] = []
        self.samples = Samples()
        self._span = None if end is None else (simulation.time, end)
        self.plots: tuple[Plot, ...] = tuple(
            self._panel(panel, f"inspect[{number}]") for number, panel in enumerate(spec.inspect)
        )
        self._step = -1
        self.samples.open(len(self._names) + 1)  # the last column holds the step

    def restart(self) -> None:
        """Forget every look."""
        self._step = -1
        self.samples.clear()
        for quantity in self._measured:
            quantity.restart()
        for histogram in self._histograms:
            histogram.restart()

    def go_back(self, simulation: "Simulation") -> None:
        """Forget the looks after the step to which a simulation has gone back; what was gathered over many looks, wholly."""
        self._step = simulation.step_count
        self.samples.cut_after(len(self._names), self._step)
        for histogram in self._histograms:
            histogram.restart()

    def look(self, simulation: "Simulation") -> None:
        """Measure everything, unless that was just done at this step."""
        if simulation.step_count == self._step:
            return
        self._step = simulation.step_count
        look = SimulationLook(simulation)
        row = np.full(len(self._names) + 1, math.nan)
        row[-1] = self._step
        for quantity, column in self._made.values():
            row[column] = quantity.measure(look)
        for formula, x, column in self._theories:
            row[column] = _value(formula, look.time, row[x])
        self.samples.add(row)
        for histogram in self._histograms:
            histogram.look(look)

    @property
    def names(self) -> tuple[str, ...]:
        """What the columns of `samples` are called, each once."""
        found: list[str] = []
        for name in self._names:
            word = re.sub(r"[^\w\[\]]+", "_", name).strip("_")
            found.append(word if word not in found else next(w for k in range(2, 999) if (w := f"{word}_{k}") not in found))
        return tuple(found)

    # --- panels ---------------------------------------------------------------------------------------------------------

    def _panel(self, panel: PanelSpec, key: str) -> Plot:
        if panel.histogram is not None:
            return self._histogram(panel, panel.histogram, f"{key}.histogram")
        x, x_column = self._measure(panel.x, f"{key}.x")
        found = [self._measure(each, f"{key}.y") for each in panel.y]
        labels, columns = [quantity.label(self._setting) for quantity, _ in found], [column for _, column in found]
        theories = panel.theory if isinstance(panel.theory, tuple) else ()
        for formula, label in zip(theories, labels + [""] * len(theories)):
            columns.append(self._add(f"{THEORY} of {label}" if label else THEORY))
            self._theories.append((formula, x_column, columns[-1]))
        dimensions = {quantity.dimension for quantity, _ in found}
        unit = self._setting.unit(found[0][0].dimension) if len(dimensions) == 1 else ""
        return Curves(
            title=panel.title,
            x_label=x.label(self._setting),
            x_unit=self._setting.unit(x.dimension),
            names=tuple(labels),
            y_unit=unit,
            samples=self.samples,
            x_column=x_column,
            y_columns=tuple(columns),
            span=self._span if panel.x.name == "time" else None,
            logarithmic=panel.logarithmic,
            equal=panel.x.name == "position" and all(each.name == "position" for each in panel.y),
            theories=len(theories),
        )

    def _histogram(self, panel: PanelSpec, entry: ComponentSpec, key: str) -> Histogram:
        quantity = self._build(entry, key)
        assert isinstance(quantity, OfEach)
        dimension: Dimension = quantity.dimension
        plot = Histogram(
            title=panel.title,
            x_label=quantity.label(self._setting),
            x_unit=self._setting.unit(dimension),
            has_theory=panel.theory is not None,
            bins=panel.bins,
        )
        law = Gas(self._setting.spec, entry) if panel.theory is not None else None
        self._histograms.append(Distribution(plot, quantity, panel.after, law))
        return plot

    def _measure(self, entry: ComponentSpec, key: str) -> tuple[Quantity, int]:
        """A quantity, and the column that it is written to."""
        known = (entry.name, repr(sorted(entry.parameters.items())))
        if known not in self._made:
            quantity = self._build(entry, key)
            self._made[known] = quantity, self._add(quantity.label(self._setting))
        return self._made[known]

    def _build(self, entry: ComponentSpec, key: str) -> Quantity:
        quantity: Quantity = component.build("quantities", entry.name, entry.parameters)
        try:
            quantity.begin(self._setting)
        except NoResultError as error:
            raise SceneError(f"{entry.location}: {key}.{entry.name}: {error}") from None
        self._measured.append(quantity)
        return quantity

    def _add(self, name: str) -> int:
        self._names.append(name)
        return len(self._names) - 1


def _value(formula: Formula, time: float, x: float) -> float:
    """A theory at one moment; NaN where it has no value."""
    try:
        with np.errstate(all="ignore"):
            return float(formula(1, t=time, x=x)[0])
    except ExpressionError:
        return math.nan
