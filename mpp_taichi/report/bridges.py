"""A result as tables of pandas and as a dataset of xarray; the packages are imported when they are asked for."""

import importlib
import sys
from typing import Any

import numpy as np

from mpp_taichi.errors import MissingPackageError
from mpp_taichi.missing_package import is_absent

AXES = ("x", "y", "z")
_OF_PARTICLES = ("mass", "radius", "charge")


def to_pandas(result: Any, *, particles: bool = False) -> Any:
    """The table of a result as a DataFrame by time; or its moments, a row for each particle at each time.

    A vector is three columns: momentum_x, momentum_y, momentum_z.
    """
    pandas = _package("pandas", "to_pandas")
    if not particles:
        table = _columns({key: values for key, values in result.table.items() if key != "time"})
        return pandas.DataFrame(table, index=pandas.Index(result.table["time"], name="time"))
    moments, count = len(result.time), result.position.shape[1]
    index = pandas.MultiIndex.from_arrays(
        [np.repeat(result.time, count), np.tile(np.arange(count), moments)], names=["time", "particle"]
    )
    named = {"name": np.tile(np.array(result.moments[0].name, dtype=object), moments)} if any(result.moments[0].name) else {}
    places = {key: getattr(result, key).reshape(-1, 3) for key in ("position", "velocity")}
    return pandas.DataFrame({**named, **_columns(places)}, index=index)


def to_xarray(result: Any) -> Any:
    """A Dataset with the dimensions time, particle and axis: places, velocities, masses, and the columns of the table.

    Where the table has other times than the moments, its columns have the dimension `sample`.
    """
    xarray = _package("xarray", "to_xarray")
    first, units = result.moments[0], result.simulation.scene.units or {}
    along = "time" if np.array_equal(result.table["time"], result.time) else "sample"
    variables: dict[str, Any] = {
        "position": (("time", "particle", "axis"), result.position, _unit(units, "length")),
        "velocity": (("time", "particle", "axis"), result.velocity, _unit(units, "length", "time")),
    }
    variables |= {key: ("particle", getattr(first, key)) for key in _OF_PARTICLES}
    for key, values in result.table.items():
        if key != "time":
            variables[key] = ((along, "axis") if values.ndim > 1 else (along,), values)
    coordinates: dict[str, Any] = {
        "time": ("time", result.time, _unit(units, "time")),
        "particle": np.arange(result.position.shape[1]),
        "axis": list(AXES),
    }
    if any(first.name):
        coordinates["name"] = ("particle", np.array(first.name))
    if along == "sample":
        coordinates["sample_time"] = ("sample", result.table["time"])
    told = ("title", "scene", "integrator", "dt", "precision", "backend", "status")
    return xarray.Dataset(variables, coords=coordinates, attrs={key: result.summary[key] for key in told})


def _columns(table: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The table with three columns in place of each vector."""
    found: dict[str, np.ndarray] = {}
    for key, values in table.items():
        if values.ndim > 1:
            found |= {f"{key}_{axis}": values[:, k] for k, axis in enumerate(AXES)}
        else:
            found[key] = values
    return found


def _unit(units: dict[str, str], above: str, below: str = "") -> dict[str, str]:
    """The attribute that plots of xarray show at an axis; none where the scene has no units."""
    if not units:
        return {}
    return {"units": units[above] + (f"/{units[below]}" if below else "")}


def _package(name: str, method: str) -> Any:
    """The package of a name.

    Raises:
        MissingPackageError: this Python does not have it.
    """
    if is_absent(name):
        raise MissingPackageError(f"{method} needs the package {name}: {sys.executable} -m pip install {name}")
    return importlib.import_module(name)
