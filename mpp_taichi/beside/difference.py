"""Difference: how far two runs of the same particles are apart, along the runs."""

from pathlib import Path

import numpy as np

from mpp_taichi.plots import Curves, Samples
from mpp_taichi.quantities._base import Setting
from mpp_taichi.recorders.inspection import save_panels
from mpp_taichi.scene.human_units import TimeScale
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.snapshot import Snapshot

LENGTH, TIME = (1, 0, 0), (0, 1, 0)
COLUMNS = ("time", "rms_distance")


def rms_distance(one: np.ndarray, other: np.ndarray) -> float:
    """√(1/N Σ |xᵢ − yᵢ|²) of positions (N, 3) [length]; 0 for N = 0."""
    return float(np.sqrt(np.sum((one - other) ** 2) / max(1, len(one))))


class Difference:
    """The rms distance between the same particles of two runs, at every picture of their film.

    A particle that has merged into another one in one of the runs is left out.
    """

    def __init__(self, spec: SceneSpec, start: Snapshot, span: tuple[float, float]) -> None:
        """No moment was compared yet; `span` holds the begin and the end of the runs."""
        self._setting = Setting(spec, start)
        self._samples = Samples()
        self._samples.open(len(COLUMNS))
        scale = TimeScale(self._setting.unit(TIME)) if spec.units is None else TimeScale.of(spec.units, span[1])
        self.plot = Curves(
            title="Distance between the same particles",
            x_label="time",
            x_unit=scale.unit,
            names=("root mean square of all",),
            y_unit=self._setting.unit(LENGTH),
            samples=self._samples,
            x_column=0,
            y_columns=(1,),
            span=(span[0] / scale.size, span[1] / scale.size),
            logarithmic=True,
            x_size=scale.size,
        )

    @property
    def last(self) -> float | None:
        """The latest value [length]."""
        return float(self.plot.y(0)[-1]) if self._samples.count else None

    def add(self, time: float, one: Snapshot, place: np.ndarray, present: np.ndarray) -> None:
        """Compare a moment of one run with the positions of the other run at the same time."""
        both = one.present & present
        self._samples.add(np.array([time, rms_distance(one.position[both], place[both])]))

    def save(self, path: Path) -> None:
        """Write the curve as the suffix says: `.csv`, `.svg` or `.png`; OutputError where that fails."""
        save_panels(path, [self.plot], {name: self._samples.column(number) for number, name in enumerate(COLUMNS)})
