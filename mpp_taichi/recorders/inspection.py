"""Inspection: samples along a run of the quantities of a scene's panels, and the files they are written to."""

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

import numpy as np
from PIL import Image

from mpp_taichi.atomic_file import whole_file
from mpp_taichi.errors import OutputError
from mpp_taichi.plots import Histogram, Plot
from mpp_taichi.plots.sheet import Sheet
from mpp_taichi.plots.svg import draw_svg
from mpp_taichi.plots.theme import LIGHT
from mpp_taichi.recorders.inspector import Inspector

if TYPE_CHECKING:
    from mpp_taichi.simulation.simulation import Simulation

FORMATS = (".csv", ".svg", ".png")
SAMPLES_PER_RUN = 1000
PANEL = (960, 480)  # pixels of one panel in a file
LETTERS = 20  # pixels


class Rhythm(Protocol):
    """A recorder at whose samples the inspector takes a sample as well: a film."""

    def steps_until_frame(self, simulation: "Simulation") -> int:
        """The number of steps before the next sample."""


class InspectionRecorder:
    """Lets an inspector take a sample every `every` steps, and whenever a film draws a frame."""

    def __init__(self, inspector: Inspector, every: int) -> None:
        """There are no samples yet."""
        self.inspector, self.every = inspector, max(1, every)
        self.film: Rhythm | None = None
        self._due: int | None = None

    @staticmethod
    def every_for(steps: int | None, table: int) -> int:
        """Steps between samples for `SAMPLES_PER_RUN` in a run; as many as the `table` has where a sample is expensive."""
        return table if steps is None or table > max(1, steps // 200) else max(1, steps // SAMPLES_PER_RUN)

    def restart(self) -> None:
        """Forget every sample."""
        self._due = None
        self.inspector.restart()

    def go_back(self, simulation: "Simulation") -> None:
        """Forget the samples after the step to which a simulation has gone back."""
        self._due = None if self._due is None else min(self._due, simulation.step_count + self.every)
        self.inspector.go_back(simulation)

    def steps_until_due(self, simulation: "Simulation") -> int:
        """Until the next sample, its own or the film's."""
        own = 0 if self._due is None else self._due - simulation.step_count
        return own if self.film is None else min(own, self.film.steps_until_frame(simulation))

    def record(self, simulation: "Simulation") -> None:
        """Take a sample."""
        self.inspector.look(simulation)
        if self._due is None or self._due <= simulation.step_count:
            self._due = simulation.step_count + self.every

    def finish(self, simulation: "Simulation") -> None:
        """Take a sample at the end."""
        self.record(simulation)

    def save(self, path: Path) -> None:
        """Write the samples as the suffix says; OutputError where that fails."""
        save_panels(path, self.inspector.plots, self.columns())

    def columns(self) -> dict[str, np.ndarray]:
        """Every sampled quantity, (sample_count,) each; then the present bins of each histogram, and its theory there."""
        samples = self.inspector.samples
        found = {name: samples.column(number) for number, name in enumerate(self.inspector.names)}
        histograms = [plot for plot in self.inspector.plots if isinstance(plot, Histogram) and len(plot.edges)]
        for number, plot in enumerate(histograms, start=1):
            word = f"histogram_{number}_"
            found |= {f"{word}from": plot.edges[:-1], f"{word}to": plot.edges[1:], f"{word}density": plot.density}
            if len(plot.theory):
                middle = 0.5 * (plot.edges[:-1] + plot.edges[1:])
                found[f"{word}theory"] = np.interp(middle, plot.curve, plot.theory)
        return found


def save_panels(path: Path, plots: Sequence[Plot], columns: Mapping[str, np.ndarray]) -> None:
    """Write columns as a table, or the plots as a drawing, as the suffix says; by way of a temporary file.

    Raises:
        OutputError: the suffix is none of `FORMATS`, or the file cannot be written.
    """
    suffix = path.suffix.lower()
    if suffix not in FORMATS:
        raise OutputError(f"{path}: the format {suffix!r} of the panels is none of {', '.join(FORMATS)}")
    with whole_file(path, "the panels") as temporary:
        if suffix == ".csv":
            with open(temporary, "w", encoding="utf-8", newline="") as stream:
                csv.writer(stream).writerows(_lines(columns))
        elif suffix == ".svg":
            temporary.write_text(draw_svg(plots, PANEL, LETTERS), encoding="utf-8")
        else:
            sheet = Sheet(plots, (PANEL[0], PANEL[1] * len(plots)), LETTERS, LIGHT, columns=1)
            Image.fromarray(sheet.picture()).save(temporary, format="PNG")


def _lines(columns: Mapping[str, np.ndarray]) -> list[list[str]]:
    """Header and rows, numbers in their shortest exact spelling; a shorter column ends in empty cells."""
    rows = max((len(values) for values in columns.values()), default=0)
    texts = [[repr(float(value)) for value in values] for values in columns.values()]
    return [list(columns), *([text[row] if row < len(text) else "" for text in texts] for row in range(rows))]
