"""The content of a panel: plain arrays that grow with the run, apart from the simulation and from the drawing."""

from dataclasses import dataclass, field

import numpy as np

MOST_KEPT = 100_000  # samples; with more, every second sample is dropped
FIRST_CAPACITY = 1024


class Samples:
    """Rows of numbers, one row for each sample of the run. `generation` changes when earlier rows are changed or removed."""

    def __init__(self) -> None:
        """There are no columns yet."""
        self.generation = self.count = 0
        self._rows = np.zeros((0, 0))

    def open(self, columns: int) -> None:
        """Make room for a number of columns."""
        self._rows = np.zeros((columns, FIRST_CAPACITY))

    def clear(self) -> None:
        """Remove every row."""
        self.count = 0
        self.generation += 1

    def cut_after(self, column: int, value: float) -> None:
        """Remove the rows whose number in a column, which increases from row to row, is larger than `value`."""
        self.count = int(np.searchsorted(self._rows[column, : self.count], value, side="right"))
        self.generation += 1

    def add(self, row: np.ndarray) -> None:
        """Append a row."""
        if self.count == MOST_KEPT:
            kept = self._rows[:, : self.count : 2]
            self.count = kept.shape[1]
            self._rows[:, : self.count] = kept.copy()
            self.generation += 1
        if self.count == self._rows.shape[1]:
            self._rows = np.concatenate([self._rows, np.zeros_like(self._rows)], axis=1)
        self._rows[:, self.count] = row
        self.count += 1

    def column(self, number: int) -> np.ndarray:
        """All values of a column so far."""
        return self._rows[number, : self.count]


@dataclass(eq=False)
class Curves:
    """Curves over a common x. `names` are the names of the first curves; the last `theories` curves are drawn by theory.

    span         limits of x, where they are known before the run
    equal        whether both axes have the same scale
    x_size       size of the unit of x in units of the samples
    """

    title: str
    x_label: str
    x_unit: str
    names: tuple[str, ...]
    y_unit: str
    samples: Samples
    x_column: int
    y_columns: tuple[int, ...]
    span: tuple[float, float] | None = None
    logarithmic: bool = False
    equal: bool = False
    theories: int = 0
    x_size: float = 1.0

    @property
    def x(self) -> np.ndarray:
        """Values along x, (count,)."""
        column = self.samples.column(self.x_column)
        return column if self.x_size == 1.0 else column / self.x_size

    @property
    def count(self) -> int:
        """The number of curves."""
        return len(self.y_columns)

    def y(self, number: int) -> np.ndarray:
        """Values of one curve, (count,); NaN where the curve has a gap."""
        return self.samples.column(self.y_columns[number])


@dataclass(eq=False)
class Histogram:
    """Probability densities over bins, and a curve by theory where there is one.

    edges (bins + 1,), density (bins,); curve and theory (n,) each, empty without a theory
    """

    title: str
    x_label: str
    x_unit: str
    has_theory: bool
    bins: int
    edges: np.ndarray = field(default_factory=lambda: np.zeros(0))
    density: np.ndarray = field(default_factory=lambda: np.zeros(0))
    curve: np.ndarray = field(default_factory=lambda: np.zeros(0))
    theory: np.ndarray = field(default_factory=lambda: np.zeros(0))
    generation: int = 0

    def clear(self) -> None:
        """Remove the bins."""
        self.show(np.zeros(0), np.zeros(0), np.zeros(0), np.zeros(0))

    def show(self, edges: np.ndarray, density: np.ndarray, curve: np.ndarray, theory: np.ndarray) -> None:
        """Replace the bins and the curve."""
        self.edges, self.density, self.curve, self.theory = edges, density, curve, theory
        self.generation += 1


Plot = Curves | Histogram
