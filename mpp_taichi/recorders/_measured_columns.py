"""Measured columns: the quantities that a scene names for its panels or its table, each measured once in a sample."""

import math
import re

import numpy as np

from mpp_taichi import component
from mpp_taichi.errors import SceneError
from mpp_taichi.quantities._base import NoResultError, Quantity, RunSample, Setting
from mpp_taichi.scene.spec import ComponentSpec


class MeasuredColumns:
    """A column of numbers for each quantity, however often the scene names it; only these quantities are imported."""

    def __init__(self, setting: Setting) -> None:
        """There are no columns yet."""
        self.setting = setting
        self._columns: dict[tuple[str, str], tuple[Quantity, int]] = {}
        self._quantities: list[Quantity] = []
        self._labels: list[str] = []

    def __len__(self) -> int:
        """The number of columns."""
        return len(self._labels)

    def add(self, entry: ComponentSpec, key: str) -> tuple[Quantity, int]:
        """The quantity of an entry of the scene at `key`, and its column; SceneError where it is not defined."""
        known = (entry.name, repr(sorted(entry.parameters.items())))
        if known not in self._columns:
            quantity = self.build(entry, key)
            self._columns[known] = quantity, self.add_empty(quantity.label(self.setting))
        return self._columns[known]

    def add_empty(self, label: str) -> int:
        """A column that `measure` leaves without a number."""
        self._labels.append(label)
        return len(self._labels) - 1

    def build(self, entry: ComponentSpec, key: str) -> Quantity:
        """A quantity without a column.

        Raises:
            SceneError: the quantity is not defined for this scene.
        """
        quantity: Quantity = component.build("quantities", entry.name, entry.parameters)
        try:
            quantity.begin(self.setting)
        except NoResultError as error:
            raise SceneError(f"{entry.location}: {key}.{entry.name}: {error}") from None
        self._quantities.append(quantity)
        return quantity

    def restart(self) -> None:
        """Let the quantities forget the samples."""
        for quantity in self._quantities:
            quantity.restart()

    def measure(self, sample: RunSample) -> np.ndarray:
        """The numbers of all columns, (column_count,); NaN where the sample has none."""
        row = np.full(len(self), math.nan)
        for quantity, column in self._columns.values():
            try:
                row[column] = quantity.measure(sample)
            except NoResultError:
                pass
        return row

    @property
    def names(self) -> tuple[str, ...]:
        """The labels as words for the header of a file, each word once."""
        found: list[str] = []
        for label in self._labels:
            word = re.sub(r"[^\w\[\]]+", "_", label).strip("_")
            found.append(word if word not in found else next(w for k in range(2, 999) if (w := f"{word}_{k}") not in found))
        return tuple(found)

    @property
    def header(self) -> tuple[str, ...]:
        """The names, each with the unit of its quantity in brackets where it has a unit: `x_of_earth [AU]`."""
        found = list(self.names)
        for quantity, column in self._columns.values():
            if unit := self.setting.unit(quantity.dimension):
                found[column] += f" [{unit}]"
        return tuple(found)
