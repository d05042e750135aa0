"""Functions of a scene: `functions:`, each a curve through the points of a table, which formulas call by its name."""

import csv
import keyword
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import BaseModel, Field, TypeAdapter, ValidationError

from mpp_taichi.arithmetic.point_function import PointFunction
from mpp_taichi.scene.document import Node, from_python
from mpp_taichi.scene.expressions import RESERVED
from mpp_taichi.scene.faults import Faults, shown
from mpp_taichi.scene.fields import Context, FileBeside, Flag, ListOf, Number, Text, Wrong
from mpp_taichi.scene.parameters import STRICT
from mpp_taichi.scene.points import Pairs

FUNCTIONS_ALLOWED = 100
POINTS_ALLOWED = 100_000
FEWEST = 2
BYTES_ALLOWED = 1 << 26  # of a file of points


class FunctionSpec(BaseModel):
    """A function through points (x, y): a cubic spline, of which formulas take derivatives.

    The points are numbers of the scene, or two columns of a `.csv` file.
    """

    model_config = STRICT
    points: Annotated[tuple[tuple[float, float], ...] | None, Pairs(Number()), Field(description="[x, y] for each point")] = (
        None
    )
    file: Annotated[str | None, FileBeside(), Field(description="a .csv file in the scene's folder or below it")] = None
    columns: Annotated[
        tuple[str, str] | None,
        ListOf(Text(), (2,), "columns"),
        Field(description="the names of the columns of x and y; absent: the file has these two columns only"),
    ] = None
    repeats: Annotated[bool, Flag(), Field(description="whether the curve repeats itself beyond the last point")] = False


class _Unusable(Exception):
    """Why there is no curve through the points."""


def with_points_of_files(tree: Node, folder: Path, faults: Faults) -> Node:
    """The tree with the points of each file in the place of its name, so that a run that goes on has the curves it began with.

    A file that cannot be read becomes a fault here.
    """
    node = tree.get("functions")
    if node is None or not isinstance(node.value, dict):
        return tree
    changed = {name: _with_points(f"functions.{name}", entry, folder, faults) for name, entry in node.value.items()}
    return tree.with_value({**tree.value, "functions": node.with_value(changed)})


def _with_points(key: str, entry: Node, folder: Path, faults: Faults) -> Node:
    file, columns = entry.get("file"), entry.get("columns")
    if file is None or entry.get("points") is not None:
        return entry
    try:
        path = FileBeside().check(file.value, Context(folder=folder))
        chosen = None if columns is None else ListOf(Text(), (2,), "columns").check(columns.plain(), Context())
    except Wrong:
        return entry  # reported with the faults of all other keys
    try:
        points = _of_file(Path(path), chosen)
    except _Unusable as error:
        faults.add(file.location, key, str(error))
        return entry
    others = {name: child for name, child in entry.value.items() if name not in ("file", "columns")}
    return entry.with_value({**others, "points": from_python(points, file.location)})


def resolve(
    node: Node | None, constants: Mapping[str, float | None], folder: Path, faults: Faults
) -> dict[str, PointFunction | None]:
    """Every function of a scene by its name; None for a function whose fault is reported, here or with the other keys."""
    if node is None or not isinstance(node.value, dict):
        return {}
    if len(node.value) > FUNCTIONS_ALLOWED:
        faults.add(node.location, "functions", f"{len(node.value)} functions are too many, allowed: {FUNCTIONS_ALLOWED}")
        return {}
    return {str(name): _one(str(name), entry, constants, folder, faults) for name, entry in node.value.items()}


