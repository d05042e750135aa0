"""Vectors of fields, read and written component by component: the only way in explicit vectors (explicit_vectors.py)."""

import taichi as ti

from mpp_taichi.types import Template


@ti.func
def vector_at(field: Template, i):
    """field[i]."""
    return ti.Vector([field[i][k] for k in ti.static(range(field.n))])


@ti.func
def put_vector(field: Template, i, value: Template):
    """field[i] = value."""
    for k in ti.static(range(field.n)):
        field[i][k] = value[k]
