"""Plan: the members of a sweep, numbered, and the values that vary, computed for any members without making all of them."""

import importlib.util
import sys
import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np

from mpp_taichi.errors import CapacityError, MissingPackageError
from mpp_taichi.scene.sweep_model import MOST_MEMBERS, length
from mpp_taichi.scene.sweep_spec import AxisSpec, SweepSpec
from mpp_taichi.wording.told_apart import told_apart

ROUNDED = 2.0**-49  # relative rounding error of a power
BLOCK = 4096  # random points that share a generator, so that any of them is found without those before it


class Plan:
    """The members 0 … count − 1. On a grid the last key varies fastest.

    shape   members along each key of a grid; (count,) where values are zipped or drawn
    """

    def __init__(self, spec: SweepSpec) -> None:
        """Count the members.

        Raises:
            CapacityError: there are too many.
        """
        self.spec, self.axes = spec, spec.axes
        if spec.sample is not None:
            self.shape: tuple[int, ...] = (spec.sample.count,)
        elif spec.combine == "zipped":
            self.shape = (length(spec.axes[0]),)
        else:
            self.shape = tuple(length(axis) for axis in spec.axes)
        self.count = 1
        for each in self.shape:
            self.count *= each
        if self.count > MOST_MEMBERS:
            count, most = told_apart(self.count, MOST_MEMBERS, digits=3)
            raise CapacityError(f"the sweep has {count} members, allowed: {most}")
        self._grid = [None if axis.values is None and axis.count is None else along(axis) for axis in self.axes]

    @property
    def is_grid(self) -> bool:
        """Whether every value of a key meets every value of the other keys."""
        return self.spec.sample is None and self.spec.combine == "crossed"

    def is_ordered(self, number: int) -> bool:
        """Whether the values of a key are numbers that grow or fall, so that the middle of two of them means something."""
        grid = self._grid[number]
        if grid is None or grid.dtype == object:
            return False
        steps = np.diff(grid.astype(float))
        return bool((steps > 0).all() or (steps < 0).all())

    def values(self, members: Sequence[int] | np.ndarray) -> list[dict[str, Any]]:
        """For each of these members path → value, as plain numbers and words."""
        columns = self.columns(np.asarray(members, np.int64))
        return [{path: _plain(column[row]) for path, column in columns.items()} for row in range(len(members))]

    def columns(self, members: np.ndarray) -> dict[str, np.ndarray]:
        """For each path the values of these members."""
        if self.spec.sample is not None:
            points = self._points(members)
            return {axis.path: scaled(axis, points[:, k]) for k, axis in enumerate(self.axes)}
        places = [members] * len(self.axes) if self.spec.combine == "zipped" else np.unravel_index(members, self.shape)
        return {axis.path: self._along(k)[place] for k, (axis, place) in enumerate(zip(self.axes, places, strict=True))}

    def _along(self, number: int) -> np.ndarray:
        found = self._grid[number]
        assert found is not None
        return found

    def _points(self, members: np.ndarray) -> np.ndarray:
        """Points of the unit cube, (members, keys)."""
        sample, keys = self.spec.sample, len(self.axes)
        assert sample is not None
        if sample.kind == "sobol":
            qmc = _quasi_random()
            points = np.empty((len(members), keys))
            ordered = np.argsort(members, kind="stable")
            for run in np.split(ordered, np.flatnonzero(np.diff(members[ordered]) != 1) + 1):
                engine = qmc.Sobol(keys, scramble=True, seed=np.random.default_rng(sample.seed))
                if members[run[0]]:
                    engine.fast_forward(int(members[run[0]]))
                with warnings.catch_warnings():
                    warnings.simplefilter("ignore", UserWarning)  # of a number of points that is no power of two
                    points[run] = engine.random(len(run))
            return points
        points = np.empty((len(members), keys))
        for block in np.unique(members // BLOCK):
            drawn = np.random.default_rng([sample.seed, int(block)]).random((BLOCK, keys))
            of_block = members // BLOCK == block
            points[of_block] = drawn[members[of_block] % BLOCK]
        return points


def _quasi_random() -> Any:
    """The part of SciPy that has Sobol's sequence.

    Raises:
        MissingPackageError: this Python has no SciPy.
    """
    if importlib.util.find_spec("scipy") is None:
        raise MissingPackageError(f"sample: sobol needs the package scipy: {sys.executable} -m pip install scipy")
    from scipy.stats import qmc

    return qmc


def along(axis: AxisSpec) -> np.ndarray:
    """All values of a key: of a list as they are, of a range equally spaced, on a logarithmic scale in equal ratios."""
    if axis.values is not None:
        numeric = all(isinstance(each, (int, float)) and not isinstance(each, bool) for each in axis.values)
        return np.array(axis.values) if numeric else np.array(axis.values, dtype=object)
    assert axis.count is not None
    parts = axis.count - 1 if axis.endpoint else axis.count
    number, parts = np.arange(axis.count), max(parts, 1)
    if axis.scale == "linear":
        # Whole numbers where the ends and the steps are whole, which low + (high − low) k/parts is not.
        values = (axis.low * (parts - number) + axis.high * number) / parts
    else:
        values = scaled(axis, number / parts)
        whole = np.rint(values)  # such as 10 and 100 between 1 and 1000
        values = np.where(np.abs(values - whole) <= ROUNDED * np.abs(whole), whole, values)
    if axis.endpoint and axis.count > 1:
        values[-1] = axis.high  # without a rounding error
    return values


def scaled(axis: AxisSpec, shares: np.ndarray) -> np.ndarray:
    """The values at places 0 … 1 of a range."""
    if axis.scale == "logarithmic":
        return np.asarray(axis.low * (axis.high / axis.low) ** shares)
    return axis.low + (axis.high - axis.low) * shares


def _plain(value: Any) -> Any:
    """A number of NumPy as a number of Python; a whole number of a list stays whole."""
    return value.item() if hasattr(value, "item") else value