def _one(name: str, entry: Node, constants: Mapping[str, float | None], folder: Path, faults: Faults) -> PointFunction | None:
    key = f"functions.{name}"
    if not name.isidentifier() or keyword.iskeyword(name):
        faults.add(entry.place, key, f"{shown(name)} cannot be a name, allowed: letters, digits and _, a letter first")
        return None
    if name in RESERVED or name in constants:
        faults.add(entry.place, key, f"{shown(name)} means something already, choose another name")
        return None
    try:
        given = TypeAdapter(FunctionSpec).validate_python(entry.plain(), context=Context(constants, folder=folder))
    except ValidationError:
        return None  # reported with the faults of all other keys
    if given.file is not None and given.points is None:
        return None  # its fault was reported when the file was read
    try:
        if given.points is None or given.file is not None:
            raise _Unusable("must have points or a file" + ("" if given.file is None else ", not both"))
        if given.columns is not None:
            raise _Unusable("columns are those of a file")
        return _through(name, np.array(given.points, float).reshape(-1, 2), repeats=given.repeats)
    except _Unusable as error:
        at = entry.get("points") or entry
        faults.add(at.place if at is entry else at.location, key, str(error))
        return None


def _through(name: str, points: np.ndarray, *, repeats: bool) -> PointFunction:
    """The curve through points."""
    x, y = points[:, 0], points[:, 1]
    if not FEWEST <= len(x) <= POINTS_ALLOWED:
        raise _Unusable(f"has {len(x)} points, allowed: {FEWEST} to {POINTS_ALLOWED}")
    if not (np.diff(x) > 0.0).all():
        k = int(np.argmin(np.diff(x) > 0.0)) + 1
        raise _Unusable(f"x must ascend from point to point, but x = {x[k]:g} of point {k} follows {x[k - 1]:g}")
    if repeats and y[0] != y[-1]:
        raise _Unusable(f"a curve that repeats must end with the y that it begins with, {y[0]:g}, not with {y[-1]:g}")
    made = PointFunction(name, x, y, repeats=repeats)
    with np.errstate(all="ignore"):
        if not np.isfinite(made.coefficients).all():
            raise _Unusable("the points are too near each other, or too far apart, for a curve with finite slopes")
    return made


def _of_file(path: Path, columns: tuple[str, str] | None) -> np.ndarray:
    """Two columns of a table."""
    if path.suffix != ".csv":
        raise _Unusable(f"{path.name}: must be a .csv file")
    try:
        if path.stat().st_size > BYTES_ALLOWED:
            raise _Unusable(f"{path.name}: is larger than {BYTES_ALLOWED} bytes")
        rows = list(csv.reader(path.read_text(encoding="utf-8-sig").splitlines(), strict=True))
    except (OSError, UnicodeDecodeError, csv.Error) as error:
        raise _Unusable(f"{path.name}: cannot be read as a table: {str(error).splitlines()[0]}") from None
    numbered = [(number, [cell.strip() for cell in row]) for number, row in enumerate(rows, start=1)]
    numbered = [(number, row) for number, row in numbered if any(row) and not row[0].startswith("#")]
    if not numbered:
        raise _Unusable(f"{path.name}: is empty")
    header, body = numbered[0][1], numbered[1:]
    if columns is None and len(header) == FEWEST and all(map(_is_number, header)):
        body = numbered  # without a header
    return np.array([_cells(path, number, row, header, _places(path, header, columns)) for number, row in body]).reshape(-1, 2)


def _places(path: Path, header: list[str], columns: tuple[str, str] | None) -> list[int]:
    """Where the two columns stand in a row."""
    if columns is None:
        if len(header) != FEWEST:
            raise _Unusable(
                f"{path.name}: has {len(header)} columns, {', '.join(header)}; say with columns: which two are x and y"
            )
        return [0, 1]
    for column in columns:
        if header.count(column) != 1:
            raise _Unusable(f"{path.name}: has no single column {shown(column)}, found: {', '.join(header)}")
    return [header.index(column) for column in columns]


def _cells(path: Path, number: int, row: list[str], header: list[str], places: list[int]) -> list[float]:
    """The two numbers of a row."""
    if len(row) != len(header):
        raise _Unusable(f"{path.name}: line {number} has {len(row)} entries, the header {len(header)}")
    found = []
    for place in places:
        try:
            value = float(row[place])
        except ValueError:
            value = float("nan")
        if not np.isfinite(value):
            raise _Unusable(f"{path.name}: line {number}: {shown(row[place])} is not a finite number")
        found.append(value)
    return found


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return True
