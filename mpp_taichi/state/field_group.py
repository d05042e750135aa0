"""Fields that are allocated together, and freed together."""

from typing import Any

import taichi as ti

Row = tuple[Any, ...]
"""A count and the fields of so many entries; a count of None is a field of one entry, `field[None]`. The entries of fields in
a tuple, or in `SideBySide`, lie side by side."""


class SideBySide(tuple):
    """Scalar fields whose entries lie side by side, as those of a tuple do, but which explicit vectors can read one by one.

    In kernels with explicit vectors Taichi takes a wrong address for a field that shares its parent with others. So each field
    has a parent of its own, a dense node of one entry.
    """


class FieldGroup:
    """The memory of some fields, in one tree for numbers of 4 bytes and one for numbers of 8 bytes.

    In a tree with 4-byte numbers, 8-byte numbers may lie across their alignment, and on Vulkan they share bytes with others.

        memory = FieldGroup((count, self.mass, self.radius), (1, self.total))
        memory.destroy()
    """

    def __init__(self, *rows: Row) -> None:
        """Allocate all fields; needs a started Taichi."""
        builders: dict[int, Any] = {}
        for count, *parts in rows:
            for part in parts:
                fields = part if isinstance(part, tuple) else (part,)
                width = _bytes_each(fields[0])
                if width not in builders:
                    builders[width] = ti.FieldsBuilder()
                place = builders[width] if count is None else builders[width].dense(ti.i, count)
                if isinstance(part, SideBySide):
                    for field in fields:
                        place.dense(ti.i, 1).place(field)
                else:
                    place.place(*fields)
        self._trees = [builder.finalize() for builder in builders.values()]

    def destroy(self) -> None:
        """Free the memory; the fields must not be used any more."""
        for tree in self._trees:
            tree.destroy()


def field_of_kind(kind: str, dimensions: int, wide: Any) -> Any:
    """A field of one of the kinds that a part of a step asks for by name; `wide` is the type of wide numbers."""
    made = {
        "vector": lambda: ti.Vector.field(dimensions, float),
        "vector4": lambda: ti.Vector.field(4, float),
        "vector8": lambda: ti.Vector.field(8, float),
        "matrix": lambda: ti.Matrix.field(dimensions, dimensions, float),
        "scalar": lambda: ti.field(float),
        "index": lambda: ti.field(ti.i32),
        "lattice": lambda: ti.Vector.field(dimensions, ti.i64),
        "vector2": lambda: ti.Vector.field(2, float),
        "wide": lambda: ti.field(wide),
        "wide_vector2": lambda: ti.Vector.field(2, wide),
    }
    return made[kind]()


def _bytes_each(field: Any) -> int:
    """Bytes of each number of a field that is not placed yet; `field.dtype` is known only afterwards."""
    name: str = field._get_field_members()[0].ptr.get_dt().to_string()  # such as "f64"
    return int(name[1:]) // 8
