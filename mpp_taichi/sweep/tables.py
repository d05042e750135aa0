"""Tables: the results of a sweep as CSV and as NetCDF."""

import csv
import importlib.util
import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from mpp_taichi.atomic_file import whole_file
from mpp_taichi.sweep.results import SweepResults, with_texts
from mpp_taichi.version import __version__

BLOCK = 10_000  # rows that are made at once


def write_csv(results: SweepResults, path: Path) -> None:
    """A row for each member: its number, the values that vary, the measures, status, time, steps, particle and reason.

    A number has as many digits as it needs to be read again with the same bits; a member that is not done has empty measures.

    Raises:
        OutputError: it cannot be written.
    """
    with whole_file(path, "the table of the sweep") as temporary:
        with open(temporary, "w", encoding="utf-8", newline="") as stream:
            for text in _lines(results):
                stream.write(text)


def _lines(results: SweepResults) -> Iterator[str]:
    plan, fields = results.store.plan, results.fields
    columns = [results.column(name) for name in (*results.names, *fields)]
    yield _text([["member", *(axis.path for axis in plan.axes), *results.names, *fields]])
    for begin in range(0, results.count, BLOCK):
        members = np.arange(begin, min(begin + BLOCK, results.count))
        varied = plan.columns(members)
        rows = zip(members, *varied.values(), *(column[members] for column in columns), strict=True)
        yield _text([[_cell(each) for each in row] for row in rows])


def _text(rows: list[list[Any]]) -> str:
    stream = io.StringIO()
    csv.writer(stream, lineterminator="\n").writerows(rows)
    return stream.getvalue()


def _cell(value: Any) -> Any:
    plain = value.item() if hasattr(value, "item") else value
    if isinstance(plain, float):
        return "" if plain != plain else repr(plain)
    return plain


def write_netcdf(results: SweepResults, path: Path) -> bool:
    """NetCDF-4, which is HDF5 with dimension scales, as xarray, ncdump and HDF5 read it; False where h5py is not installed.

    A dimension for each key of a grid, or `member`; variables have `units` and `long_name`. Words are texts of UTF-8.

    Raises:
        OutputError: it cannot be written.
    """
    if importlib.util.find_spec("h5py") is None:
        return False
    import h5py

    # In memory: a file of HDF5 that cannot be finished, as on a full disk, stays open and breaks the next file of the process.
    with h5py.File(path.name, "w", driver="core", backing_store=False) as file:
        _fill(file, results)
        file.flush()
        image = file.id.get_file_image()
    with whole_file(path, "the table of the sweep") as temporary:
        temporary.write_bytes(image)
    return True


def write_parquet(results: SweepResults, path: Path) -> bool:
    """The table of `write_csv` as Parquet; False where pyarrow is not installed.

    Raises:
        OutputError: it cannot be written.
    """
    if importlib.util.find_spec("pyarrow") is None:
        return False
    import pyarrow
    from pyarrow import parquet

    members = np.arange(results.count)
    columns: dict[str, Any] = {"member": members, **results.store.plan.columns(members)}
    columns |= {name: results.column(name) for name in (*results.names, *results.fields)}
    arrays = {name: pyarrow.array(with_texts(values)) for name, values in columns.items()}
    with whole_file(path, "the table of the sweep") as temporary:
        parquet.write_table(pyarrow.table(arrays), temporary)
    return True


def _fill(file: Any, results: SweepResults) -> None:
    grid = results.store.plan.is_grid
    file.attrs["Conventions"] = "CF-1.10"
    file.attrs["title"] = results.store.scene.title
    file.attrs["source"] = f"mpp_taichi {__version__}"
    dimensions = {path: with_texts(values) for path, values in results.axes.items()} if grid else {}
    if not grid:
        dimensions = {"member": np.arange(results.count)}
    for number, (name, values) in enumerate(dimensions.items()):
        scale = _dataset(file, name, values)
        scale.make_scale(name)
        scale.attrs["_Netcdf4Dimid"] = np.int32(number)
        scale.attrs["long_name"] = name
    variables = {} if grid else {path: with_texts(values) for path, values in results.axes.items()}
    variables |= {name: results[name] for name in results.names}
    variables |= {name: results[name] for name in results.fields}
    for name, values in variables.items():
        dataset = _dataset(file, name, values)
        for k, dimension in enumerate(dimensions):
            dataset.dims[k].attach_scale(file[dimension])
        dataset.attrs["long_name"] = results.long_names.get(name, name)
        if results.units.get(name):
            dataset.attrs["units"] = results.units[name]


def _dataset(file: Any, name: str, values: np.ndarray) -> Any:
    import h5py

    key = name.replace("/", "∕")  # the sign that divides groups in HDF5
    if values.dtype.kind == "U":
        return file.create_dataset(key, data=values.astype(object), dtype=h5py.string_dtype())
    return file.create_dataset(key, data=values)
