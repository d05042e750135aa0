"""Copies of arrays to fields and back, with one launch for all arrays of the same length and type.

Taichi itself compiles a kernel for every field that it copies to or from NumPy, in 40 ms at the first start and 13 ms at later
starts. For a scene of few bodies these kernels took a quarter of the start, and the copies of a run of a few steps took longer
than its steps. Short copies on a CPU wake no other thread.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.device.fast_taichi.serial_loops import is_short
from mpp_taichi.types import Template

MOST = 32
"""Fields of one launch. The loop over them is unrolled; Taichi warns of more."""


def write(fields: Sequence[Any], arrays: Sequence[np.ndarray]) -> None:
    """Copy arrays of shape (count,) or (count, components), with the number type of their fields, to the fields."""
    groups: dict[tuple, list[tuple[Any, np.ndarray]]] = {}
    for field, array in zip(fields, arrays, strict=True):
        groups.setdefault((len(array), array.dtype), []).append((field, array.reshape(len(array), -1)))
    for (count, _), members in groups.items():
        for some in _in_parts(members):
            values = np.concatenate([array for _, array in some], axis=1)
            _write(tuple([field for field, _ in some]), np.ascontiguousarray(values), is_short(count))


def read(fields: Sequence[Any], dtype: type) -> list[np.ndarray]:
    """Arrays of vector fields of one length, (count, components)."""
    count, widths = fields[0].shape[0], [_width(field) for field in fields]
    return _read_columns(tuple(fields), count, widths, dtype)


def clear(fields: Sequence[Any]) -> None:
    """Set all entries of fields to 0."""
    _clear(tuple(fields), all(is_short(field.shape[0]) for field in fields))


class MixedFields:
    """Fields of any lengths and number types that are read together again and again; they are grouped once."""

    def __init__(self, fields: Sequence[Any]) -> None:
        """Group scalar fields and vector fields with one axis."""
        self._count = len(fields)
        groups: dict[tuple, list[int]] = {}
        for place, field in enumerate(fields):
            groups.setdefault((field.shape[0], ti.lang.util.to_numpy_type(field.dtype)), []).append(place)
        self._groups = [
            (places, tuple([fields[place] for place in places]), [_width(fields[place]) for place in places], count, dtype)
            for (count, dtype), all_places in groups.items()
            for places in _in_parts(all_places)
        ]

    def read(self) -> list[np.ndarray]:
        """Their values in their order, (count, components), bit for bit."""
        found: list[Any] = [None] * self._count
        for places, fields, widths, count, dtype in self._groups:
            for place, values in zip(places, _read_columns(fields, count, widths, dtype)):
                found[place] = values
        return found


def _in_parts(members: list) -> list[list]:
    return [members[first : first + MOST] for first in range(0, len(members), MOST)]


def _read_columns(fields: tuple, count: int, widths: list[int], dtype: type) -> list[np.ndarray]:
    values = np.empty((count, sum(widths)), dtype)
    _read(fields, values, is_short(count))
    if len(widths) == 1:
        return [values]
    found, first = [], 0
    for width in widths:
        found.append(np.ascontiguousarray(values[:, first : first + width]))
        first += width
    return found


def _width(field: Any) -> int:
    return field.n if isinstance(field, ti.MatrixField) else 1


def _columns(fields: Sequence[Any]) -> list[tuple[Any, bool, int]]:
    """Each field, whether it holds vectors, and its first column."""
    firsts = np.cumsum([0, *map(_width, fields)]).tolist()
    return [(field, isinstance(field, ti.MatrixField), first) for field, first in zip(fields, firsts)]


@ti.kernel
def _clear(fields: Template, serial: Template):
    for field in ti.static(fields):
        ti.loop_config(serialize=serial)
        for i in range(field.shape[0]):
            field[i] = 0


@ti.kernel
def _write(fields: Template, values: ti.types.ndarray(ndim=2), serial: Template):
    ti.loop_config(serialize=serial)
    for i in range(values.shape[0]):
        for field, is_vector, first in ti.static(_columns(fields)):
            if ti.static(is_vector):
                for k in ti.static(range(field.n)):
                    field[i][k] = values[i, first + k]
            else:
                field[i] = values[i, first]


@ti.kernel
def _read(fields: Template, values: ti.types.ndarray(ndim=2), serial: Template):
    ti.loop_config(serialize=serial)
    for i in range(values.shape[0]):
        for field, is_vector, first in ti.static(_columns(fields)):
            if ti.static(is_vector):
                for k in ti.static(range(field.n)):
                    values[i, first + k] = field[i][k]
            else:
                values[i, first] = field[i]
