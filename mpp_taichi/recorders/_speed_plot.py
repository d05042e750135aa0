"""Speed plot: the histogram of a gas beside the distribution of Maxwell and Boltzmann."""

from pathlib import Path
from typing import Any, Protocol

import numpy as np

from mpp_taichi.recorders._plot_letters import families

BAR, CURVE = "#56B4E9", "#D55E00"  # Okabe and Ito's, which the colour-blind can tell apart
SIZE = (8.0, 5.0)  # inches
CURVE_POINTS = 400


class RecordedSpeeds(Protocol):
    """The speeds of a gas: `SpeedHistogram`."""

    title: str
    speed_unit: str

    @property
    def temperature(self) -> float:
        """k T."""

    @property
    def label(self) -> str:
        """The number of particles and of samples."""

    @property
    def distance(self) -> float:
        """Kolmogorov–Smirnov distance of the speeds from the curve."""

    def theory(self, speed: np.ndarray) -> np.ndarray:
        """The curve f(v)."""

    def columns(self) -> dict[str, np.ndarray]:
        """edge (bins + 1,); density and standard_error (bins,)."""


def draw(recorder: RecordedSpeeds, path: Path) -> None:
    """Draw the histogram into a picture of the format that the suffix says."""
    figure_of(recorder).savefig(path, dpi=120)


def figure_of(recorder: RecordedSpeeds) -> Any:
    """The drawing, a matplotlib Figure."""
    from matplotlib.figure import Figure

    found = recorder.columns()
    edges = found["edge"]
    figure = Figure(figsize=SIZE, layout="constrained")
    axes = figure.subplots()
    axes.stairs(found["density"], edges, fill=True, color=BAR, alpha=0.7, label=recorder.label)
    middle = 0.5 * (edges[1:] + edges[:-1])
    axes.errorbar(middle, found["density"], yerr=found["standard_error"], fmt="none", ecolor="0.4", elinewidth=0.8)
    speed = np.linspace(0.0, edges[-1], CURVE_POINTS)
    label = f"Maxwell–Boltzmann, k T = {recorder.temperature:.4g}"
    axes.plot(speed, recorder.theory(speed), color=CURVE, linewidth=1.8, label=label)
    unit = recorder.speed_unit
    axes.set_xlabel(f"speed v [{unit}]" if unit else "speed v")
    axes.set_ylabel("probability density f(v)")
    title = f"{recorder.title or 'Gas'}: Kolmogorov–Smirnov distance {recorder.distance:.3g}"
    axes.set_title(title, fontsize="medium", family=families(title))
    axes.margins(x=0.0)
    axes.grid(alpha=0.3)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(frameon=False)
    return figure
