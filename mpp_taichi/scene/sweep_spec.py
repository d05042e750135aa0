"""Sweep specification: the block `sweep:` of a scene, checked. It holds which numbers vary and which results are measured."""

from dataclasses import dataclass
from typing import Any

from mpp_taichi.scene.location import Location
from mpp_taichi.scene.spec import Expectation


@dataclass(frozen=True)
class AxisSpec:
    """The values of one key of the scene: a list, or `count` values from `low` to `high`.

    path      the key, as `--set` takes it
    values    of a list; None for a range
    low, high, count, scale, endpoint   of a range: `scale` is linear or logarithmic; without `endpoint` the value `high` is
              left out, as for an angle. `count` is None where `sample:` draws the values
    """

    path: str
    values: tuple[Any, ...] | None = None
    low: float = 0.0
    high: float = 0.0
    count: int | None = None
    scale: str = "linear"
    endpoint: bool = True


@dataclass(frozen=True)
class SampleSpec:
    """Values that are drawn in place of a grid: `count` points, random or of Sobol's sequence, with a seed."""

    kind: str
    count: int
    seed: int = 0


@dataclass(frozen=True, eq=False)
class SweepSpec:
    """Members of a sweep, and the results of each.

    combine   crossed: every value with every other value; zipped: the first values, the second values, …
    refine    share of the range of a measure: a cell of the grid whose corners differ by more is refined; None: all are run
    stop      a member ends as soon as one of these conditions holds in a sample
    """

    axes: tuple[AxisSpec, ...]
    combine: str
    sample: SampleSpec | None
    measure: tuple[Expectation, ...]
    stop: tuple[Expectation, ...]
    refine: float | None
    location: Location
