"""Copies of arrays to fields and back, with one launch for all arrays of the same length and type.

Taichi itself compiles a kernel for every field that it copies to or from NumPy, in 40 ms at the first start and 13 ms at later
starts. For a scene of few bodies these kernels took a quarter of the start.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
import taichi as ti

from mpp_taichi.types import Template


def write(fields: Sequence[Any], arrays: Sequence[np.ndarray]) -> None:
    """Copy arrays of shape (count,) or (count, components), with the number type of their fields, to the fields."""
    groups: dict[tuple, list[tuple[Any, np.ndarray]]] = {}
    for field, array in zip(fields, arrays, strict=True):
        groups.setdefault((len(array), array.dtype), []).append((field, array.reshape(len(array), -1)))
    for members in groups.values():
        values = np.concatenate([array for _, array in members], axis=1)
        _write(tuple(field for field, _ in members), np.ascontiguousarray(values))


def read(fields: Sequence[Any], dtype: type) -> list[np.ndarray]:
    """Arrays of vector fields of one length, (count, components)."""
    widths = [_width(field) for field in fields]
    values = np.empty((fields[0].shape[0], sum(widths)), dtype)
    _read(tuple(fields), values)
    return [np.ascontiguousarray(part) for part in np.split(values, np.cumsum(widths)[:-1], axis=1)]


def _width(field: Any) -> int:
    return field.n if isinstance(field, ti.MatrixField) else 1


def _columns(fields: Sequence[Any]) -> list[tuple[Any, bool, int]]:
    """Each field, whether it holds vectors, and its first column."""
    firsts = np.cumsum([0, *map(_width, fields)]).tolist()
    return [(field, isinstance(field, ti.MatrixField), first) for field, first in zip(fields, firsts)]


@ti.kernel
def _write(fields: Template, values: ti.types.ndarray(ndim=2)):
    for i in range(values.shape[0]):
        for field, is_vector, first in ti.static(_columns(fields)):
            if ti.static(is_vector):
                for k in ti.static(range(field.n)):
                    field[i][k] = values[i, first + k]
            else:
                field[i] = values[i, first]


@ti.kernel
def _read(fields: Template, values: ti.types.ndarray(ndim=2)):
    for i in range(values.shape[0]):
        for field, is_vector, first in ti.static(_columns(fields)):
            if ti.static(is_vector):
                for k in ti.static(range(field.n)):
                    values[i, first + k] = field[i][k]
            else:
                values[i, first] = field[i]
