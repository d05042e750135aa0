"""Vectors of fields, read and written component by component: the only way in explicit vectors (explicit_vectors.py).

A field of double-single numbers (state/two_part_field.py) takes part: its entry is a vector of such numbers already.
"""

from typing import Any

import taichi as ti

from mpp_taichi.arithmetic.traced import traced
from mpp_taichi.types import Template


@traced
def vector_at(field: Any, i: Any) -> Any:
    """field[i]."""
    entry = ti.lang.impl.subscript(None, field, i)
    if not isinstance(field, ti.MatrixField):
        return entry
    return ti.lang.matrix.make_matrix([ti.lang.impl.subscript(None, entry, k) for k in range(field.n)])


@ti.func
def put_vector(field: Template, i, value: Template):
    """field[i] = value."""
    for k in ti.static(range(field.n)):
        field[i][k] = value[k]
