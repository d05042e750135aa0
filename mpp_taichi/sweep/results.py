"""Results: the table of a sweep, as far as it is done, in arrays with an axis for each key that varies."""

from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from mpp_taichi.errors import ArgumentError, MissingPackageError
from mpp_taichi.quantities._base import Setting
from mpp_taichi.report.expectations import label_of
from mpp_taichi.scene.human_units import unit_of
from mpp_taichi.scene.spec import SceneSpec
from mpp_taichi.sweep.chunk import Columns
from mpp_taichi.sweep.member import STATUSES
from mpp_taichi.sweep.store import SweepStore, opened

MISSING = -1
"""Status of a member whose chunk is not done."""
SKIPPED = "skipped"
"""Word for a member that a refinement left out, as its neighbours hardly differ."""
FIELDS = ("end_time", "steps_done", "status", "particle", "reason")
"""The columns of every member beside its measures."""


class SweepResults:
    """The results of a sweep: `results["distance"]` is an array of the shape of the grid, NaN where a member is not done.

    count   members; shape: along each key of a grid, or (count,)
    axes    path → its values along the axis, where the members form a grid; else one value for each member
    names   measured quantities
    is_complete   whether all members are done, but for those that a refinement leaves out
    """

    def __init__(self, store: SweepStore) -> None:
        """Read the chunks that are there."""
        self.store = store
        self.count, self.shape = store.plan.count, store.plan.shape
        self.names = store.measures
        count = self.count
        self._status = np.full(count, MISSING, np.int8)
        self._values = np.full((count, len(self.names)), np.nan)
        self._time, self._steps = np.full(count, np.nan), np.zeros(count, np.int64)
        self._particle, self._reasons = np.full(count, -1, np.int32), dict[int, str]()
        store.grow()
        found = [store.columns(number) for number in range(store.chunk_count)]
        self.is_complete = all(columns is not None for columns in found)
        self._without = SKIPPED if self.is_complete else "missing"
        for columns in found:
            if columns is not None:
                self._take(columns)

    def _take(self, columns: Columns) -> None:
        where = columns.number
        self._status[where], self._values[where] = columns.status, columns.values
        self._time[where], self._steps[where], self._particle[where] = columns.time, columns.steps, columns.particle
        self._reasons |= {int(k): str(why) for k, why in zip(where, columns.reason, strict=True) if why}

    def __getitem__(self, name: str) -> np.ndarray:
        """The values of a measure, or of one of FIELDS, in the shape of the grid.

        Raises:
            ArgumentError: there is no such name.
        """
        return self.column(name).reshape(self.shape)

    def column(self, name: str) -> np.ndarray:
        """The values of a name, one for each member.

        Raises:
            ArgumentError: there is no such name.
        """
        if name in self.names:
            return self._values[:, self.names.index(name)]
        if name == "reason":
            return np.array([self._reasons.get(k, "") for k in range(self.count)], dtype=np.str_)
        known = {"end_time": self._time, "steps_done": self._steps, "status": self.status, "particle": self._particle}
        if name not in known:
            raise ArgumentError(f"the sweep has no {name!r}, it has {', '.join([*self.names, *FIELDS])}")
        return known[name]

    @property
    def status(self) -> np.ndarray:
        """The status of each member in words; `missing` where it is not done, `skipped` where a refinement left it out."""
        return np.array([*STATUSES, self._without])[self._status]

    @property
    def fields(self) -> list[str]:
        """The columns of FIELDS whose names no measure has."""
        return [name for name in FIELDS if name not in self.names]

    @property
    def wide(self) -> list[int]:
        """Numbers of the keys that have several values."""
        return [k for k, size in enumerate(self.shape) if size > 1]

    @property
    def is_map(self) -> bool:
        """Whether the members form a grid over two keys."""
        return self.store.plan.is_grid and len(self.wide) == 2

    @property
    def done(self) -> int:
        """Number of members that are done."""
        return int((self._status != MISSING).sum())

    def counts(self) -> dict[str, int]:
        """Number of members of each status that occurs."""
        found = {word: int((self._status == code).sum()) for code, word in enumerate(STATUSES)}
        found[self._without] = self.count - self.done
        return {word: number for word, number in found.items() if number}

    @cached_property
    def axes(self) -> dict[str, np.ndarray]:
        """Path → values: along the axis of a grid, else of each member."""
        plan = self.store.plan
        if not plan.is_grid:
            return plan.columns(np.arange(self.count))
        return {axis.path: plan.columns(self._first_along(k))[axis.path] for k, axis in enumerate(plan.axes)}

    def _first_along(self, number: int) -> np.ndarray:
        places = [np.zeros(self.shape[number], np.int64) for _ in self.shape]
        places[number] = np.arange(self.shape[number])
        return np.asarray(np.ravel_multi_index(tuple(places), self.shape))

    def values_of(self, member: int) -> dict[str, Any]:
        """Path → value of a member."""
        return self.store.plan.values([member])[0]

    def member(self, number: int) -> SceneSpec:
        """The scene of a member with its pictures: `Simulation(results.member(17))` runs it alone.

        Raises:
            ArgumentError: there is no such member.
        """
        return self.store.member(number)

    @cached_property
    def units(self) -> dict[str, str]:
        """Measure → its unit; empty for a pure number, and where the scene names no units."""
        from mpp_taichi import component
        from mpp_taichi.scene.expectations import kind_of

        scene, found = self.store.scene, {}
        for name, measure in zip(self.names, self.store.sweep.measure, strict=True):
            dimension = (0, 1, 0) if measure.quantity in ("end_time", "time") else (0, 0, 0)
            if kind_of(measure.quantity) == "quantities":
                quantity: Any = component.load("quantities", measure.quantity)
                dimension = quantity.dimension
            found[name] = unit_of(scene.units, dimension)
        return found | {"end_time": unit_of(scene.units, (0, 1, 0))}

    @cached_property
    def long_names(self) -> dict[str, str]:
        """Measure → its name with the names of particles: `distance(between=(planet, star_a), when=largest)`."""
        from mpp_taichi.start.assemble import assemble

        scene = self.store.scene
        setting = Setting(scene, assemble(scene))
        return {name: label_of(each, setting) for name, each in zip(self.names, self.store.sweep.measure, strict=True)}

    def to_xarray(self) -> Any:
        """A Dataset with a dimension for each key of a grid, or `member`.

        Raises:
            MissingPackageError: this Python has no xarray.
        """
        import importlib.util
        import sys

        if importlib.util.find_spec("xarray") is None:
            raise MissingPackageError(f"to_xarray needs the package xarray: {sys.executable} -m pip install xarray")
        import xarray

        grid = self.store.plan.is_grid
        dims = tuple(self.axes) if grid else ("member",)
        coordinates: dict[str, Any] = {
            path: ((path,) if grid else dims, with_texts(values)) for path, values in self.axes.items()
        }
        variables = {
            name: (dims, self[name], {"units": self.units.get(name, ""), "long_name": self.long_names.get(name, name)})
            for name in self.names
        }
        variables |= {name: (dims, self[name], {}) for name in self.fields}
        return xarray.Dataset(variables, coordinates, {"title": self.store.scene.title, "source": self.store.source})


def with_texts(values: np.ndarray) -> np.ndarray:
    """Numbers as they are; words, and numbers among words, as texts."""
    return values if values.dtype != object else values.astype(np.str_)


def open_sweep(folder: str | Path) -> SweepResults:
    """The results of the sweep in a folder, as far as it is done.

    Raises:
        StateError: there is no sweep.
    """
    return SweepResults(opened(Path(folder)))
