"""Annotations that mean one thing to Taichi and another to a type checker."""

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    Template = Any
else:
    import taichi as ti

    Template = ti.template()
