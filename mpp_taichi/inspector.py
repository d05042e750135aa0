"""Inspector: the quantities that a scene's `inspect:` names, sampled along a run, as what its panels plot."""

import math
import re
from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from mpp_taichi import component
from mpp_taichi.errors import SceneError
from mpp_taichi.kinetic_theory.speeds import kinetic_temperature, speed_density, speed_scale
from mpp_taichi.diagnostics._gas import rows_of
from mpp_taichi.plots import Curves, Histogram, Plot, Samples
from mpp_taichi.quantities._base import Dimension, NoResultError, OfEach, Quantity, Setting
from mpp_taichi.scene.expressions import ExpressionError, Formula
from mpp_taichi.scene.spec import ComponentSpec, PanelSpec
from mpp_taichi.snapshot import Snapshot

if TYPE_CHECKING:
    from mpp_taichi.simulation import Simulation

THEORY = "theory"
CURVE_POINTS = 120
REACH = 3.0  # of a histogram of speeds, in units of b; beyond it are 10⁻⁴ of the particles


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
        return self._simulation.energy_meter.potential_energy(self.time)


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
        self._histograms: list[_Distribution] = []
        self._names: list[str] = []
        self.samples = Samples()
        self._span = None if end is None else (simulation.time, end)
        self.plots: tuple[Plot, ...] = tuple(
            self._panel(panel, f"inspect[{number}]") for number, panel in enumerate(spec.inspect)
        )
        self._step = -1
        self.samples.open(len(self._names))

    def restart(self) -> None:
        """Forget every look."""
        self._step = -1
        self.samples.clear()
        for quantity in self._measured:
            quantity.restart()
        for histogram in self._histograms:
            histogram.restart()

    def look(self, simulation: "Simulation") -> None:
        """Measure everything, unless that was just done at this step."""
        if simulation.step_count == self._step:
            return
        self._step = simulation.step_count
        look = SimulationLook(simulation)
        row = np.full(len(self._names), math.nan)
        for quantity, column in self._made.values():
            if column >= 0:
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
        if isinstance(panel.theory, Formula):
            columns.append(self._add(f"{THEORY} of {labels[0]}"))
            labels.append(THEORY)
            self._theories.append((panel.theory, x_column, columns[-1]))
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
            has_theory=panel.theory is not None,
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
        law = _Gas(self._setting, entry) if panel.theory is not None else None
        self._histograms.append(_Distribution(plot, quantity, panel.after, law))
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


class _Gas:
    """Maxwell and Boltzmann's distribution of the speeds, or of one component of the velocities, at a kinetic temperature.

    Where masses differ it is the mean over the particles.
    """

    def __init__(self, setting: Setting, entry: ComponentSpec) -> None:
        self._of, self._along = entry.parameters["of"], entry.name == "velocity"
        self._dimensions = setting.spec.dimensions

    def scales(self, snapshot: Snapshot) -> tuple[float, np.ndarray, np.ndarray]:
        """k T, the masses that occur, and how often."""
        rows = rows_of(self._of, snapshot)
        rows = rows[snapshot.present[rows]]
        masses, counts = np.unique(snapshot.mass[rows], return_counts=True)
        return kinetic_temperature(snapshot.velocity[rows], snapshot.mass[rows], self._dimensions), masses, counts

    def density(self, value: np.ndarray, temperature: float, masses: np.ndarray, counts: np.ndarray) -> np.ndarray:
        """f of each value."""
        if not temperature > 0.0:
            return np.zeros_like(value)
        scale: Callable[[float], float] = lambda mass: float(speed_scale(mass, temperature))
        if self._along:
            curves = [np.exp(-((value / scale(m)) ** 2)) / (math.sqrt(math.pi) * scale(m)) for m in masses]
        else:
            curves = [np.where(value < 0.0, 0.0, speed_density(value, scale(m), self._dimensions)) for m in masses]
        return np.average(curves, axis=0, weights=counts)


class _Distribution:
    """Fills a histogram: with the present look, or from `after` on with all looks together."""

    def __init__(self, plot: Histogram, quantity: OfEach, after: float | None, law: _Gas | None) -> None:
        self._plot, self._quantity, self._after, self._law = plot, quantity, after, law
        self.restart()

    def restart(self) -> None:
        self._counts: np.ndarray | None = None
        self._seen = 0
        self._temperatures: list[float] = []
        self._plot.clear()

    def look(self, look: Any) -> None:
        """Count."""
        values = self._quantity.each(look)
        values = values[np.isfinite(values)]
        edges = self._edges(values, look)
        counts, _ = np.histogram(values, edges)
        together = self._after is not None and look.time >= self._after
        if together and self._counts is not None:
            counts, self._seen = self._counts + counts, self._seen + len(values)
        else:
            self._seen = len(values)
            self._temperatures.clear()
        self._counts = counts if together else None
        curve = np.linspace(edges[0], edges[-1], CURVE_POINTS)
        theory = np.zeros(0)
        if self._law is not None:
            temperature, masses, numbers = self._law.scales(look.snapshot)
            self._temperatures.append(temperature)
            theory = self._law.density(curve, float(np.mean(self._temperatures)), masses, numbers)
        density = counts / (max(self._seen, 1) * (edges[1] - edges[0]))
        self._plot.show(edges, density, curve if len(theory) else np.zeros(0), theory)

    def _edges(self, values: np.ndarray, look: Any) -> np.ndarray:
        """Those of the looks before, unless something lies outside; then twice as far, and all looks together begin anew."""
        edges = self._plot.edges
        low, high = (float(values.min()), float(values.max())) if len(values) else (0.0, 1.0)
        if len(edges) and edges[0] <= low and high <= edges[-1]:
            return edges
        if self._law is not None:
            temperature, masses, _ = self._law.scales(look.snapshot)
            reach = REACH * float(np.max(speed_scale(masses, temperature))) if len(masses) and temperature > 0.0 else 1.0
            low, high = (min(low, -reach) if low < 0.0 else 0.0), max(high, reach)
        room = 0.05 * (high - low) or 0.5 * abs(high) or 0.5
        self._counts = None
        return np.linspace(low if low == 0.0 else low - room, high + room, self._plot.bins + 1)


def _value(formula: Formula, time: float, x: float) -> float:
    """A theory at one moment; NaN where it has no value."""
    try:
        with np.errstate(all="ignore"):
            return float(formula(1, t=time, x=x)[0])
    except ExpressionError:
        return math.nan
